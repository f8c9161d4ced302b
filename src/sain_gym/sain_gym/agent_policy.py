"""The agent as a policy: what evaluations and the graph run, behind the environment's interface."""

from typing import Any

import gymnasium
import numpy as np

from sain_core.errors import ConfigError, NoPushError
from sain_core.types import PushArray
from sain_eval.loop.closed_loop import agent_maker
from sain_eval.loop.play import Play, Sight
from sain_gym.episode import PushEpisode
from sain_gym.push_env import PushEnv


class AgentPolicy:
    """Chooses actions as an evaluation does: the same scenes and seed give the same pushes.

    It reads scene, shapes and goal from the environment, so it is a teacher for both observations,
    and for an environment in wrappers.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], controller: str = "sain") -> None:
        """Load a controller by a name of `sain_eval evaluate`.

        Raises `ConfigError`: an unknown controller, or another environment; `CheckpointError`: a
        checkpoint that cannot be loaded.
        """
        inner = env.unwrapped
        if not isinstance(inner, PushEnv):
            raise ConfigError(f"the agent plays sain/Push-v0, not {type(inner).__name__}")
        self._env = inner
        self._make = agent_maker(controller)
        self._episode: PushEpisode | None = None
        self._decided = 0  # steps when it decided last
        self._action = np.zeros(0)

    def __call__(self, observation: Any = None, info: Any = None) -> PushArray:
        """Return an action for the environment as it is; neither argument is looked at.

        Called again before the next step, it returns the same action.

        Raises `NoPushError`: the agent has none, and why; `EpisodeEndedError`: no episode has
        begun.
        """
        episode = self._env.episode
        try:
            if episode is not self._episode:
                self._begin(episode)
                self._action = next(self._pushes).push
            elif episode.steps != self._decided:
                assert episode.answer is not None, "a step has an answer"
                self._action = self._pushes.send(episode.answer).push
        except StopIteration:
            reason = self._play.failure or "the goal is reached"
            raise NoPushError(f"the agent has no push for this scene: {reason}") from None
        self._decided = episode.steps
        return self._action.copy()

    def _begin(self, episode: PushEpisode) -> None:
        """Let a new agent follow the goals of an episode."""
        self._episode, case = episode, episode.case
        self._play = Play(self._make(case), Sight(self._env.world))
        bodies = case.parameters().bodies
        self._pushes = self._play.pushes(episode.goals, bodies, case.max_pushes)
