"""The executables of this package."""

from typing import Final

from sain_core.cli.command_line import Command
from sain_core.cli.node_command import NodeCommand

model_node: Final = NodeCommand(
    "sain_model model_node",
    about="Serves one model of the dynamics. Predicts single pushes and sequences of pushes, and"
    " replaces the model while it runs.",
    node="sain_model.ros.model_node:ModelNode",
    settings="sain_model.serving.settings:ServingConfig",
    publishes=("/diagnostics",),
    offers=("predict_residual", "rollout", "describe_model", "load_model"),
    example="model:=planar",
)
train: Final = Command(
    "sain_model train",
    options="sain_model.training.options:train_options",
    work="sain_model.cli.train:run",
    resumes="epoch",
)
train_correction: Final = Command(
    "sain_model train_correction",
    options="sain_model.training.options:TrainCorrectionOptions",
    work="sain_model.cli.train_correction:run",
    resumes="epoch",
)
evaluate: Final = Command(
    "sain_model evaluate",
    options="sain_model.cli.options:EvaluateModelOptions",
    work="sain_model.cli.evaluate:run",
)
learning_curve: Final = Command(
    "sain_model learning_curve",
    options="sain_model.cli.options:LearningCurveOptions",
    work="sain_model.cli.learning_curve:run",
    resumes="epoch",
)
