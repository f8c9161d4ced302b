"""The agent as a policy: what evaluations and the graph run, behind the environment's interface."""

from typing import Any, Final

import gymnasium
import numpy as np

from sain_core.errors import ConfigError, ErrorCode, NoPushError
from sain_core.types import PushArray
from sain_eval.loop.controllers import agent_maker
from sain_gym.episode import PushEpisode
from sain_gym.push_env import PushEnv
from sain_mppi.loop.agent import AgentConfig
from sain_mppi.loop.decision import PushDecision, Stop, Task

EPISODE: Final = 1  # its id; the agent is new in each


class AgentPolicy:
    """Chooses actions as an evaluation does: the same scenes and seed give the same pushes.

    It reads scene, shapes and goal from the environment, so it is a teacher for both observations,
    and for an environment in wrappers.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        controller: str = "sain",
        config: AgentConfig = AgentConfig(),
    ) -> None:
        """Load a controller by a name of `sain_eval evaluate`.

        Raises:
            ConfigError: an unknown controller, or another environment.
            CheckpointError: a checkpoint that cannot be loaded.
        """
        inner = env.unwrapped
        if not isinstance(inner, PushEnv):
            raise ConfigError(f"the agent plays sain/Push-v0, not {type(inner).__name__}")
        self._env = inner
        self._make = agent_maker(controller, config)
        self._episode: PushEpisode | None = None
        self._goals = self._push_id = self._decided = 0  # goals reached, and steps then
        self._action = np.zeros(0)

    def __call__(self, observation: Any = None, info: Any = None) -> PushArray:
        """Return an action for the environment as it is; neither argument is looked at.

        Called again before the next step, it returns the same action.

        Raises:
            NoPushError: the agent has none, and why.
            EpisodeEndedError: no episode has begun.
        """
        episode = self._env.episode
        if episode is not self._episode:
            self._begin(episode)
        elif episode.steps == self._decided:
            return self._action.copy()
        else:
            self._learn(episode)
        decision = self._decide(episode)
        if not isinstance(decision, PushDecision):
            reason = decision.failure or "the goal is reached" if decision else "the scene moves"
            raise NoPushError(f"the agent has no push for this scene: {reason}")
        self._push_id, self._decided = decision.push_id, episode.steps
        self._action = self._env.spaces.action_of(decision.push)
        return self._action.copy()

    def _begin(self, episode: PushEpisode) -> None:
        """Let a new agent meet the bodies of an episode and follow its first goal."""
        self._episode, self._agent = episode, self._make(episode.case)
        bodies = episode.case.parameters().bodies
        if not bodies.are_paper_disks:  # an agent takes bodies to be these
            self._agent.meet(EPISODE, bodies)
        self._aim(episode)

    def _aim(self, episode: PushEpisode) -> Stop | None:
        record, case = episode.record, episode.case
        self._goals = episode.goals_reached
        return self._agent.aim(
            Task(self._goals + 1, EPISODE, record.goal, record.tolerance, case.max_pushes)
        )

    def _learn(self, episode: PushEpisode) -> None:
        """Tell the agent what came of the last push, and which goal comes next."""
        answer, agent = episode.answer, self._agent
        assert answer is not None, "a step has an answer"
        if answer.code == ErrorCode.OK:
            agent.learn(EPISODE, answer.before, answer.push, answer.after)
        agent.answered(self._push_id, answer.code)
        if episode.goals_reached > self._goals and not episode.is_success:
            self._decide(episode)  # it finds the goal reached
            self._aim(episode)

    def _decide(self, episode: PushEpisode) -> PushDecision | Stop | None:
        self._agent.see(episode.scene, EPISODE, episode.pushes + 1, settled=True)
        return self._agent.act()
