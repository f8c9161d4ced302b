"""An episode without ROS: the agent decides, a camera looks, the simulated arm pushes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from sain_core.goal import Goal
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene
from sain_core.world import AnyWorld
from sain_eval.episode import EpisodeRecord, Tolerance
from sain_eval.scenes.scenario_scene import ScenarioScene
from sain_mppi.agent.agent import Agent
from sain_mppi.agent.events import Task
from sain_mppi.agent.play import Sight, play
from sain_sim.camera.camera import Camera, WorldCameraConfig
from sain_sim.world.own import open_world
from sain_sim.world.workcell import Sample, WorldConfig
from sain_sim.world.world import CheckedWorld

MOST_FRAMES: Final = 2000  # of one scene; an agent that needs more never decides


class CameraSight(Sight):
    """A camera above a world. Time goes on while it looks at bodies at rest."""

    world: CheckedWorld

    def __init__(self, world: CheckedWorld, config: WorldCameraConfig, seed: int) -> None:
        """Begin an episode with this seed."""
        super().__init__(world)
        self._camera = None if config.is_exact else Camera(config)
        self._looked = 0.0  # [s], while the world stood still
        if self._camera is not None:
            self._camera.begin(seed, world.parameters)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.world.time + self._looked

    def look(self) -> Iterator[tuple[Scene, float]]:
        """Yield frames of a scene (N, 8) at rest as they arrive; exact observations are one."""
        camera, scene = self._camera, self.world.observe()
        if camera is None:
            yield scene, self.time
            return
        for _ in range(MOST_FRAMES):
            self._looked += camera.period
            camera.observe(scene, self.time)
            for frame in camera.arrived(self.time):
                yield frame.scene, frame.time

    def push(self, push: PushArray, seen: Scene) -> Scene:
        """Execute a push that was planned from a scene (N, 8), as seen; see `World.push`."""
        camera = self._camera
        if camera is None:
            return self.world.push(push).after
        watched = camera.config.delay > 0.0  # else frames of moving bodies are never of use
        every = self.world.config.steps_of(camera.period)
        outcome = self.world.push(push, self._watch if watched else None, every, seen)
        camera.count_push()
        return outcome.after

    def _watch(self, sample: Sample) -> None:
        if self._camera is not None:
            self._camera.observe(sample.scene, sample.time + self._looked, moving=True)


@dataclass(frozen=True)
class EpisodeOutcome:
    """What became of an episode.

    Attributes:
        records: one for each goal that was given, in order.
        final: (N, 8), the last scene.
        refusals: pushes that were not executed.
        fallbacks: pushes that physics planned because the model failed.
        failure: why it ended short of the tightest tolerance; empty: it did not.
    """

    records: tuple[EpisodeRecord, ...]
    final: Scene
    refusals: int = 0
    fallbacks: int = 0
    failure: str = ""

    @property
    def record(self) -> EpisodeRecord:
        """The record of the last goal."""
        return self.records[-1]


def play_goals(
    agent: Agent,
    world: AnyWorld[Any] | Sight,
    goals: Sequence[Goal],
    bodies: Bodies,
    max_pushes: int,
    over: Callable[[], bool] = lambda: False,
) -> EpisodeOutcome:
    """Play an agent in a world that was reset, and keep a record for each goal.

    Args:
        agent: a new one.
        world: the world, or how the agent sees it.
        goals: given one after another, each once the one before is reached.
        bodies: as they are recorded.
        max_pushes: for each goal; 0: any number.
        over: tells when the world has ended the episode by itself.
    """
    tasks = [Task(number, 0, goal, max_pushes) for number, goal in enumerate(goals, start=1)]
    played = play(agent, world, tasks, bodies, over)
    records = tuple(
        EpisodeRecord(one.task.goal, one.pushes, one.start, bodies) for one in played.pursuits
    )
    return EpisodeOutcome(records, played.final, played.refusals, played.fallbacks, played.failure)


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
    goals = [Tolerance.of(tolerance).apply(goal) for goal in case.goals]
    with open_world(parameters, config, engine=case.truth.engine) as world:
        world.reset(case.disks)
        sight = CameraSight(world, camera, case.seed)
        return play_goals(agent, sight, goals, parameters.bodies, case.max_pushes)
