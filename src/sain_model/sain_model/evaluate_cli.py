"""``ros2 run sain_model evaluate``: prediction errors of all kinds of dynamics."""

import json
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import torch
import tyro
from rich.console import Console

from sain_core.errors import DatasetError, SainError
from sain_model.checkpoint import Card, load_checkpoint, write_whole
from sain_model.dataset import Transitions, load_transitions, split_by_episode
from sain_model.error_table import error_table, history_table
from sain_model.evaluation import evaluate
from sain_model.load import load_sain, shipped_checkpoint


@dataclass(frozen=True)
class EvaluateCommand:
    """What to evaluate, and on what."""

    dataset: Annotated[Path, tyro.conf.Positional]
    """A shard *.npz, or a folder of them."""
    checkpoint: Path | None = None
    """The checkpoint; without it the one that comes with the package."""
    learned: Path | None = None
    """A checkpoint of kind "learned", trained with --prior identity, to stand beside it."""
    out: Path = Path("evaluation.json")
    """Where the errors are written."""
    seed: int = 0
    """Of the bootstrap."""


def main(arguments: list[str] | None = None) -> int:
    """Report one-step errors of every kind of dynamics on episodes held out of training."""
    torch.set_num_threads(1)
    console = Console()
    command = tyro.cli(EvaluateCommand, prog="evaluate", description=main.__doc__, args=arguments)
    try:
        run(command, console)
    except SainError as error:
        Console(stderr=True).print(f"[red]error:[/] {error}", highlight=False)
        return 1
    return 0


def run(command: EvaluateCommand, console: Console) -> None:
    """Evaluate, print a table and write the JSON.

    Raises:
        DatasetError, CheckpointError, OutputError: see `sain_core.errors`.
    """
    path = command.checkpoint or shipped_checkpoint()
    sain = load_sain(path)
    _, card, _ = load_checkpoint(path)
    learned = load_sain(command.learned) if command.learned else None
    data = load_transitions(command.dataset)
    held_out = unseen(data, card)
    errors = evaluate(held_out, sain, learned, command.seed)
    report = {
        "dataset": {"path": str(command.dataset), "sha256": data.sha256},
        "checkpoint": {"path": str(path), "sha256": card.weights_sha256},
        "learned": str(command.learned) if command.learned else None,
        "seed": command.seed,
        "command": shlex.join(["ros2", "run", "sain_model", "evaluate", *sys.argv[1:]]),
        **errors,
    }
    write_whole(command.out, (json.dumps(report, indent=2) + "\n").encode())
    for part in ("all", "target_moved"):
        console.print(error_table(errors, part))
    console.print(history_table(errors))
    for name, share in errors["reducible_error_removed"].items():
        console.print(f"{name}: {100 * share:.0f} % of the reducible error removed")
    console.print(f"{errors['transitions']} transitions of {errors['episodes']} episodes")
    console.print(f"written to {command.out}")


def unseen(data: Transitions, card: Card) -> Transitions:
    """Return what the checkpoint was not trained on: its test episodes, or all of other data.

    Raises:
        DatasetError: it learned from this data, and nothing of it was held out by itself.
    """
    if data.sha256 in card.data.get("sources", ()):
        raise DatasetError(
            f"the checkpoint learned from this data among others ({card.data['path']}); evaluate it"
            " on episodes collected with another seed"
        )
    if data.sha256 != card.data.get("sha256"):
        return data
    training = card.training
    if not training["test"]:
        raise DatasetError(
            "the checkpoint learned from all of this data (test 0); evaluate it on other episodes"
        )
    return split_by_episode(data, training["seed"], training["validation"], training["test"]).test


if __name__ == "__main__":
    sys.exit(main())
