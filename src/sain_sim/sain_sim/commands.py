"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command
from sain_core.cli.node_command import NodeCommand

sim_node: Final = NodeCommand(
    "sain_sim sim_node",
    about="Simulates the table, the disks and the arm with PyBullet or MuJoCo. Carries out one push"
    " at a time and publishes its result.",
    node="ros.sim_node:SimNode",
    settings="ros.simulator:SimulatorConfig",
    publishes=(
        "scene",
        "push_result",
        "camera/color/image_raw",
        "camera/color/camera_info",
        "camera/aligned_depth_to_color/image_raw",
        "shapes",
        "world_parameters",
        "joint_states",
        "robot_description",
        "markers",
        "/tf",
        "/tf_static",
        "/clock",
        "/diagnostics",
    ),
    subscribes=("push",),
    offers=("reset_scene",),
    example="world:=rough",
)
collect: Final = Command("sain_sim collect", "collecting.collect", resumes="shard")
trajectory_server: Final = NodeCommand(
    "sain_sim trajectory_server",
    about="A bench in place of a robot: moves the arm of a YAML file in PyBullet or MuJoCo, with"
    " bodies on a table, and serves FollowJointTrajectory. It delays, rejects, aborts and lies as"
    " `faults` says.",
    node="ros.trajectory_server:TrajectoryServer",
    settings="bench.bench:BenchConfig",
    publishes=("/joint_states", "/robot_description", "poses", "bench", "/diagnostics"),
    example="cell.robot:=ur5",
)
