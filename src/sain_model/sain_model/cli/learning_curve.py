"""``ros2 run sain_model learning_curve``: how many transitions a network needs."""

from collections.abc import Callable
from dataclasses import asdict

import torch
from rich.console import Console

from sain_core.cli.fitting_table import FittingTable
from sain_core.drawing.figures import write_png
from sain_core.provenance import ros2_command
from sain_core.storage import write_json, write_whole
from sain_model.cli.options import LearningCurveOptions
from sain_model.data.dataset import load_transitions, split_by_episode
from sain_model.evaluation.markdown import markdown_table
from sain_model.training.learning_curve import Point, learning_curve
from sain_model.training.plots import draw_curves


def run(command: LearningCurveOptions, console: Console) -> None:
    """Train, measure, print the table, write JSON, Markdown and picture.

    Raises:
        DatasetError, CheckpointError, OutputError: see `sain_core.errors`.
    """
    torch.set_num_threads(1)
    config = command.training
    data = load_transitions(command.dataset)
    split = split_by_episode(data, config.seed, config.validation, config.test)
    sizes = tuple(sorted(set(command.sizes)))

    def tell(prior: str, size: int) -> None:
        console.print(f"training on {size} transitions, prior {prior}")

    points = learning_curve(split, config, sizes, command.steps, command.out / "state", tell)
    report = {
        "dataset": {"path": str(command.dataset), "sha256": data.sha256},
        "held_out": len(split.test),
        "training": asdict(config),
        "steps": command.steps,
        "command": ros2_command("sain_model", "learning_curve"),
        "points": [asdict(point) for point in points],
    }
    write_json(command.out / "curves.json", report)
    write_whole(command.out / "curves.md", markdown(points).encode())
    write_png(draw_curves(points), command.out / "curves.png")
    console.print(_table(points, len(split.test)), soft_wrap=True)
    console.print(f"written to {command.out}")


def markdown(points: list[Point]) -> str:
    """Return the points as a table in Markdown."""
    header, *rows = _cells(points, _interval)
    return markdown_table(header, rows)


def _table(points: list[Point], pushes: int) -> FittingTable:
    header, *rows = _cells(points, _mean)
    table = FittingTable(f"Target's mean error [mm] on {pushes} held-out pushes")
    for column, name in enumerate(header):
        table.add_column(name, justify="right" if column else "left")
    for row in rows:
        table.add_row(*row)
    return table


def _cells(points: list[Point], write: Callable[[Point], str]) -> list[list[str]]:
    """Return header and rows: a column for each number of transitions, one for physics alone."""
    sizes = sorted({point.transitions for point in points})
    known = {(point.name, point.transitions): point for point in points}
    header = ["predictor", *(f"{size:,}" if size else "none" for size in sizes)]
    names = dict.fromkeys(point.name for point in points)
    return [
        header,
        *(
            [name, *(write(known[name, size]) if (name, size) in known else "" for size in sizes)]
            for name in names
        ),
    ]


def _mean(point: Point) -> str:
    return f"{point.mean:.2f}"


def _interval(point: Point) -> str:
    return f"{point.mean:.2f} [{point.low:.2f}, {point.high:.2f}]"
