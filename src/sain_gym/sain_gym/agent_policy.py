"""The agent as a policy: what evaluations and the graph run, behind the environment's interface."""

from typing import Any, Final

import gymnasium
import numpy as np

from sain_core.errors import ConfigError, ErrorCode, NoPushError
from sain_core.types import PushArray
from sain_eval.loop.closed_loop import agent_maker
from sain_gym.episode import PushEpisode
from sain_gym.push_env import PushEnv
from sain_mppi.agent import events
from sain_mppi.agent.agent import act

Decision = events.PushDecision | events.Stop | None
EPISODE: Final = 1  # its id; the agent is new in each


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
        self._goals = self._push_id = self._decided = 0  # goals reached, and steps then
        self._action = np.zeros(0)

    def __call__(self, observation: Any = None, info: Any = None) -> PushArray:
        """Return an action for the environment as it is; neither argument is looked at.

        Called again before the next step, it returns the same action.

        Raises `NoPushError`: the agent has none, and why; `EpisodeEndedError`: no episode has
        begun.
        """
        episode = self._env.episode
        if episode is not self._episode:
            decision = self._begin(episode)
        elif episode.steps == self._decided:
            return self._action.copy()
        else:
            decision = act(self._agent, self._ended(episode))
        decision = decision or self._look(episode)
        if episode.goals_reached > self._goals and not episode.is_success:  # it found this, too
            decision = self._pursue(episode) or self._look(episode)
        if not isinstance(decision, events.PushDecision):
            reason = decision.failure or "the goal is reached" if decision else "the scene moves"
            raise NoPushError(f"the agent has no push for this scene: {reason}")
        self._push_id, self._decided = decision.push_id, episode.steps
        self._action = decision.push
        return self._action.copy()

    def _begin(self, episode: PushEpisode) -> Decision:
        """Let a new agent follow the first goal of an episode."""
        self._episode, self._agent = episode, self._make(episode.case)
        begun = events.EpisodeBegun(EPISODE, episode.case.parameters().bodies)
        return act(self._agent, begun) or self._pursue(episode)

    def _pursue(self, episode: PushEpisode) -> Decision:
        """Let the agent follow the present goal."""
        record, pushes = episode.record, episode.case.max_pushes
        self._goals = episode.goals_reached
        task = events.Task(self._goals + 1, EPISODE, record.goal, pushes)
        return act(self._agent, events.GoalGiven(task))

    def _ended(self, episode: PushEpisode) -> events.PushEnded:
        """Return what came of the last push."""
        record = episode.answer
        assert record is not None, "a step has an answer"
        executed = record if record.code == ErrorCode.OK else None
        return events.PushEnded(self._push_id, record.code, record=executed, episode_id=EPISODE)

    def _look(self, episode: PushEpisode) -> Decision:
        return act(self._agent, events.SceneObserved(episode.scene, EPISODE, episode.pushes + 1))
