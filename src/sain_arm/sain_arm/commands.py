"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command
from sain_core.cli.node_command import NodeCommand

arm_node: Final = NodeCommand(
    "sain_arm arm_node",
    about="Carries out pushes with a robot arm: plans and checks the whole way, sends it to the"
    " arm's controller as FollowJointTrajectory, and answers each push with its result. The arm"
    " moves only while somebody publishes `true` on enable.",
    node="ros.arm_node:ArmNode",
    settings="planning.arm_config:ArmConfig",
    publishes=("push_result", "reach_table", "ghost", "/diagnostics"),
    subscribes=("push", "scene", "shapes", "enable", "/joint_states"),
    example="robot:=ur5",
)
enable: Final = Command("sain_arm enable", "ros.enable", ros=True)
