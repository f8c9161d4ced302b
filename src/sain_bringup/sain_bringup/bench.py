"""The bench: what an owner of a robot starts, with a simulated arm and table in place of it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np

from sain_arm.robot.robot import SHIPPED, read_robot
from sain_bringup.reach import fitting_place
from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.cli.command_line import command_of_node, executable
from sain_core.errors import ConfigError, OutOfRangeError
from sain_core.push import PushLimits
from sain_core.shapes.body_file import BodyFile, read_bodies
from sain_sim.world.engines import ENGINES
from sain_sim.world.truth import hidden_world
from sain_vision.detection.tags import SMALLEST

SERVER: Final = "bench"
ENABLE: Final = "enable"
ROBOT: Final = "robot"
APART: Final = 0.2  # [m], middles of bodies in a row
SEEN_TIMEOUT: Final = "3.0"  # [s], age of scenes that come from images drawn here
TAG_IMAGES: Final = {"images.rate": "20.0"}
DEPTH_IMAGES: Final = {"images.width": "640", "images.height": "480", "images.detail": "1.0"}


@dataclass(frozen=True)
class Bench:
    """A trajectory server in place of a robot, the robot's driver, and what enables the arm.

    Attributes:
        robot: YAML file, or name of a shipped one.
        faults: of controller, joint states and camera; see `sain_sim.bench.faults`.
        engine: of the physics.
        own_bodies: file of the bodies; None: a T that the robot can push.
        pace: how many times as fast as the wall clock it runs.
        enabled: whether the arm may move until Ctrl-C.
        camera: parameters of its images; None: the poses of the bodies are published.
    """

    robot: str
    faults: str
    engine: str
    own_bodies: Path | None
    pace: float
    enabled: bool
    camera: dict[str, str] | None

    @property
    def bodies_file(self) -> Path:
        """The file of the bodies."""
        own = SHIPPED / "bodies" / f"{Path(self.robot).stem}.yaml"
        return self.own_bodies or (own if own.exists() else SHIPPED / "bodies" / "t.yaml")

    @cached_property
    def place(self) -> tuple[float, ...]:
        """x, y, heading of each body: in a row, where the arm can push the largest.

        Raises:
            ConfigError: one that may be pushed is too large for the robot's reach.
        """
        robot, bodies = read_robot(self.robot), read_bodies(self.bodies_file)
        reach = PushLimits().clearance + robot.tool_radius
        pushable = max(bodies.bodies.pushable, key=lambda body: bodies.radii[body])
        radius = bodies.radii[pushable]
        size = radius * bodies.bodies.shapes[pushable].circumradius
        try:
            place = fitting_place(self.robot, size + reach)
        except OutOfRangeError as error:
            raise ConfigError(
                f"{bodies.called(pushable)} is too large, with a radius of {radius:g} m: {error};"
                " give --bodies with a smaller one"
            ) from error
        x, y = place.tolist()
        row = APART * (np.arange(len(bodies.names)) - 0.5 * (len(bodies.names) - 1))
        return tuple(number for offset in row.tolist() for number in (x, y + offset, 0.0))

    def check(self) -> None:
        """Check what needs time: that the robot can push the bodies, and its camera read the tags.

        Raises:
            ConfigError: it cannot.
        """
        place, bodies = self.place, read_bodies(self.bodies_file)
        if self.camera == TAG_IMAGES:
            check_tags(bodies, place)

    def commands(self, ros: Sequence[str]) -> dict[str, list[str]]:
        """Return the commands of the server, of the arm's driver and of what enables it."""
        given: dict[str, object] = {
            "cell.robot": self.robot,
            "engine": self.engine,
            "world": hidden_world(self.engine),
            "bodies": str(self.bodies_file.absolute()),
            "faults": self.faults,
            "pace": self.pace,
            "place": list(self.place),
        }
        given |= {} if self.camera is None else {"poses": "false", **self.camera}
        server = command_of_node("sain_sim", "trajectory_server", ros, **given)
        # A camera that is computed on the same cores is late; a real one keeps to the default.
        late = {} if self.camera is None else {"scene_timeout": SEEN_TIMEOUT}
        arm = command_of_node("sain_arm", "arm_node", ros, robot=self.robot, **late)
        commands = {SERVER: server, ROBOT: arm}
        if self.enabled:
            enable = [str(executable("sain_arm", "enable")), "--robot", self.robot]
            commands[ENABLE] = [*enable, "--ros-args", *ros]
        return commands


def check_bench_engine(engine: str) -> None:
    """Raise `ConfigError` unless an engine has a cell in which a robot can follow trajectories."""
    if engine not in ENGINES:
        raise ConfigError(
            f"--engine is {engine!r}, a world of a package, in which no arm moves; with --faults"
            f" allowed: {', '.join(ENGINES)}"
        )


def check_tags(bodies: BodyFile, place: tuple[float, ...]) -> None:
    """Raise `ConfigError` where the camera shows a tag too small; bodies are at places."""
    camera = ImageCameraConfig()
    for body, tags in enumerate(bodies.tags):
        for tag in tags:
            places = tag.corners() + place[3 * body : 3 * body + 2]
            corners = np.insert(places, 2, bodies.heights[body], axis=1)
            seen = (corners - camera.eye) @ camera.rotation @ camera.matrix.T
            pixels = seen[:, :2] / seen[:, 2:]
            side = float(np.linalg.norm(pixels - np.roll(pixels, 1, axis=0), axis=1).mean())
            if side < SMALLEST:
                raise ConfigError(
                    f"tag {tag.number} of {bodies.called(body)} is too small for the camera: with"
                    f" its side of {1e3 * tag.size:g} mm it is {side:.1f} px wide, and"
                    f" {SMALLEST} px are needed; give --bodies with larger tags, a --params-file"
                    " with a larger images.width and images.height, or --see poses"
                )
