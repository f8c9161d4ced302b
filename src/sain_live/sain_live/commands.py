"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command
from sain_core.cli.node_command import NodeCommand

live: Final = Command("sain_live live", "live", ros=True)
page_node: Final = NodeCommand(
    "sain_live page_node",
    about="Serves the live page: the arm, the bodies, plans, goals that can be dragged, controls"
    " and charts. Works with every graph, also with a robot or a recording.",
    node="ros.page_node:PageNode",
    settings="settings:PageConfig",
    publishes=(),
    subscribes=(
        "scene",
        "shapes",
        "goal",
        "plan",
        "push_result",
        "learning",
        "joint_states",
        "robot_description",
        "/joint_states",
        "/robot_description",
        "ghost",
        "camera/overlay",
        "/tf_static",
        "/diagnostics",
        "/parameter_events",
    ),
    calls=(
        "reset_scene",
        "load_model",
        "describe_model",
        "parameters of mppi_node and learner_node",
    ),
    actions=("reach (sends goals)",),
    example="port:=8081",
)
