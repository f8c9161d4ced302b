"""An episode without ROS: the agent decides, the simulated arm pushes."""

from dataclasses import dataclass

from sain_core.errors import ErrorCode, SainError
from sain_core.push_record import PushRecord
from sain_core.scene import POSITION, is_settled
from sain_core.types import Scene
from sain_eval.plots.episode_record import EpisodeRecord
from sain_eval.scenes.scenarios import ScenarioScene
from sain_mppi.loop.agent import Agent
from sain_mppi.loop.decision import PushDecision, Task
from sain_mppi.loop.goal_tracker import LOOK_AGAIN
from sain_sim.world.workcell import WorldConfig
from sain_sim.world.world import World

EPISODE = 1  # its id; the agent is new in each


@dataclass(frozen=True)
class EpisodeOutcome:
    """What became of an episode."""

    record: EpisodeRecord
    final: Scene  # (N, 8)
    refusals: int
    failure: str  # why it ended short of the tightest tolerance; empty when it did not
    fallen: bool  # a disk left the table
    fallbacks: int = 0  # pushes that physics planned because the model failed


def run_episode(
    case: ScenarioScene,
    agent: Agent,
    tolerance: float,
    world_config: WorldConfig | None = None,
) -> EpisodeOutcome:
    """Play one scene with an agent until the target is within tolerance [m], or it stops."""
    config = world_config or WorldConfig()
    with World(case.parameters(), config) as world:
        scene = start = world.reset(case.disks)
        stop = agent.aim(Task(1, EPISODE, case.goal, tolerance, case.max_pushes))
        pushes: list[PushRecord] = []
        refusals = fallbacks = 0
        failure = "" if stop is None else stop.failure
        while not failure:
            agent.see(scene, EPISODE, len(pushes) + 1, bool(is_settled(scene)))
            decision = agent.act()
            if not isinstance(decision, PushDecision):
                failure = decision.failure if decision else "the scene did not settle"
                break
            try:
                after = world.push(decision.push).after
            except SainError as error:
                refusals += 1
                agent.answered(decision.push_id, error.code)
                if error.code in LOOK_AGAIN:  # there is no other scene to come
                    failure = f"{type(error).__name__}: {error}"
                continue
            agent.learn(EPISODE, scene, decision.push, after)
            agent.answered(decision.push_id, ErrorCode.OK)
            pushes.append(_record(decision, scene, after))
            fallbacks += decision.failure is not None
            scene = after
    record = EpisodeRecord(case.goal, tolerance, tuple(pushes), start, case.shapes)
    fallen = bool(~config.feasibility.table.contains(scene[:, POSITION]).all())
    return EpisodeOutcome(record, scene, refusals, failure, fallen, fallbacks)


def _record(decision: PushDecision, before: Scene, after: Scene) -> PushRecord:
    time = 0.0 if decision.plan is None else decision.plan.times.total
    return PushRecord(decision.push, before, decision.predicted, None, after, time)
