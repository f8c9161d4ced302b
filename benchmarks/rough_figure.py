"""The picture of `benchmarks.rough_world` over several collections: one group of bars for each.

./env python -m benchmarks.rough_figure runs/effects/mass.json runs/effects/tilt.json
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sain_model.evaluation.png import write_png

BARS = (  # how the names of rows begin, what they are called, colour
    ("", "physics, measured", "#8c8c8c"),  # the best of them
    ("physics, identified", "physics, identified", "#b8a04a"),
    ("learned only", "learned only", "#e8762c"),
    ("SAIN, world", "SAIN", "#7fa8d9"),
    ("SAIN inside", "SAIN inside physics", "#1f4e8c"),
    ("floor", "floor", "#2e8b57"),
)


@dataclass(frozen=True)
class Command:
    """What to draw."""

    reports: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Files that `benchmarks.rough_world --out` wrote; the last size of each is drawn."""
    out: Path = Path("docs/media/rough.png")
    """A PNG."""


def main() -> None:
    """Draw the mean target errors of several collections, with 95 % intervals."""
    command = tyro.cli(Command, description=main.__doc__)
    reports = [json.loads(path.read_text()) for path in command.reports]
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    axes = figure.subplots()
    for bar in range(len(BARS)):
        draw(axes, reports, bar)
    names = [Path(report["dataset"]).name for report in reports]
    axes.set_xticks(range(len(names)), names)
    axes.set_ylabel("mean target error, mm")
    axes.grid(axis="y", alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(frameon=False, ncols=6, loc="outside upper center")
    write_png(command.out, figure, dots_per_inch=110)


def draw(axes: Axes, reports: list[dict[str, Any]], bar: int) -> None:
    """Draw one bar of each group, with its interval."""
    start, label, colour = BARS[bar]
    rows = [last_row(report, start or report["best physics"]) for report in reports]
    means = np.array([row["mean"] for row in rows])
    reach = np.abs(np.array([row["interval"] for row in rows]).T - means)
    places = np.arange(len(rows)) + (bar - (len(BARS) - 1) / 2) * 0.8 / len(BARS)
    axes.bar(places, means, 0.8 / len(BARS), label=label, color=colour)
    axes.errorbar(places, means, reach, fmt="none", ecolor="black", elinewidth=0.8)


def last_row(report: dict[str, Any], start: str) -> dict[str, Any]:
    """Return the last row whose name begins so."""
    return [row for name, row in report["errors"].items() if name.startswith(start)][-1]


if __name__ == "__main__":
    main()
