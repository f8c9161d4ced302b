"""``ros2 run sain_model train_correction``: learn to correct the planar prior's parameters."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.progress import Progress

from sain_core.provenance import ros2_command
from sain_core.storage import write_whole
from sain_model.cli.options import TrainCorrectionOptions
from sain_model.data.dataset import (
    Split,
    check_held_out,
    limit_training,
    load_transitions,
    split_by_episode,
)
from sain_model.dynamics.checkpoint import (
    CORRECTION_ARCHITECTURE,
    SUFFIX,
    ModelCard,
    save_checkpoint,
)
from sain_model.dynamics.parameter_correction import ParameterCorrection
from sain_model.dynamics.priors import load_planar
from sain_model.evaluation.metrics import measure
from sain_model.training.correction_training import make_trainers, train_members
from sain_model.training.training_card import environment
from sain_model.training.training_state import LossHistory


def run(command: TrainCorrectionOptions, console: Console) -> None:
    """Train; see `train_correction`."""
    torch.set_num_threads(1)
    train_correction(command, console)


def train_correction(command: TrainCorrectionOptions, console: Console) -> Path:
    """Train, evaluate on the held-out episodes, write everything; return the checkpoint's path.

    Raises:
        DatasetError, CheckpointError, OutputError: see `sain_core.errors`.
    """
    data = load_transitions(command.dataset)
    split = split_by_episode(data, command.training.seed, command.validation, command.test)
    check_held_out(split)
    if command.transitions:
        split = limit_training(split, command.transitions)
    prior = load_planar(command.prior, {"friction": command.prior_friction})
    trainers = make_trainers(split, prior, command.training, command.out)
    settings = json.dumps(asdict(command), indent=2, default=str) + "\n"
    write_whole(command.out / "config.json", settings.encode())
    epochs = command.training.epochs
    with Progress(console=console) as bar:
        task = bar.add_task("train", total=command.training.network.members * epochs)

        def advance(member: int, number: int, history: LossHistory) -> None:
            bar.update(task, completed=member * epochs + number)

        networks, histories = train_members(trainers, advance)
    sain = ParameterCorrection(networks, prior)
    errors = {
        name: asdict(measure(dynamics.step(split.test.state, split.test.action), split.test, 0))
        for name, dynamics in ((command.prior, prior), ("sain", sain))
    }
    path = command.out / f"{command.name}{SUFFIX}"
    save_checkpoint(path, networks, correction_card(command, data.sha256, split, histories, errors))
    for name, values in errors.items():
        console.print(f"{name}: target {values['target_mean']:.2f} mm on held-out episodes")
    console.print(str(path))
    return path


def correction_card(
    command: TrainCorrectionOptions,
    sha256: str,
    split: Split,
    histories: list[LossHistory],
    errors: dict[str, Any],
) -> ModelCard:
    """Return the card of what was trained."""
    parts = {"train": split.train, "validation": split.validation, "test": split.test}
    prior = load_planar(command.prior, {"friction": command.prior_friction})
    return ModelCard(
        prior=command.prior,
        prior_config=asdict(prior.config),
        network=asdict(command.training.network),
        data={
            "path": str(command.dataset),
            "sha256": sha256,
            "transitions": {name: len(part) for name, part in parts.items()},
            "episodes": {name: len(np.unique(part.episode)) for name, part in parts.items()},
        },
        training={
            **asdict(command.training),
            "validation": command.validation,
            "test": command.test,
            "best_epochs": [history.best + 1 for history in histories],
            "validation_losses": [history.validation[history.best] for history in histories],
        },
        errors=errors,
        versions=environment(),
        command=ros2_command("sain_model", "train_correction"),
        architecture=CORRECTION_ARCHITECTURE,
    )
