"""``ros2 run sain_model train_correction``: learn to correct the planar prior's parameters."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import torch
from rich.console import Console
from rich.progress import Progress

from sain_core.provenance import ros2_command
from sain_model.data.dataset import Split, check_held_out
from sain_model.data.friction_noise import make_filter
from sain_model.data.mixed import MixedSplit, load_datasets, split_datasets
from sain_model.dynamics.checkpoint import (
    CORRECTION_ARCHITECTURE,
    SUFFIX,
    ModelCard,
    save_checkpoint,
)
from sain_model.dynamics.parameter_correction import ParameterCorrection
from sain_model.dynamics.priors import load_planar
from sain_model.evaluation.error_table import error_tables
from sain_model.evaluation.metrics import measure
from sain_model.evaluation.shape_errors import predict_told, shape_errors
from sain_model.training.correction_training import make_trainers, train_members
from sain_model.training.options import TrainCorrectionOptions
from sain_model.training.settings import EPISODE
from sain_model.training.training_card import data_part, environment, save_settings
from sain_model.training.training_loop import LossHistory


def run(command: TrainCorrectionOptions, console: Console) -> None:
    """Train, evaluate on the held-out episodes, write everything.

    Raises:
        DatasetError, CheckpointError, OutputError: see `sain_core.errors`.
    """
    torch.set_num_threads(1)
    config = command.training
    data = load_datasets([command.dataset])
    split = split_datasets(data, config.seed, config.validation, config.test, config.transitions)
    check_held_out(split.test)
    prior = load_planar(command.prior, {"friction": config.prior_friction})
    friction = make_filter(prior, split.train) if config.history == EPISODE else None
    trainers = make_trainers(split, prior, config, command.out, friction)
    save_settings("train_correction", command, data)
    with Progress(console=console) as bar:
        task = bar.add_task("train", total=config.network.members * config.epochs)

        def advance(member: int, number: int, history: LossHistory) -> None:
            bar.update(task, completed=member * config.epochs + number)

        networks, histories = train_members(trainers, advance)
    infers = friction.config if friction else None
    sain = ParameterCorrection(networks, prior, friction=infers)
    errors = _errors(sain, command.prior, split)
    card = replace(
        _card(command, sain, histories),
        errors=errors,
        data=data_part([command.dataset], data, split),
    )
    path = command.out / f"{command.name}{SUFFIX}"
    save_checkpoint(path, networks, card)
    _show(errors, console)
    console.print(str(path))


def _card(
    command: TrainCorrectionOptions, sain: ParameterCorrection, histories: Sequence[LossHistory]
) -> ModelCard:
    """Return what the card says of model and training."""
    config = command.training
    return ModelCard(
        prior=command.prior,
        prior_config=asdict(sain.prior.config),
        network=asdict(config.network),
        friction=asdict(sain.friction) if sain.friction else None,
        training={
            **asdict(config),
            "best_epochs": [history.best + 1 for history in histories],
            "validation_losses": [history.best_loss for history in histories],
        },
        versions=environment(),
        command=ros2_command("sain_model", "train_correction"),
        architecture=CORRECTION_ARCHITECTURE,
    )


def _show(errors: dict[str, Any], console: Console) -> None:
    """Print errors on held-out episodes."""
    if "bodies" in errors:
        for table in error_tables(errors):
            console.print(table, soft_wrap=True)
        return
    for name, values in errors.items():
        console.print(f"{name}: target {values['target_mean']:.2f} mm on held-out episodes")


def _errors(
    sain: ParameterCorrection, prior_name: str, split: Split | MixedSplit
) -> dict[str, Any]:
    """Return the errors on held-out episodes of the model and of its prior."""
    test = split.test
    if any(not part.bodies.are_paper_disks for part in test.parts):
        return shape_errors(test, sain)
    (part,) = test.parts
    return {
        name: measure(predict_told(model, part), part, 0)
        for name, model in ((prior_name, sain.filter or sain.prior), ("sain", sain))
    }
