"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command
from sain_core.cli.node_command import NodeCommand

lab: Final = Command("sain_lab lab", "cli.lab", resumes="push")
learner_node: Final = NodeCommand(
    "sain_lab learner_node",
    about="Learns from the results of pushes in a laboratory, and has the model's node load what"
    " predicts better. Runs at a low priority; nothing waits for it.",
    node="ros.learner_node:LearnerNode",
    settings="settings:LearnerConfig",
    publishes=("learning", "/diagnostics"),
    subscribes=("push_result", "shapes"),
    calls=("load_model",),
    example="laboratory:=my_table",
)
