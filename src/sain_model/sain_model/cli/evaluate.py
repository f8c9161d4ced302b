"""``ros2 run sain_model evaluate``: prediction errors of all kinds of dynamics."""

from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sain_core.config import MOST_SEED, Config, option, required
from sain_core.errors import CheckpointError, DatasetError
from sain_core.model import Model, load_dynamics
from sain_core.output import OVERWRITE_HELP, claim_file, write_json, write_whole
from sain_core.provenance import ros2_command
from sain_core.push import LENGTH
from sain_core.transitions import draw_parts
from sain_core.types import Mask
from sain_model.network.settings import STEPS

if TYPE_CHECKING:
    from sain_model.data.dataset import Dataset
    from sain_model.dynamics.load import ModelCard
    from sain_model.dynamics.sain import Origin
    from sain_model.evaluation.errors import Figures, Predictions


@dataclass(frozen=True)
class EvaluateModelOptions(Config):
    """Report errors of every kind of dynamics, one push and many ahead, on episodes held out."""

    dataset: Annotated[Path, tyro.conf.Positional] = required("a shard *.npz, or a folder of them")
    checkpoint: Path | None = option(None, "the checkpoint; by default the shipped one")
    beside: tuple[str, ...] = option(
        (),
        "more models to compare with: paths of checkpoints, such as one of --prior identity or"
        " --steps-ahead, or names in the registry of models (bullet is slow)",
    )
    belief: str = option(
        "", "file of `sain_model identify`, with which each episode begins; empty: none"
    )
    open_loop: tuple[int, ...] = option(
        STEPS, "numbers of pushes after which errors of rollouts are taken; none: no rollouts"
    )
    out: Path = option(
        Path("results/evaluation.json"), "file for the errors; a table and a picture go beside it"
    )
    overwrite: bool = option(False, OVERWRITE_HELP)
    seed: int = option(0, "seed of the bootstrap", minimum=0, maximum=MOST_SEED)


def run(options: EvaluateModelOptions, console: Console) -> None:
    """Evaluate, print tables and write JSON, Markdown and picture."""
    from sain_model.data.dataset import load_dataset, make_windows
    from sain_model.dynamics.load import parse_card, shipped_checkpoint
    from sain_model.evaluation.errors import predict_all, report

    for path in (options.out, *_open_loop_files(options)):
        claim_file(path, options.overwrite)
    path = options.checkpoint or shipped_checkpoint()
    data = load_dataset(options.dataset)
    with _models(options) as (models, physics):
        names, origins = [*models], {name: _origin(model) for name, model in models.items()}
        cards = [parse_card(Path(name), one.card) for name, one in origins.items() if one.card]
        held_out = unseen(data, *cards)
        steps = max(options.open_loop, default=1)
        windows = [make_windows(part, steps).pushes[..., LENGTH] for part in held_out.parts]
        pushes = sum(int(np.count_nonzero(lengths)) for lengths in windows)
        with _bars(physics, pushes, console) as advance:
            predictions = predict_all(held_out, models, steps, physics, advance)
        counts = {name: model.refused for name, model in physics.items()}
        refused = {name: count for name, count in counts.items() if count is not None}
    errors = report(predictions, names, options.open_loop, options.seed)
    _write(options, errors, predictions, refused)
    errors["unexplained"] = _unexplained(predictions, names[0])
    hashes = {name: origin.model_hash for name, origin in origins.items()}
    document = {
        "dataset": {"path": str(options.dataset), "sha256": data.sha256},
        "checkpoint": {"path": str(path), "models": hashes},
        "belief": options.belief or None,
        "beside": list(options.beside),
        "seed": options.seed,
        "command": ros2_command("sain_model", "evaluate"),
        **errors,
        "refused": refused,
    }
    write_json(options.out, document)
    _show(errors, refused, console)
    console.print(f"written to {options.out}")


@contextmanager
def _bars(names: Collection[str], pushes: int, console: Console) -> Iterator[Callable[..., None]]:
    """Show for each model how many of so many pushes it has predicted."""
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
    with Progress(*columns, TimeRemainingColumn(), console=console, disable=not names) as bars:
        tasks = {name: bars.add_task(name, total=pushes) for name in names}
        yield lambda name, count: bars.advance(tasks[name], count)


