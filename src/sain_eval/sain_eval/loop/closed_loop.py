"""An episode without ROS: the agent decides, the simulated arm pushes."""

from dataclasses import dataclass

import numpy as np

from sain_core.errors import SainError
from sain_core.push_record import PushRecord
from sain_core.scene import POSITION, is_settled
from sain_core.types import Scene
from sain_eval.loop.eyes import Eyes
from sain_eval.plots.episode_record import EpisodeRecord
from sain_eval.scenes.scenario_scene import ScenarioScene
from sain_eval.tolerance import Tolerance
from sain_mppi.loop.agent import Agent, act
from sain_mppi.loop.decision import PushDecision, Stop, StopReason, Task
from sain_mppi.loop.events import EpisodeBegun, GoalGiven, PushEnded, PushExecuted, SceneSeen
from sain_mppi.loop.goal_tracker import LOOK_AGAIN
from sain_mppi.search.poses import PoseGoal
from sain_sim.world.camera import WorldCameraConfig
from sain_sim.world.outcome import DivergedError
from sain_sim.world.workcell import WorldConfig
from sain_sim.world.world import World

EPISODE = 1  # its id; the agent is new in each


@dataclass(frozen=True)
class EpisodeOutcome:
    """What became of an episode."""

    record: EpisodeRecord  # of its last goal
    final: Scene  # (N, 8)
    refusals: int
    failure: str  # why it ended short of the tightest tolerance; empty when it did not
    fallen: bool  # a body left the table
    fallbacks: int = 0  # pushes that physics planned because the model failed
    earlier: tuple[EpisodeRecord, ...] = ()  # of goals that were reached before, without a reset

    @property
    def records(self) -> tuple[EpisodeRecord, ...]:
        """The records of all goals that were given, in order."""
        return (*self.earlier, self.record)


def run_episode(
    case: ScenarioScene,
    agent: Agent,
    tolerance: Tolerance | float,
    world_config: WorldConfig | None = None,
    camera: WorldCameraConfig = WorldCameraConfig(),
) -> EpisodeOutcome:
    """Play one scene with an agent until all its goals are reached, or it stops.

    Each is to be reached within tolerance; a number is a distance [m]. The agent sees the world as
    the camera does. All that is returned is the truth.
    """
    config, parameters = world_config or WorldConfig(), case.parameters()
    with World(parameters, config, engine=case.truth.engine) as world:
        eyes = Eyes(world, camera, case.seed)
        play = _Play(agent, world, eyes, world.reset(case.disks))
        act(agent, EpisodeBegun(EPISODE, parameters.bodies))
        records: list[EpisodeRecord] = []
        for number, given in enumerate(case.goals, start=1):
            within = Tolerance.of(tolerance)
            goal = within.apply(given)
            start, first = play.scene, len(play.pushes)
            play.pursue(Task(number, EPISODE, goal, within.distance, case.max_pushes))
            made = tuple(play.pushes[first:])
            records.append(
                EpisodeRecord(
                    goal, within.distance, made, start, case.shapes, roles=tuple(case.roles)
                )
            )
            if play.failure:
                break
        scene = play.scene
    fallen = bool(~config.feasibility.table.contains(scene[:, POSITION]).all())
    return EpisodeOutcome(
        records[-1],
        scene,
        play.refusals,
        play.failure,
        fallen,
        play.fallbacks,
        tuple(records[:-1]),
    )


class _Play:
    """An episode while it goes on."""

    def __init__(self, agent: Agent, world: World, eyes: Eyes, scene: Scene) -> None:
        """Begin in a scene (N, 8)."""
        self._agent, self._world, self._eyes = agent, world, eyes
        self.scene = scene
        self.pushes: list[PushRecord] = []
        self.refusals = self.fallbacks = 0
        self.failure = ""

    def pursue(self, task: Task) -> None:
        """Push until the agent stops; `failure` is why it stopped short of the goal."""
        decision = act(self._agent, GoalGiven(task))
        while not self.failure:
            decision = decision or self._look()
            if not isinstance(decision, PushDecision):
                self.failure = _failure(decision) if decision else self._unsettled()
                return
            decision = self._carry_out(decision)

    def _look(self) -> PushDecision | Stop | None:
        """Let the agent look until it decides; None: there is nothing that it can decide on."""
        settled = bool(is_settled(self.scene))
        for frame in self._eyes.look(self.scene):
            seen = SceneSeen(frame.scene, EPISODE, len(self.pushes) + 1, settled, frame.time)
            if (decision := act(self._agent, seen)) is not None:
                return decision
        return None

    def _unsettled(self) -> str:
        """Return why there is no scene to decide on."""
        off = ~self._world.config.feasibility.table.contains(self.scene[:, POSITION])
        if off.any():
            body = int(np.argmax(off))
            x, y = self.scene[body, POSITION]
            return (
                f"push {len(self.pushes)} moved body {body} off the table, to ({x:.3f}, {y:.3f}) m"
            )
        return f"the scene did not settle after push {len(self.pushes)}"

    def _carry_out(self, decision: PushDecision) -> PushDecision | Stop | None:
        """Execute a push; return what the agent decides once it has the result."""
        before, push, push_id = self.scene, decision.push, decision.push_id
        try:
            after = self._eyes.push(push, decision.job.view.scene).after
        except SainError as error:
            self.refusals += 1
            diverged = isinstance(error, DivergedError)
            if diverged or error.code in LOOK_AGAIN:  # there is no other scene to come
                self.failure = f"{type(error).__name__}: {error}"
                return None
            return act(self._agent, PushEnded(push_id, error.code))
        self.pushes.append(_record(decision, before, after))
        self.fallbacks += decision.failure is not None
        self.scene = after
        executed = PushExecuted(push_id, EPISODE, before, push, after, self._eyes.time)
        return act(self._agent, executed)


def _failure(stop: Stop) -> str:
    """Return why a stop came short of the goal; empty: it did not."""
    job, goal = stop.job, stop.task.goal
    if stop.reason is not StopReason.EXHAUSTED or job is None or not isinstance(goal, PoseGoal):
        return stop.failure
    apart, turns = goal.errors(job.view.scene, job.known_bodies)
    left = [
        f"body {pose.body} {1e3 * away:.1f} mm and {abs(turn):.3f} rad from its pose"
        for pose, away, turn in zip(goal.poses, apart, turns, strict=True)
        if away > pose.tolerance or abs(turn) > pose.heading_tolerance
    ]
    return f"{stop.task.max_pushes} pushes left {', '.join(left)}"


def _record(decision: PushDecision, before: Scene, after: Scene) -> PushRecord:
    time = 0.0 if decision.plan is None else decision.plan.times.total
    return PushRecord(decision.push, before, decision.predicted, None, after, time)
