"""``ros2 run sain_model train_correction``: learn to correct the planar prior's parameters."""

from dataclasses import asdict

import torch
from rich.console import Console
from rich.progress import Progress

from sain_core.provenance import ros2_command
from sain_model.data.dataset import check_held_out, load_transitions, split_by_episode
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
from sain_model.training.options import TrainCorrectionOptions
from sain_model.training.training_card import data_part, environment, save_settings
from sain_model.training.training_loop import LossHistory


def run(command: TrainCorrectionOptions, console: Console) -> None:
    """Train, evaluate on the held-out episodes, write everything.

    Raises:
        DatasetError, CheckpointError, OutputError: see `sain_core.errors`.
    """
    torch.set_num_threads(1)
    config = command.training
    data = load_transitions(command.dataset)
    split = split_by_episode(data, config.seed, config.validation, config.test, config.transitions)
    check_held_out(split)
    prior = load_planar(command.prior, {"friction": config.prior_friction})
    trainers = make_trainers(split, prior, config, command.out)
    save_settings("train_correction", command, data)
    with Progress(console=console) as bar:
        task = bar.add_task("train", total=config.network.members * config.epochs)

        def advance(member: int, number: int, history: LossHistory) -> None:
            bar.update(task, completed=member * config.epochs + number)

        networks, histories = train_members(trainers, advance)
    sain = ParameterCorrection(networks, prior)
    errors = {
        name: measure(dynamics.step(split.test.state, split.test.action), split.test, 0)
        for name, dynamics in ((command.prior, prior), ("sain", sain))
    }
    card = ModelCard(
        prior=command.prior,
        prior_config=asdict(prior.config),
        network=asdict(config.network),
        data=data_part([command.dataset], data, split),
        training={
            **asdict(config),
            "best_epochs": [history.best + 1 for history in histories],
            "validation_losses": [history.best_loss for history in histories],
        },
        errors=errors,
        versions=environment(),
        command=ros2_command("sain_model", "train_correction"),
        architecture=CORRECTION_ARCHITECTURE,
    )
    path = command.out / f"{command.name}{SUFFIX}"
    save_checkpoint(path, networks, card)
    for name, values in errors.items():
        console.print(f"{name}: target {values['target_mean']:.2f} mm on held-out episodes")
    console.print(str(path))
