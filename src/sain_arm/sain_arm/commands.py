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
trajectory_server: Final = NodeCommand(
    "sain_arm trajectory_server",
    about="A laboratory in place of a robot: moves the arm of a YAML file in MuJoCo, with bodies on"
    " a table, and serves FollowJointTrajectory. It delays, tolerates and aborts as asked.",
    node="ros.trajectory_server:TrajectoryServer",
    settings="laboratory.laboratory_config:LaboratoryConfig",
    publishes=("/joint_states", "/robot_description", "poses", "laboratory", "/diagnostics"),
    example="robot:=ur5",
)
