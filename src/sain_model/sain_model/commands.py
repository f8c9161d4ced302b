"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command
from sain_core.cli.node_command import NodeCommand

model_node: Final = NodeCommand(
    "sain_model model_node",
    about="Serves one model of the dynamics. Predicts single pushes and sequences of pushes, and"
    " replaces the model while it runs.",
    node="ros.model_node:ModelNode",
    settings="serving.service:ServingConfig",
    publishes=("/diagnostics",),
    subscribes=("shapes",),
    offers=("predict_residual", "rollout", "describe_model", "load_model"),
    example="model:=planar",
)
train: Final = Command("sain_model train", "cli.train", resumes="epoch")
evaluate: Final = Command("sain_model evaluate", "cli.evaluate", alias="evaluate_model")
identify: Final = Command("sain_model identify", "cli.identify")
real_import: Final = Command("sain_model real_import", "cli.real_import")
