"""A robot's controller, arm and table in simulation, moved on by a clock of somebody else."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from sain_arm.planning.arm_config import MotionConfig
from sain_arm.planning.push_events import Ending
from sain_arm.robot.robot import Vector
from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.config import MOST_SEED, option
from sain_core.errors import ConfigError
from sain_core.randomness import generator
from sain_core.shapes.body_file import BodyFile, Poses, read_bodies
from sain_core.shapes.library import register
from sain_core.shapes.shape import FEET
from sain_core.types import Scene
from sain_sim.bench.controller import Controller, ControllerConfig
from sain_sim.bench.faults import FAULTS_HELP, NONE, parse_faults
from sain_sim.bench.report import RATE, Report
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.truth import TruthConfig
from sain_sim.world.workcell import WorldConfig, steps_of
from sain_sim.world.world import World

MASS: Final = (0.4, 1.2)  # [kg], of bodies whose file states none
FRICTION: Final = (0.1, 0.3)  # with the table, where no world has its own


@dataclass(frozen=True)
class BenchConfig(TruthConfig):
    """Robot and bodies, the world that is true, and the controller with its faults."""

    cell: WorldConfig = WorldConfig(motion=MotionConfig())
    bodies: str = option("", "YAML file of the bodies")
    place: tuple[float, ...] = option((), "x, y [m], heading [rad] of each body; none: on a grid")
    pace: float = option(
        1.0, "how many times as fast as the wall clock it runs", minimum=0.05, maximum=20.0
    )
    faults: str = option(NONE, f"{FAULTS_HELP}; with commas between, or none")
    noise: str = option("0,0", "noise of the published poses: METRES,RADIANS")
    poses: bool = option(True, "publish the poses of the bodies; false: a camera sees them")
    seed: int = option(0, "of masses, friction and noise", minimum=0, maximum=MOST_SEED)
    controller: ControllerConfig = ControllerConfig()
    images: ImageCameraConfig = ImageCameraConfig()

    def __post_init__(self) -> None:
        """Check the fields, and the names of the faults."""
        super().__post_init__()
        parse_faults(self.faults)


class Bench:
    """Arm, controller and bodies.

    Attributes:
        robot: the arm.
        bodies: of the file.
        world: what is simulated.
        controller: follows goals.
        report: what was broken.
    """

    def __init__(self, config: BenchConfig) -> None:
        """Set the table, with the arm at home.

        Raises:
            ConfigError: robot, bodies or their places.
        """
        if not config.bodies:
            raise ConfigError("parameter 'bodies' is empty; give the YAML file of the bodies")
        self.bodies = read_bodies(Path(config.bodies).expanduser())
        parameters = parameters_of(self.bodies, config, config.seed)
        self.world = World(parameters, config.cell, config.engine)
        self.robot = self.world.robot
        if config.place:
            self.place(_poses(config.place, parameters.count))
        faults = parse_faults(config.faults)
        self.controller = Controller(self.robot, self.joints, config.controller, faults)
        self.report = Report(self.robot, parameters.bodies, parameters.radii)
        self._steps, self._look_every = 0, steps_of(1.0 / RATE)
        self._seen = self.joints, self.velocities

    @property
    def time(self) -> float:
        """The time [s]: the sum of the steps."""
        return self.world.time

    @property
    def joints(self) -> Vector:
        """The joints' positions (J,)."""
        return self.world.joint_states()[0]

    @property
    def velocities(self) -> Vector:
        """The joints' velocities (J,)."""
        return self.world.joint_states()[1]

    @property
    def tip(self) -> np.ndarray:
        """Where the tool's tip is (3,) [m]."""
        return self.world.sample().tool

    def observe(self) -> Scene:
        """Return the bodies (N, 8) as they are."""
        return self.world.observe()

    def states(self) -> tuple[Vector, Vector]:
        """Return positions (J,) and velocities (J,) as the robot publishes them."""
        if not self.controller.is_frozen(self.time):
            self._seen = self.world.joint_states()
        return self._seen

    def place(self, poses: Poses) -> None:
        """Put the bodies to poses (N, 3), at rest; the arm stays."""
        self.world.place(self.world.parameters.scene(poses[:, :2], poses[:, 2]))

    def step(self) -> Ending | None:
        """Simulate one control step; return how a goal ended in it, if one did."""
        self.world.step(*self.controller.target(self.time))
        self._steps += 1
        if self._steps % self._look_every == 0:
            self.report.look(*self.world.joint_states(), self.observe())
        return self.controller.ending(self.joints, self.time)

    def close(self) -> None:
        """End the simulation."""
        self.world.close()


def parameters_of(bodies: BodyFile, truth: TruthConfig, seed: int) -> WorldParameters:
    """Return the bodies of a file in a world; what neither file nor world states is drawn."""
    random, count = generator(seed, "bench"), len(bodies.names)
    for shape in bodies.bodies.on(FEET).shapes:
        register(shape)  # of a file, perhaps, that only the bodies' file names
    drawn = tuple(random.uniform(*MASS, count).tolist())
    return truth.roughen(
        WorldParameters(
            masses=bodies.masses if bodies.weighed else drawn,
            radii=bodies.radii,
            shapes=tuple(shape.name for shape in bodies.bodies.shapes),
            roles=tuple(map(str, bodies.bodies.roles)),
            heights=bodies.bodies.heights,
            friction=float(random.uniform(*FRICTION)),
        )
    )


def _poses(given: tuple[float, ...], count: int) -> Poses:
    if len(given) != 3 * count:
        raise ConfigError(f"place has {len(given)} numbers; {count} bodies need {3 * count}")
    return np.array(given).reshape(count, 3)
