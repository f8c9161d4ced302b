"""``ros2 run sain_model train``: learn the residual of a prior from collected transitions."""

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import torch
from rich.console import Console

from sain_core.drawing.figures import write_png
from sain_core.model import Model
from sain_model.data.dataset import Dataset, Split
from sain_model.data.mixed import MixedDataset, MixedSplit, load_datasets, split_datasets
from sain_model.dynamics.checkpoint import save_checkpoint
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.error_table import error_tables, gain_line
from sain_model.evaluation.prediction_errors import held_out_errors
from sain_model.physics.friction import FrictionFilter
from sain_model.training.fine_tuning import Parent
from sain_model.training.identified import identified_physics
from sain_model.training.interval_fit import fit_intervals
from sain_model.training.options import TrainOptions
from sain_model.training.plots import draw_losses
from sain_model.training.progress import epoch_bar, event_log
from sain_model.training.push_training import Trainer, prior_and_filter
from sain_model.training.rollout_training import RolloutTrainer
from sain_model.training.training_card import make_card, save_settings
from sain_model.training.training_loop import LossHistory

Physics = tuple[Model, FrictionFilter | None]


def run(command: TrainOptions, console: Console) -> None:
    """Train, evaluate on the held-out episodes, write everything.

    Raises:
        DatasetError, CheckpointError, OutputError: see `sain_core.errors`.
    """
    torch.set_num_threads(1)
    parent = Parent.load(command.parent) if command.parent else None
    if parent:
        parent.check_options(command)
    physics = None
    if command.belief:
        config, physics = identified_physics(Path(command.belief), command.training)
        command = replace(command, training=config)
    config = command.training
    data = load_datasets(command.dataset)
    split = split_datasets(data, config.seed, config.validation, config.test, config.transitions)
    if parent:
        parent.check_data(data)
    sain, histories = learn(command, data, split, console, parent, physics)
    errors = held_out_errors(split, sain)
    if parent:
        errors["fine_tuning"] = parent.gain(sain, split)
    card = make_card(command, data, split, sain, histories, errors, parent)
    path = command.out / f"{command.name}.safetensors"
    save_checkpoint(path, sain.network, card)
    for table in error_tables(errors):
        console.print(table, soft_wrap=True)
    if parent:
        console.print(gain_line(errors["fine_tuning"], parent.name, errors["held_out"]))
    history = histories[0]
    if history.best < 0:
        console.print(f"no epoch did better on the validation episodes than {command.parent}:")
        console.print(f"{path}: its weights, with regions fitted anew")
    else:
        console.print(f"{path}: epoch {history.best + 1} of {len(history.train)}")


def learn(
    command: TrainOptions,
    data: Dataset | MixedDataset,
    split: Split | MixedSplit,
    console: Console,
    parent: Parent | None = None,
    physics: Physics | None = None,
) -> tuple[SainDynamics, list[LossHistory]]:
    """Train on single pushes, then on rollouts if wanted, and fit the regions of predictions.

    `physics` is what is corrected, and what infers its friction; None: as the settings say.
    """
    config = command.training
    rollouts = command.rollout if command.rollout.wanted else None
    if parent:
        physics = parent.sain.prior, parent.sain.filter
    prior, friction = physics or prior_and_filter(config, split.train)
    start = parent.sain if parent else None
    trainer = Trainer(split, prior, config, command.out, friction, start)
    save_settings("train", command, data)
    _run(trainer, command, console)
    write_png(draw_losses(trainer.history), command.out / "loss.png")
    histories = [trainer.history]
    if rollouts:
        learner = RolloutTrainer(
            trainer.network, split, prior, rollouts, config, command.out, friction
        )
        with epoch_bar(console, rollouts.rollout_epochs, learner.epoch) as advance:
            learner.run(advance)
        write_png(draw_losses(learner.history), command.out / "rollout_loss.png")
        histories.append(learner.history)
    infers = friction.config if friction else None
    sain = SainDynamics(
        trainer.network, prior, config.prior, friction=infers, recurrent=rollouts is not None
    )
    return replace(sain, intervals=fit_intervals(sain, *split.validation.parts)), histories


def _run(trainer: Trainer, command: TrainOptions, console: Console) -> None:
    """Train to the end while the terminal, and TensorBoard where it is asked for, show it."""
    with ExitStack() as stack:
        bar = epoch_bar(console, command.training.epochs, trainer.epoch)
        followers = [stack.enter_context(bar)]
        if command.tensorboard:
            followers.append(stack.enter_context(event_log(command.out, trainer.epoch)))

        def advance(epoch: int, history: LossHistory) -> None:
            for follow in followers:
                follow(epoch, history)

        trainer.run(advance)
