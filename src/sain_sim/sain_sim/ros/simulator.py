"""The truth world and the nominal shadow world: all that a simulator node calls."""

from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from time import perf_counter
from typing import Final

import numpy as np

from sain_arm.robot.robot import Robot
from sain_core import wire
from sain_core.camera.image_camera import ImageCamera, ImageCameraConfig, Shot
from sain_core.config import MOST_SEED, option
from sain_core.errors import ErrorCode, InvalidInputError, SainError, error_reply
from sain_core.guarding.plugins import did_you_mean
from sain_core.randomness import generator
from sain_core.ros import codec
from sain_core.scene import RADIUS, Table
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import own_bodies, register
from sain_core.shapes.outlines import BodyOutline
from sain_core.shapes.shape import FEET
from sain_core.types import PushArray, Scene
from sain_interfaces.msg import Prediction, PushResult
from sain_interfaces.srv import ResetScene
from sain_sim.camera.camera import Camera, WorldCameraConfig
from sain_sim.camera.renderer import Renderer, image_camera
from sain_sim.camera.window import Window
from sain_sim.ros.pacing import CameraTimer, Pacer
from sain_sim.world.engines import BULLET
from sain_sim.world.own import open_world
from sain_sim.world.parameters import WorldParameters, nominal_parameters, stated_by
from sain_sim.world.shadow import BulletPrior
from sain_sim.world.start import draw_episode
from sain_sim.world.truth import TRUTHS, TruthConfig
from sain_sim.world.workcell import Observer, Sample, WorldConfig, steps_of

SHADOW_MODEL = "bullet_nominal"
OWN: Final = "own"
RESET_TIME: Final = 1e-3  # [s] that a reset takes: no image of before has the stamp of its scene
Measured = tuple[Sample, PushResult]
"""The world after a push, and its duration, wall time and prediction."""


@dataclass(frozen=True)
class SimulatorConfig(TruthConfig):
    """What is simulated, and how it is displayed."""

    seed: int = option(0, "seed of the first episode", minimum=0, maximum=MOST_SEED)
    real_time_factor: float = option(
        0.0, "simulated time over wall time; 0: as fast as possible", minimum=0.0, maximum=100.0
    )
    state_rate: float = option(
        30.0, "scenes per simulated second during a push", unit="Hz", minimum=0.1, maximum=240.0
    )
    idle_rate: float = option(
        2.0,
        "settled scenes per second, for late subscribers",
        unit="Hz",
        minimum=0.1,
        maximum=100.0,
    )
    outlines: str = option(
        "",
        f"file of outlines whose bodies resets may name, with its heights; {OWN}: all of this"
        " user's; empty: none",
    )
    gui: bool = option(False, "show the world in a window (needs a display)")
    shadow: bool = option(True, "predict each push with the nominal world")
    frame_prefix: str = option(
        "", "prefix of frames on /tf; empty: the namespace, but for /sain, where there is none"
    )
    service_introspection: str = option(
        "disabled",
        "publish service calls: not at all, time and client, or with contents",
        choices=("disabled", "metadata", "contents"),
    )
    state_file: str = option("", "file to resume from after a crash; empty: none")
    cell: WorldConfig = WorldConfig()
    scenes: bool = option(
        True, "publish `scene` and `shapes`; false: a node that sees the bodies publishes them"
    )
    camera: WorldCameraConfig = WorldCameraConfig()
    images: ImageCameraConfig = ImageCameraConfig()