@contextmanager
def _models(options: EvaluateModelOptions) -> Iterator[tuple[dict[str, Model], dict[str, Model]]]:
    """Give models by the names of their kinds, the one to evaluate first, and physics by name."""
    from sain_model.dynamics.load import load_checkpoint, load_shipped
    from sain_model.evaluation.errors import NAMES

    main: Model = load_checkpoint(options.checkpoint) if options.checkpoint else load_shipped()
    if options.belief:
        main = main.with_belief(Path(options.belief))
    models, physics = {NAMES.get(_origin(main).kind, "model"): main}, {}
    with ExitStack() as stack:
        for name in options.beside:
            model = load_dynamics(name)
            stack.callback(model.close)
            if _origin(model).card:
                kind = NAMES.get(_origin(model).kind, name)
                models[name if kind in models else kind] = model
            else:
                physics[name] = model
        yield models, physics


def _origin(model: Model) -> "Origin":
    """Return where a model comes from; only one of a checkpoint has a card."""
    from sain_model.dynamics.sain import Origin, SainDynamics

    return model.origin if isinstance(model, SainDynamics) else Origin()


def _write(
    options: EvaluateModelOptions,
    errors: "Figures",
    predictions: "list[Predictions]",
    refused: dict[str, int],
) -> None:
    """Write table and picture of rollouts beside the JSON, where any are asked for."""
    if not options.open_loop:
        return
    from sain_model.evaluation.presentation import rollout_markdown, save_rollout_plot

    text = rollout_markdown(errors) + "".join(
        f"* {name}: pushes that could not be carried out in the scenes that it predicted, and moved"
        f" nothing: {count}\n"
        for name, count in refused.items()
    )
    table, picture = _open_loop_files(options)
    write_whole(table, text.encode())
    save_rollout_plot(picture, predictions, options.seed)


def _unexplained(predictions: "list[Predictions]", name: str) -> str:
    """Return in words how many pushes fit no physics, given their history; empty: all do."""
    from sain_model.dynamics.identify import unexplained
    from sain_model.evaluation.errors import HISTORY
    from sain_model.inference.evidence import are_outliers

    odd = []
    for some in predictions:
        after = some.by_name.get(name + HISTORY, some.by_name[name])[:, 0]
        odd.append(are_outliers(after, some.part.select(some.windows.rows[:, 0])))
    found = np.concatenate(odd)
    return unexplained(int(found.sum()), len(found))


def _open_loop_files(options: EvaluateModelOptions) -> list[Path]:
    """Return the files of table and picture, if rollouts are asked for."""
    stem = options.out.with_suffix("")
    return [Path(f"{stem}_open_loop{end}") for end in (".md", ".png")] if options.open_loop else []


def _show(errors: "Figures", refused: dict[str, int], console: Console) -> None:
    from sain_model.evaluation.presentation import error_tables

    for table in error_tables(errors):
        console.print(table, soft_wrap=True)
    for name, count in refused.items():
        console.print(f"{name}: pushes of its rollouts that could not be carried out: {count}")
    if errors["unexplained"]:
        console.print(f"warning: {errors['unexplained']}", soft_wrap=True)
    console.print(f"{errors['transitions']} transitions of {errors['episodes']} episodes")


def unseen(data: "Dataset", *cards: "ModelCard") -> "Dataset":
    """Return what no checkpoint was trained on: their test episodes, or all of other data.

    Raises `DatasetError`: one has learned from this data and held nothing of it out by itself, or
    they have seen every episode between them; `CheckpointError`: a card of these data does not say
    which it has seen.
    """
    held_out = np.ones(len(data), dtype=bool)
    for card in cards:
        for seen_by in card.lineage():
            held_out &= _held_out(data, seen_by)
    if not held_out.any():
        raise DatasetError("these checkpoints were trained on all episodes between them")
    return data if held_out.all() else data.select(held_out)


def _held_out(data: "Dataset", card: "ModelCard") -> Mask:
    """Return which pushes (M,) a checkpoint was not trained on."""
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
