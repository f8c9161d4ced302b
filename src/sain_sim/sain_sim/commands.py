"""The executables of this package."""

from typing import Final

from sain_core.cli.command_line import Command
from sain_core.cli.node_command import NodeCommand

sim_node: Final = NodeCommand(
    "sain_sim sim_node",
    about="Simulates the table, the disks and the arm with PyBullet. Carries out one push at a time"
    " and publishes its result.",
    node="sain_sim.ros.sim_node:SimNode",
    settings="sain_sim.node.simulator:SimulatorConfig",
    publishes=(
        "scene",
        "push_result",
        "physics_prediction",
        "world_parameters",
        "joint_states",
        "markers",
        "/clock",
        "/diagnostics",
    ),
    subscribes=("push",),
    offers=("reset_scene",),
    example="world:=rough",
)
collect: Final = Command(
    "sain_sim collect",
    options="sain_sim.collecting.collect:CollectConfig",
    work="sain_sim.cli.collect:run",
    resumes="shard",
)
