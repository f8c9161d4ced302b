"""``ros2 run sain_model train``: learn what a prior leaves from collected transitions."""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import field, make_dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from sain_core.output import claim_folder
from sain_model.network.settings import STEPS, require_torch
from sain_model.training.settings import DEFAULT, OF_BODIES, PRESETS, TrainingConfig, TrainOptions

if TYPE_CHECKING:
    from sain_model.data.dataset import Dataset
    from sain_model.training.trainer import Progress


def options(arguments: Sequence[str]) -> type[TrainOptions]:
    """Return the options with the defaults that ``--preset``, ``--from`` and ``--belief`` give.

    Raises `CheckpointError`: the checkpoint of ``--from``, or the belief, is not sound.
    """
    scout = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    scout.add_argument("--preset", default=DEFAULT)
    scout.add_argument("--from", dest="parent")
    scout.add_argument("--belief", default="")
    try:
        scouted = scout.parse_known_args(arguments)[0]
    except argparse.ArgumentError:
        return TrainOptions  # which reports it
    defaults = PRESETS.get(scouted.preset, TrainingConfig())
    if scouted.belief and scouted.preset == DEFAULT:
        from sain_model.inference.kinds import read_belief

        if read_belief(Path(scouted.belief)).likeliest.of_bodies:
            defaults = OF_BODIES
    if scouted.parent:
        from sain_model.training.fit import Parent  # loads PyTorch

        defaults = Parent.load(scouted.parent).settings
    return make_dataclass(
        "TrainOptions",
        [("training", TrainingConfig, field(default=defaults))],
        bases=(TrainOptions,),
        frozen=True,
        namespace={"__doc__": TrainOptions.__doc__},
    )


def run(options: TrainOptions, console: Console) -> None:
    """Train, evaluate on the held-out episodes, write everything."""
    require_torch("train")
    from sain_core.view.figures import write_png
    from sain_model.data.dataset import load_dataset, split_by_episode
    from sain_model.dynamics.identify import infer_bodies
    from sain_model.dynamics.load import SUFFIX, save_checkpoint
    from sain_model.dynamics.sain import weights_of
    from sain_model.evaluation.errors import NAMES, evaluate
    from sain_model.evaluation.presentation import error_tables
    from sain_model.training.fit import (
        PICTURES,
        Parent,
        draw_losses,
        fit,
        gain_line,
        gain_on_bodies,
        identified_kind,
        make_card,
        own_errors,
        trained_kind,
        written_names,
    )

    claim_folder(options.out, written_names(options.name), options.overwrite)
    parent = Parent.load(options.parent) if options.parent else None
    kind = None
    if parent:
        parent.check_options(options)
        kind = parent.sain.belief.trained
    if options.belief:
        config, kind = identified_kind(Path(options.belief), options.training)
        options = replace(options, training=config)
    config = options.training
    data = load_dataset(*options.dataset)
    split = split_by_episode(data, config.seed, config.validation, config.test)
    if parent:
        parent.check_data(data)
    kind = kind or trained_kind(config)
    bodies = infer_bodies(kind, split.train) if kind.of_bodies else None
    model, histories = fit(
        split,
        kind,
        config,
        options.out,
        parent.sain if parent else None,
        partial(_show, options, data, console),
        options.overwrite,
        bodies,
    )
    for history, name in zip(histories, PICTURES, strict=False):
        write_png(draw_losses(history), options.out / name)
    name = NAMES[model.origin.kind]
    errors = evaluate(split.held_out, {name: model}, STEPS)
    errors["held_out"] = "test" if len(split.test) else "validation"
    for table in error_tables(errors):
        console.print(table, soft_wrap=True)
    errors = own_errors(errors, name)
    if parent:
        errors["fine_tuning"] = parent.gain(model, split.held_out)
        console.print(gain_line(errors["fine_tuning"], parent.name, errors["held_out"]))
    if bodies:
        errors["of_bodies"] = gain_on_bodies(model, split.held_out, bodies)
        console.print(gain_line(errors["of_bodies"], "identified physics", errors["held_out"]))
    card = make_card(
        options, data, split, model, histories, errors, parent.card if parent else None
    )
    path = options.out / f"{options.name}{SUFFIX}"
    save_checkpoint(path, weights_of(model), card)
    _warn_of_few(len(split.validation), console)
    history, centres = histories[0], weights_of(model).centres
    if history.best < 0:
        before = options.parent or "the physics alone"
        console.print(f"held-out pushes: nothing that was learned did better than {before}")
        console.print(f"{path}: as before, with regions fitted anew")
    elif centres:
        console.print(f"{path}: a kernel on {centres} pushes")
    else:
        console.print(f"{path}: epoch {history.best + 1} of {len(history.train)}")


def _warn_of_few(held_out: int, console: Console) -> None:
    """Say where regions were fitted to fewer pushes than show a quantile."""
    from sain_model.training.interval_fit import FEW

    if held_out < FEW:
        console.print(
            f"warning: regions are fitted to {held_out} held-out pushes; with fewer than {FEW} they"
            " may hold bodies less often than they state",
            soft_wrap=True,
        )


@contextmanager
def _show(
    options: TrainOptions, data: "Dataset", console: Console, name: str, epochs: int, done: int
) -> "Iterator[Progress]":
    """Show a training in the terminal.

    Its settings are written now, as a state of another training was not refused.
    """
    from sain_model.training.fit import epoch_bar, save_settings

    save_settings(options, data)
    with epoch_bar(console, epochs, done) as advance:
        yield advance
