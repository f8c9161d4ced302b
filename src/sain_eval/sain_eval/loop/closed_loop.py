"""An episode without ROS: the agent decides, the simulated arm pushes."""

from dataclasses import dataclass

from sain_core.scene import POSITION
from sain_core.types import Scene
from sain_eval.loop.eyes import Eyes
from sain_eval.plots.episode_record import EpisodeRecord
from sain_eval.scenes.scenario_scene import ScenarioScene
from sain_eval.tolerance import Tolerance
from sain_mppi.agent.agent import Agent
from sain_mppi.agent.decision import Task
from sain_mppi.agent.play import play
from sain_sim.camera.camera import WorldCameraConfig
from sain_sim.world.own import open_world
from sain_sim.world.workcell import WorldConfig


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
    within = Tolerance.of(tolerance)
    tasks = [
        Task(number, 0, within.apply(goal), case.max_pushes)
        for number, goal in enumerate(case.goals, start=1)
    ]
    with open_world(parameters, config, engine=case.truth.engine) as world:
        world.reset(case.disks)
        played = play(agent, Eyes(world, camera, case.seed), tasks, parameters.bodies)
    *earlier, last = (
        EpisodeRecord(
            one.task.goal,
            one.pushes,
            one.start,
            case.shapes,
            roles=tuple(case.roles),
        )
        for one in played.pursuits
    )
    on_table = config.feasibility.table.contains(played.final[:, POSITION])
    return EpisodeOutcome(
        last,
        played.final,
        played.refusals,
        played.failure,
        bool(~on_table.all()),
        played.fallbacks,
        tuple(earlier),
    )
