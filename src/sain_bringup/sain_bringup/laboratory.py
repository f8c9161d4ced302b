"""``ros2 run sain_bringup laboratory``: the graph of a robot, with an arm in a test laboratory."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console

from sain_arm.robot.robot import SHIPPED, read_robot
from sain_bringup.graph import (
    DEPTH_IMAGES,
    OUTLINES,
    PAGE,
    ROBOT,
    SEEN_NOISE,
    TAGS,
    GraphOptions,
    absent,
)
from sain_bringup.running import run as run_graph
from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.cli.command_line import command_of_node, executable
from sain_core.config import option
from sain_core.errors import ConfigError, OutOfRangeError
from sain_core.push import PushLimits
from sain_core.shapes.body_file import BodyFile, read_bodies
from sain_core.shapes.shape import FEET
from sain_sim.world.engines import DEFAULT_ENGINE
from sain_vision.detection.tags import SMALLEST

SEEN_TIMEOUT: Final = "3.0"  # [s], age of scenes that come from images drawn here
SERVER: Final = "laboratory"
ENABLE: Final = "enable"
POSES: Final = "poses"


@dataclass(frozen=True)
class LaboratoryOptions(GraphOptions):
    """Start what an owner of a robot starts, with a simulated arm and table in place of it.

    A trajectory server moves the arm in MuJoCo, with physics that no model of SAIN has; `arm_node`
    pushes with it. Goals come as `goal` and RViz send them. The arm may move until Ctrl-C.
    """

    engine: str = absent(DEFAULT_ENGINE)
    bottom: str = absent(FEET)
    gui: bool = absent(False)
    robot: str = option("ur5", "YAML file of the robot, or the name of a shipped one")
    bodies: Path | None = option(
        None, "YAML file of the bodies; by default a T that the robot can push"
    )
    see: str = option(
        POSES,
        "how bodies are seen: their poses are published, or by tags or outlines in images",
        choices=(POSES, *SEEN_NOISE),
    )
    pace: float = option(
        1.0, "how many times as fast as the wall clock it runs", minimum=0.05, maximum=20.0
    )
    enable: bool = option(True, "let the arm move; else start `sain_arm enable` for that")
    page: bool = option(True, "serve the live page, with the camera's picture")
    port: int = option(8080, "of the page", minimum=1, maximum=65535)

    def check_robot(self) -> None:
        """Check the bodies; `run` reads the robot, whose files may be elsewhere."""
        read_bodies(self.bodies_file)

    @property
    def arm(self) -> str:
        """The arm that the camera may see."""
        return self.robot

    @property
    def bodies_file(self) -> Path:
        """The file of the bodies."""
        own = SHIPPED / "bodies" / f"{Path(self.robot).stem}.yaml"
        return self.bodies or (own if own.exists() else SHIPPED / "bodies" / "t.yaml")

    @cached_property
    def place(self) -> tuple[float, ...]:
        """x, y, heading of a body that the arm could not push in the middle; of others nothing.

        Raises:
            ConfigError: one that may be pushed is too large for the robot's reach.
        """
        # What plans an arm's way is not installed with `pip install .`, which lists this command.
        from sain_arm.planning.reach import fitting_place

        robot, bodies = read_robot(self.robot), read_bodies(self.bodies_file)
        reach = PushLimits().clearance + robot.tool_radius
        pushable = max(bodies.bodies.pushable, key=lambda body: bodies.radii[body])
        radius = bodies.radii[pushable]
        size = radius * bodies.bodies.shapes[pushable].circumradius
        try:
            place = fitting_place(robot, size + reach)
        except OutOfRangeError as error:
            raise ConfigError(
                f"{bodies.called(pushable)} is too large, with a radius of {radius:g} m: {error};"
                " give --bodies with a smaller one"
            ) from error
        return () if place is None or len(bodies.names) > 1 else (*place.tolist(), 0.0)

    def planner(self) -> dict[str, str]:
        """Return the radius of the arm's tool."""
        radius = read_robot(self.robot).tool_radius
        differs = radius != PushLimits().tool_radius
        return {"feasibility.limits.tool_radius": str(radius)} if differs else {}

    def own_commands(self, ros: Sequence[str]) -> dict[str, list[str]]:
        """Return the commands of the laboratory, of the arm's driver and of what enables it."""
        bodies = str(self.bodies_file.absolute())
        given: dict[str, object] = {"robot": self.robot, "bodies": bodies, "pace": self.pace}
        given |= {"place": list(self.place)} if self.place else {}
        given |= {"poses": "false"} if self.images else {}
        given |= DEPTH_IMAGES if self.images == OUTLINES else {}
        server = command_of_node("sain_sim", "trajectory_server", ros, **given)
        # A camera that is computed on the same cores is late; a real one keeps to the default.
        late = {"scene_timeout": SEEN_TIMEOUT} if self.images else {}
        arm = command_of_node("sain_arm", "arm_node", ros, robot=self.robot, **late)
        commands = {SERVER: server, ROBOT: arm}
        if self.page:
            commands[PAGE] = command_of_node("sain_live", "page_node", ros, port=self.port)
        if self.enable:
            enable = [str(executable("sain_arm", "enable")), "--robot", self.robot]
            commands[ENABLE] = [*enable, "--ros-args", *ros]
        return commands


def run(options: LaboratoryOptions, console: Console) -> int:
    """Run it until it is interrupted, or a process ends; return the exit code.

    Raises:
        SainError: the robot's files or a package are not there, or a log cannot be written.
        ConfigError: a body that the robot cannot push, or whose tags its camera cannot read.
    """
    place = options.place
    if options.see == TAGS and options.params_file is None:
        check_tags(read_bodies(options.bodies_file), place)
    return run_graph(options, console)


def check_tags(bodies: BodyFile, place: tuple[float, ...]) -> None:
    """Raise `ConfigError` where the camera shows a tag too small; bodies are at places."""
    camera = ImageCameraConfig()
    x, y = place[:2] or camera.focus[:2]
    for body, tags in enumerate(bodies.tags):
        for tag in tags:
            places = tag.corners() + np.array([x, y])
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
