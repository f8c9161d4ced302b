"""``ros2 run sain_model evaluate``: prediction errors of all kinds of dynamics."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch
from rich.console import Console

from sain_core.dataset import draw_parts
from sain_core.errors import CheckpointError, ConfigError, DatasetError
from sain_core.model import Model
from sain_core.provenance import ros2_command
from sain_core.push import LENGTH
from sain_core.storage import write_json
from sain_core.types import Mask
from sain_model.cli.options import EvaluateModelOptions
from sain_model.data.dataset import Dataset
from sain_model.data.mixed import MixedDataset, load_datasets
from sain_model.data.windows import make_windows
from sain_model.dynamics.checkpoint import ModelCard, parse_card
from sain_model.dynamics.load import load_sain, load_shipped, shipped_checkpoint
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.baselines import followed, open_models, refusals
from sain_model.evaluation.error_table import error_tables
from sain_model.evaluation.metrics import LEARNED
from sain_model.evaluation.open_loop import NAMES, RECURRENT_SAIN
from sain_model.evaluation.open_loop_report import report_open_loop
from sain_model.evaluation.prediction_errors import evaluate
from sain_model.evaluation.shape_errors import shape_errors

AnyData = TypeVar("AnyData", Dataset, MixedDataset)


def run(command: EvaluateModelOptions, console: Console) -> None:
    """Evaluate, print a table and write the JSON.

    Raises:
        DatasetError, CheckpointError, ConfigError, OutputError: see `sain_core.errors`.
    """
    torch.set_num_threads(1)
    path = command.checkpoint or shipped_checkpoint()
    sain = load_sain(path) if command.checkpoint else load_shipped()
    sain = sain.with_belief(Path(command.belief)) if command.belief else sain
    data = load_datasets([command.dataset])
    if len(data.parts) == 1 and data.parts[0].bodies.are_paper_disks:
        errors = _errors_of_disks(command, data.parts[0], sain, console)
    else:
        errors = _errors_of_shapes(command, data, sain)
    report = {
        "dataset": {"path": str(command.dataset), "sha256": data.sha256},
        "checkpoint": {"path": str(path), "sha256": sain.model_hash},
        "belief": command.belief or None,
        "learned": str(command.learned) if command.learned else None,
        "recurrent": str(command.recurrent) if command.recurrent else None,
        "seed": command.seed,
        "command": ros2_command("sain_model", "evaluate"),
        **errors,
    }
    write_json(command.out, report)
    _show(errors, console)
    console.print(f"written to {command.out}")


def _errors_of_disks(
    command: EvaluateModelOptions, data: Dataset, sain: SainDynamics, console: Console
) -> dict[str, Any]:
    """Return errors of everything that predicts disks, on pushes that no model has seen."""
    learned = load_sain(command.learned) if command.learned else None
    with open_models(command.baselines) as named:
        models = _models(command, sain, learned)
        models |= {name: model for name, model in named.items() if _card(model)}
        physics = {name: model for name, model in named.items() if name not in models}
        texts = {name: _card(model) for name, model in models.items()}
        cards = [parse_card(Path(name), text) for name, text in texts.items() if text]
        held_out = unseen(data, *cards)
        errors = evaluate(held_out, sain, learned, command.seed)
        if command.open_loop:
            errors |= _open_loop(command, held_out, models, physics, console)
    return errors


def _errors_of_shapes(
    command: EvaluateModelOptions, data: MixedDataset, sain: SainDynamics
) -> dict[str, Any]:
    """Return errors of single pushes of any body, on pushes that the model has not seen.

    Raises:
        ConfigError: there are models to compare with, which needs disks.
    """
    if command.learned or command.recurrent or command.baselines:
        raise ConfigError(
            "on other bodies than disks, a model is compared with its own prior alone; leave"
            " --learned, --recurrent and --baselines out"
        )
    return shape_errors(unseen(data, parse_card(Path("the card"), sain.card)), sain, command.seed)


def _models(
    command: EvaluateModelOptions, sain: SainDynamics, learned: SainDynamics | None
) -> dict[str, Model]:
    """Return the models to roll out, by name."""
    models: dict[str, Model] = {} if learned is None else {LEARNED: learned}
    models[NAMES.get(sain.kind, sain.kind)] = sain
    if command.recurrent:
        models[RECURRENT_SAIN] = load_sain(command.recurrent)
    return models


def _card(model: Model) -> str:
    """Return the JSON card of a model that comes from a checkpoint; empty for physics."""
    return str(getattr(model, "card", ""))


def _open_loop(
    command: EvaluateModelOptions,
    held_out: Dataset,
    models: Mapping[str, Model],
    physics: Mapping[str, Model],
    console: Console,
) -> dict[str, Any]:
    """Return the errors of rollouts, and how many pushes physics could not carry out in them."""
    pushes = make_windows(held_out, max(command.open_loop)).pushes[..., LENGTH]
    with followed(physics, int(np.count_nonzero(pushes)), console) as shown:
        errors = report_open_loop(
            command.out, held_out, models, command.seed, command.open_loop, shown
        )
    refused = refusals(shown)
    return {"open_loop": errors} | ({"refused": refused} if refused else {})


def _show(errors: dict[str, Any], console: Console) -> None:
    """Print errors of single pushes as tables."""
    for table in error_tables(errors):
        console.print(table, soft_wrap=True)
    for name, share in errors.get("reducible_error_removed", {}).items():
        console.print(f"{name}: {100 * share:.0f} % of the reducible error removed")
    for name, count in errors.get("refused", {}).items():
        console.print(f"{name}: pushes of its rollouts that could not be carried out: {count}")
    console.print(f"{errors['transitions']} transitions of {errors['episodes']} episodes")


def unseen(data: AnyData, *cards: ModelCard) -> AnyData:
    """Return what no checkpoint was trained on: their test episodes, or all of other data.

    Raises:
        DatasetError: one has learned from this data and held nothing of it out by itself, or
            between them they have seen every episode.
        CheckpointError: a card of these data does not say which it has seen.
    """
    held_out = np.ones(len(data), dtype=bool)
    for card in cards:
        for seen_by in card.lineage():
            held_out &= _held_out(data, seen_by)
    if not held_out.any():
        raise DatasetError("these checkpoints were trained on all episodes between them")
    return data if held_out.all() else data.select(held_out)


def _held_out(data: Dataset | MixedDataset, card: ModelCard) -> Mask:
    """Tell which pushes (M,) a checkpoint was not trained on."""
    if data.sha256 in card.data.get("sources", ()):
        raise DatasetError(
            f"the checkpoint learned from this data among others ({card.data['path']}); evaluate it"
            " on episodes collected with another seed"
        )
    if data.sha256 != card.data.get("sha256"):
        return np.ones(len(data), dtype=bool)
    used: list[Any] = [card.training.get(name) for name in ("seed", "validation", "test")]
    if None in used:
        raise CheckpointError("a card does not say which episodes of its data it has seen")
    if not card.training["test"]:
        raise DatasetError(
            "the checkpoint learned from all of this data (test 0); evaluate it on other episodes"
        )
    return draw_parts(data.episode, *used)[-1]
