"""``ros2 run sain_bringup laboratory``: the graph of a robot, with an arm in a test laboratory."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Final

from rich.console import Console

from sain_arm.robot.robot import SHIPPED, read_robot
from sain_bringup.graph import (
    DEPTH_IMAGES,
    ELSEWHERE,
    OUTLINES,
    PAGE,
    ROBOT,
    SEEN_NOISE,
    GraphConfig,
    GraphOptions,
)
from sain_bringup.graph import run as run_graph
from sain_core.cli.command_line import command_of_node, executable
from sain_core.config import option
from sain_core.push import PushLimits
from sain_core.shapes.body_file import read_bodies

SERVER: Final = "laboratory"
ENABLE: Final = "enable"
POSES: Final = "poses"


@dataclass(frozen=True)
class LaboratoryOptions(GraphConfig):
    """Start what an owner of a robot starts, with a simulated arm and table in place of it.

    A trajectory server moves the arm in MuJoCo, with physics that no model of SAIN has; `arm_node`
    pushes with it. Goals come as `goal` and RViz send them. The arm may move until Ctrl-C.
    """

    robot: str = option("ur5", "YAML file of the robot, or the name of a shipped one")
    bodies: Path = option(SHIPPED / "bodies" / "t.yaml", "YAML file of the bodies")
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
    record: bool = option(True, "record all topics")
    bag: Path | None = option(
        None, "folder to make for the recording; by default bags/<date>-<time>"
    )

    def __post_init__(self) -> None:
        """Check the fields, and the bodies; `run` reads the robot, whose files may be elsewhere."""
        super().__post_init__()
        read_bodies(self.bodies)


@dataclass(frozen=True)
class _Graph(GraphOptions):
    """The graph of a robot that is started here, too."""

    laboratory: LaboratoryOptions = LaboratoryOptions()

    @property
    def planner(self) -> dict[str, str]:
        """Parameters of the planner: the tool of the robot."""
        radius = read_robot(self.laboratory.robot).tool_radius
        differs = radius != PushLimits().tool_radius
        return {"feasibility.limits.tool_radius": str(radius)} if differs else {}

    @property
    def arm(self) -> str:
        """The robot."""
        return self.laboratory.robot

    def more_commands(self, ros: Sequence[str]) -> dict[str, list[str]]:
        """Return the commands of the laboratory, of the arm's driver and of who enables it."""
        own = self.laboratory
        bodies = str(own.bodies.absolute())
        given = {"robot": own.robot, "bodies": bodies, "pace": own.pace}
        given |= {"poses": "false"} if self.see else {}
        given |= DEPTH_IMAGES if self.see == OUTLINES else {}
        server = command_of_node("sain_arm", "trajectory_server", ros, **given)
        arm = command_of_node("sain_arm", "arm_node", ros, robot=own.robot)
        commands = {SERVER: server, ROBOT: arm}
        if own.page:
            commands[PAGE] = command_of_node("sain_live", "page_node", ros, port=own.port)
        if own.enable:
            enable = [str(executable("sain_arm", "enable")), "--robot", own.robot]
            commands[ENABLE] = [*enable, "--ros-args", *ros]
        return commands


def run(options: LaboratoryOptions, console: Console) -> int:
    """Run it until it is interrupted, or a process ends; return the exit code.

    Raises:
        SainError: the robot's files or a package are not there, or a log cannot be written.
    """
    read_robot(options.robot)
    return run_graph(graph_options(options), console)


def graph_options(options: LaboratoryOptions) -> GraphOptions:
    """Return the graph of a robot, with the processes of its laboratory."""
    names = [item.name for item in fields(GraphConfig) if item.name != "see"]
    common = {name: getattr(options, name) for name in names}
    return _Graph(
        **common,
        see="" if options.see == POSES else options.see,
        robot=ELSEWHERE,
        bodies=options.bodies,
        record=options.record,
        bag=options.bag,
        laboratory=options,
    )
