"""``ros2 run sain_model train``: learn what a prior leaves from collected transitions."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import torch
from rich.console import Console

from sain_core.drawing.figures import write_png
from sain_core.errors import ConfigError
from sain_model.data.dataset import Dataset, load_dataset, split_by_episode
from sain_model.dynamics.checkpoint import SUFFIX, save_checkpoint
from sain_model.dynamics.residual import module_of
from sain_model.dynamics.settings import STEPS
from sain_model.evaluation.errors import evaluate
from sain_model.evaluation.predictors import NAMES
from sain_model.evaluation.tables import error_tables
from sain_model.training.fine_tuning import Parent, gain_line
from sain_model.training.fit import PUSHES, fit, identified_kind, trained_kind
from sain_model.training.plots import draw_losses
from sain_model.training.progress import epoch_bar, event_log
from sain_model.training.settings import TrainOptions
from sain_model.training.trainer import LossHistory, Progress
from sain_model.training.training_card import make_card, own_errors, save_settings

LOSSES = ("loss.png", "rollout_loss.png")


def run(command: TrainOptions, console: Console) -> None:
    """Train, evaluate on the held-out episodes, write everything.

    Raises:
        DatasetError, CheckpointError, ConfigError, OutputError: see `sain_core.errors`.
    """
    torch.set_num_threads(1)
    parent = Parent.load(command.parent) if command.parent else None
    kind = None
    if parent:
        parent.check_options(command)
        kind = parent.sain.belief.trained
    if command.belief:
        config, kind = identified_kind(Path(command.belief), command.training)
        command = replace(command, training=config)
    config = command.training
    if command.rollout.wanted and config.network.corrects_parameters:
        raise ConfigError("--steps-ahead trains residuals; leave it or --output parameters out")
    data = load_dataset(*command.dataset)
    split = split_by_episode(data, config.seed, config.validation, config.test, config.transitions)
    if parent:
        parent.check_data(data)
    model, histories = fit(
        split,
        kind or trained_kind(config),
        config,
        command.out,
        command.rollout,
        parent.sain if parent else None,
        partial(_show, command, data, console),
    )
    for history, name in zip(histories, LOSSES, strict=False):
        write_png(draw_losses(history), command.out / name)
    name = NAMES[model.origin.kind]
    errors = evaluate(split.held_out, {name: model}, STEPS)
    errors["held_out"] = "test" if len(split.test) else "validation"
    for table in error_tables(errors):
        console.print(table, soft_wrap=True)
    errors = own_errors(errors, name)
    if parent:
        errors["fine_tuning"] = parent.gain(model, split.held_out)
        console.print(gain_line(errors["fine_tuning"], parent.name, errors["held_out"]))
    card = make_card(
        command, data, split, model, histories, errors, parent.card if parent else None
    )
    path = command.out / f"{command.name}{SUFFIX}"
    save_checkpoint(path, module_of(model), card)
    history = histories[0]
    if history.best < 0:
        console.print(f"no epoch did better on the validation episodes than {command.parent}:")
        console.print(f"{path}: its weights, with regions fitted anew")
    else:
        console.print(f"{path}: epoch {history.best + 1} of {len(history.train)}")


@contextmanager
def _show(
    command: TrainOptions, data: Dataset, console: Console, name: str, epochs: int, done: int
) -> Iterator[Progress]:
    """Show a training in the terminal, and to TensorBoard where it is asked for.

    Its settings are written now, as a state of another training was not refused.
    """
    save_settings(command, data)
    with ExitStack() as stack:
        followers = [stack.enter_context(epoch_bar(console, epochs, done))]
        if command.tensorboard and name == PUSHES:
            followers.append(stack.enter_context(event_log(command.out, done)))

        def advance(epoch: int, history: LossHistory) -> None:
            for follow in followers:
                follow(epoch, history)

        yield advance