class Simulator:
    """The worlds and their time. All calls must come from the thread that made it: PyBullet."""

    def __init__(self, config: SimulatorConfig, pacer: Pacer) -> None:
        """Make the worlds; `reset` starts an episode."""
        self.pacer = pacer
        self.world = open_world(nominal_parameters(), config.cell, config.engine)
        self.config = config = replace(config, cell=self.world.config)  # with the robot's reach
        self._outlines = _read_outlines(config.outlines)
        self.window: Window | None = None
        self.shadow = BulletPrior("nominal", config.cell) if config.shadow else None
        self.camera = None if config.camera.is_exact else Camera(config.camera)
        self.camera_timer: CameraTimer | None = None
        self._images: ImageCamera | None = None
        self._shots = 0
        if self.camera is not None:
            self.camera_timer = CameraTimer(
                self.camera, pacer, config.real_time_factor, config.idle_rate
            )
        rate = config.state_rate if self.camera is None else config.camera.frame_rate
        self._every = steps_of(1.0 / rate)

    @property
    def parameters(self) -> WorldParameters:
        """The truth world's parameters."""
        return self.world.parameters

    @property
    def within(self) -> str:
        """What to add to the name of a world for its engine; nothing for Bullet."""
        return "" if self.config.engine == BULLET else f" in {self.config.engine}"

    def reset(self, wanted: ResetScene.Request) -> Sample:
        """Start an episode as `draw_episode` draws it."""
        name, world = "scene of the reset", wanted.world
        if world not in ("", *TRUTHS):
            raise InvalidInputError(
                f"world is {world!r}{did_you_mean(world, TRUTHS)}; allowed: {', '.join(TRUTHS)}"
            )
        disks, shapes, roles = wanted.disks, tuple(wanted.shapes), tuple(wanted.roles)
        scene = wire.check_bodies(wire.decode_disks(disks, name), name) if disks else None
        truth = replace(self.config, world=world or self.config.world)
        drawn = draw_episode(wanted.seed, truth, scene, shapes, wanted.friction, roles)
        parameters, start = self._stated(drawn[0]), drawn[1]
        self.world.reset(start, parameters)
        self.pacer.skip(RESET_TIME)
        self._images = None
        if self.config.gui:
            self._open_window()
        if self.camera is not None:
            self.camera.begin(wanted.seed, parameters)
        self._seed, self._shots = wanted.seed, 0
        if self.shadow is not None:
            self.shadow.truth = parameters  # for the shapes, which the nominal world shares
        return self.observe()

    def _stated(self, parameters: WorldParameters) -> WorldParameters:
        """Return the bodies with heights and centres of mass as a file states them."""
        stated = [self._outlines.get(one.on(FEET).name) for one in parameters.body_shapes]
        return parameters.with_stated(*stated_by(stated)) if any(stated) else parameters

    @property
    def radii(self) -> tuple[float, ...]:
        """The bodies' radii [m], as measured."""
        if self.camera is None:
            return self.parameters.radii
        scene = self.parameters.scene(np.zeros((self.parameters.count, 2)))
        return tuple(self.camera.measured(scene)[:, RADIUS].tolist())

    def push(self, push: PushArray, on_sample: Observer, seen: Scene | None = None) -> Measured:
        """Execute a push with samples at the state rate; see `World.push` for `seen` and errors."""
        predict = cache(partial(self._predict, self.world.observe(), push))

        def show(sample: Sample) -> None:
            predict()  # while the arm moves: afterwards a planner needs the processor
            self.pacer.follow(sample.time)
            self._show(sample)
            on_sample(sample)

        begun = perf_counter()
        outcome = self.world.push(push, on_step=show, every=self._every, seen=seen)
        if self.camera is not None:
            self.camera.count_push()
        sample, wall_time = self.observe(), perf_counter() - begun
        measured = PushResult(duration=outcome.duration, wall_time=wall_time, prediction=predict())
        return sample, measured

    def _predict(self, scene: Scene, push: PushArray) -> Prediction:
        """Return the shadow world's prediction of a push, or its error; empty: there is none."""
        if self.shadow is None:
            return Prediction()
        message = Prediction(model=SHADOW_MODEL, error_code=int(ErrorCode.OK))
        try:
            message.disks = codec.encode_disks(self.shadow.step(scene[None], push[None])[0])
        except SainError as error:
            message.error_code, message.error_message = error_reply(error)
        return message

    def shoot(self, sample: Sample) -> Shot:
        """Return images of a world, as its camera takes them."""
        if self._images is None:  # nobody has wanted any in this episode so far
            self._images = image_camera(self.config.images, *self._looks)
        self._shots += 1
        random = generator(self._seed, "images", self._shots)
        return self._images.take(sample.joint_positions, sample.scene, random)

    @property
    def _looks(self) -> tuple[Robot, Bodies, tuple[float, ...], Table]:
        """What a camera sees."""
        parameters, table = self.parameters, self.config.cell.feasibility.table
        return self.config.cell.arm, parameters.bodies, parameters.radii, table

    def _open_window(self) -> None:
        self._close_window()
        robot, bodies, radii, table = self._looks
        self.window = Window(Renderer(robot, bodies, radii, table=table))
        self._show(self.world.sample())

    def _show(self, sample: Sample) -> None:
        if self.window is not None:
            self.window.show(sample.joint_positions, sample.scene)

    def _close_window(self) -> None:
        if self.window is not None:
            self.window.close()
        self.window = None

    def close(self) -> None:
        """Close the worlds and the window."""
        self.world.close()
        self._close_window()
        if self.shadow is not None:
            self.shadow.close()

    def observe(self) -> Sample:
        """Return the worlds as they are now."""
        sample = self.world.sample()
        self.pacer.follow(sample.time)
        return sample


def _read_outlines(outlines: str) -> dict[str, BodyOutline]:
    """Return the bodies of a file by the names of their shapes, which resets may name from now on.

    Raises `DatasetError`: it cannot be read.
    """
    if not outlines:
        return {}
    bodies = own_bodies(None if outlines == OWN else Path(outlines)).values()
    for one in bodies:
        register(one.shape)
    return {one.shape.name: one for one in bodies}
