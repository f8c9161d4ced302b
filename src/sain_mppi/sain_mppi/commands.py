"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.node_command import NodeCommand

mppi_node: Final = NodeCommand(
    "sain_mppi mppi_node",
    about="Plans one push for each settled scene until the goal is reached. Calls the"
    " model as a service, and plans with the prior when no model answers.",
    node="ros.mppi_node:MppiNode",
    settings="agent.agent:MppiConfig",
    publishes=("push", "plan", "plan_markers", "/diagnostics"),
    subscribes=(
        "scene",
        "shapes",
        "push_result",
        "goal",
        "goal_pose",
        "reach_table",
        "/diagnostics",
    ),
    actions=("reach",),
    calls=("rollout",),
    example="planner.samples:=512",
)
