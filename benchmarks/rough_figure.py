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

from sain_core.drawing.figures import TEXT, new_figure, style_axes, write_png
from sain_core.drawing.palette import PALETTE

BARS = (  # how the names of rows begin, what they are called, colour
    ("", "physics, measured", PALETTE.physics),  # the best of them
    ("physics, identified", "physics, identified", PALETTE.identified),
    ("learned only", "learned only", PALETTE.learned),
    ("SAIN, world", "SAIN", PALETTE.predicted),
    ("SAIN inside", "SAIN inside physics", PALETTE.inside),
    ("floor", "floor", PALETTE.floor),
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
    figure = new_figure(6.6, 4.0)
    axes = figure.subplots()
    style_axes(axes, xlabel="effect on the world", ylabel="mean target error [mm]")
    for bar in range(len(BARS)):
        draw(axes, reports, bar)
    names = [Path(report["dataset"]).name for report in reports]
    axes.set_xticks(range(len(names)), names, rotation=30)
    figure.legend(frameon=False, ncols=3, loc="outside lower center", fontsize=TEXT)
    write_png(figure, command.out)


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
