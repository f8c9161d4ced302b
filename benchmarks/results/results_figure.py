"""The picture of the page of results: scenes solved and pushes, of every scenario.

./env python -m benchmarks.results.results_figure
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import tyro
from matplotlib.axes import Axes

from sain_core.output import claim_file
from sain_core.view.figures import TEXT, new_figure, style_axes, write_png
from sain_core.view.palette import PALETTE
from sain_eval.loop.results import wilson_interval

SERIES: Final = (  # models as the page names them, what they are called in the picture, colour
    (("straight pushes",), "straight pushes", PALETTE.floor),
    (("planar prior, history", "pusht"), "planar prior", PALETTE.physics),
    (("SAIN as shipped",), "SAIN", PALETTE.predicted),
    (("SAIN trained there",), "SAIN trained in that world", PALETTE.learned),
)
CELL: Final = re.compile(r"(\d+)/(\d+)(?:,\s([\d.]+))?")
FEWEST_SCENES: Final = 20  # a scenario with fewer says too little for a picture
OWN_WORLD: Final = ("Bullet", "gym-pusht")  # not named beside their scenarios


@dataclass(frozen=True)
class Result:
    """What one model reached in one scenario of one world, at its smallest tolerance."""

    scenario: str
    world: str
    within: str
    model: str
    solved: int
    scenes: int
    pushes: float | None  # mean of the solved scenes

    @property
    def row(self) -> str:
        """What stands beside it in the picture."""
        world = "" if self.world in OWN_WORLD else f", {self.world}"
        return f"{self.scenario}{world}: {self.within}"


@dataclass(frozen=True)
class Command:
    """What to draw."""

    page: Path = Path("results/results.md")
    """The page that `make table` writes."""
    out: Path = Path("results/results.png")
    """A PNG."""
    overwrite: bool = False
    """Replace what others wrote there, such as docs/media/results.png."""


def main() -> None:
    """Draw what the overview of the page of results has in numbers."""
    command = tyro.cli(Command, description=main.__doc__)
    claim_file(command.out, command.overwrite)
    results = [
        one for one in read_overview(command.page.read_text()) if one.scenes >= FEWEST_SCENES
    ]
    rows = list(dict.fromkeys(one.row for one in results))
    figure = new_figure(7.6, 0.27 * len(rows) + 0.8)
    solved, pushes = figure.subplots(1, 2, sharey=True)
    style_axes(solved, xlabel="scenes solved [%], 95 % interval")
    style_axes(pushes, xlabel="pushes in a solved scene, mean")
    for place, (names, label, colour) in enumerate(SERIES):
        some = [one for one in results if one.model in names]
        heights = np.array([rows.index(one.row) for one in some]) + 0.16 * (place - 1.5)
        if some:
            draw_series(solved, pushes, some, heights, label, colour)
    solved.set_yticks(range(len(rows)), rows, fontsize=TEXT)
    solved.set_ylim(len(rows) - 0.5, -0.5)
    pushes.set_xlim(left=0.0)
    handles, labels = solved.get_legend_handles_labels()
    figure.legend(
        handles, labels, frameon=False, ncols=4, loc="outside lower center", fontsize=TEXT
    )
    write_png(figure, command.out)


def draw_series(
    solved: Axes, pushes: Axes, some: list[Result], heights: np.ndarray, label: str, colour: str
) -> None:
    """Draw one model: a dot and an interval for each of its rows."""
    intervals = [wilson_interval(one.solved, one.scenes) for one in some]
    shares = np.array([100 * one.estimate for one in intervals])
    reach = [[one.estimate - one.low, one.high - one.estimate] for one in intervals]
    style: dict[str, Any] = {"fmt": "o", "color": colour, "markersize": 3.5, "elinewidth": 1.0}
    solved.errorbar(shares, heights, xerr=100 * np.array(reach).T.clip(0.0), label=label, **style)
    pushes.errorbar([one.pushes or np.nan for one in some], heights, **style)


def read_overview(page: str) -> Iterator[Result]:
    """Yield the numbers of the tables in the page's overview."""
    overview = page.partition("## Overview")[2].partition("\n## ")[0]
    for section in overview.split("\n### ")[1:]:
        world, *lines = section.splitlines()
        head, _, *rows = [
            [cell.strip() for cell in line.strip().strip("|").split("|")]
            for line in lines
            if line.startswith("|")
        ]
        for scenario, within, *values in rows:
            for model, value in zip(head[2:], values, strict=True):
                if found := CELL.fullmatch(value):
                    pushes = float(found[3]) if found[3] else None
                    counts = int(found[1]), int(found[2])
                    yield Result(scenario.strip("`"), world, within, model, *counts, pushes)


if __name__ == "__main__":
    main()
