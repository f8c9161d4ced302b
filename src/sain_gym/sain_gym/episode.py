"""An episode of the environment: goals, counts, rewards and how it ends; no engine in here."""

from typing import Any, Final, NamedTuple

from sain_core.errors import ErrorCode, SainError
from sain_core.feasibility import Feasibility
from sain_core.goal import TURN_PER_METRE
from sain_core.types import PushArray, Scene
from sain_core.world import PushRecord
from sain_eval.episode import EpisodeRecord, Tolerance
from sain_eval.loop.play import is_final, why_lost
from sain_eval.scenes.families import ScenarioScene
from sain_mppi.agent.agent import AgentConfig

TABLE: Final = Feasibility().table
MOST_REFUSALS: Final = AgentConfig().max_refusals  # from one scene, as in an evaluation


class StepVerdict(NamedTuple):
    """What a step is worth, and whether it was the last."""

    reward: float
    terminated: bool
    truncated: bool


class PushEpisode:
    """One scene to solve. Its goals follow one another, each with its own number of pushes.

    Attributes:
        case: the scene to solve.
        goals: within the tolerance, in order.
        scene: (N, 8), as it is now.
        record: of the present goal: what `left` and success are taken from.
        pushes: executed so far.
        refusals: so far.
        goals_reached: so far.
        answer: what came of the last push; None: there was none.
        failure: why the episode ended short of a goal; empty: it did not.
        over: whether it has ended.
    """

    def __init__(
        self, case: ScenarioScene, scene: Scene, within: Tolerance, refusal_cost: float = 0.0
    ) -> None:
        """Begin in a scene (N, 8)."""
        self.case, self.scene = case, scene
        self.goals = [within.apply(goal) for goal in case.goals]
        self._refusal_cost = refusal_cost
        self.pushes = self.refusals = self.goals_reached = 0
        self.answer: PushRecord | None = None
        self.failure = ""
        self.over = False
        self._aim()

    def _aim(self) -> None:
        """Take the next goal."""
        goal, bodies = self.goals[self.goals_reached], self.case.bodies
        self.record = EpisodeRecord(goal, (), self.scene, bodies)
        self._left = self.case.max_pushes
        self._refused = 0  # in a row

    @property
    def steps(self) -> int:
        """Pushes so far, refused ones too."""
        return self.pushes + self.refusals

    @property
    def is_success(self) -> bool:
        """Whether all goals were reached."""
        return self.goals_reached == len(self.goals)

    @property
    def miss(self) -> float:
        """How far the bodies are from the goal [m]: their distance, and a metre for each 5 rad."""
        judged = self.record.judge(self.scene)
        return judged.distance + judged.turn / TURN_PER_METRE

    def execute(self, push: PushArray, after: Scene) -> StepVerdict:
        """Take note of an executed push (5,) and the scene (N, 8) after it."""
        self.answer = PushRecord(push, self.scene, after)
        self.scene = after
        self.pushes += 1
        self._left -= 1
        self._refused = 0
        if lost := why_lost(after, self.pushes, TABLE):
            return self._fail(lost)
        reward = -self.miss
        while not self.is_success and self.record.judge(after).reached:
            self.goals_reached += 1
            if not self.is_success:
                self._aim()
        exhausted = not self.is_success and self._left == 0
        if exhausted:
            self.failure = f"{self.case.max_pushes} pushes left the goal unreached"
        self.over = self.is_success or exhausted
        return StepVerdict(reward, self.is_success, exhausted)

    def refuse(self, push: PushArray, error: SainError) -> StepVerdict:
        """Take note of a push (5,) that was refused: nothing has moved."""
        scene, code = self.scene, ErrorCode(error.code)
        self.answer = PushRecord(push, scene, scene, code=code, message=str(error))
        self.refusals += 1
        self._refused += 1
        if is_final(error):
            return self._fail(f"{type(error).__name__}: {error}")
        if self._refused >= MOST_REFUSALS:
            several = f"{self._refused} pushes in a row were refused from this scene"
            return self._fail(f"{several}, the last: {error}")
        return StepVerdict(-self.miss - self._refusal_cost, False, False)

    def _fail(self, failure: str) -> StepVerdict:
        """End short of the goal: what the scene is worth counts for each push that was left."""
        self.failure, self.over = failure, True
        refused = self.answer is not None and self.answer.code != ErrorCode.OK
        cost = self._refusal_cost if refused else 0.0
        return StepVerdict(-self.miss * (1 + self._left) - cost, True, False)

    def info(self) -> dict[str, Any]:
        """Return what is known besides the observation."""
        judged = self.record.judge(self.scene)
        answer = self.answer
        return {
            "scene_seed": self.case.seed,
            "is_success": self.is_success,
            "distance": judged.distance,  # [m]
            "turn": judged.turn,  # [rad]
            "pushes": self.pushes,
            "refusals": self.refusals,
            "goals_reached": self.goals_reached,
            "refusal_code": int(ErrorCode.OK if answer is None else answer.code),
            "refusal": "" if answer is None else answer.message,
            "failure": self.failure,
        }
