"""The picture of open loops: how errors grow with the number of pushes, for each kind."""

from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sain_core.bootstrap import bootstrap_mean
from sain_core.drawing.figures import TEXT, new_figure, style_axes, write_png
from sain_core.drawing.palette import PALETTE
from sain_core.scene import MID, TARGET
from sain_core.seeding import generator
from sain_model.evaluation.metrics import (
    LEARNED,
    MEASURED,
    position_errors,
)
from sain_model.evaluation.open_loop import RECURRENT_SAIN, RESIDUAL_SAIN, OpenLoop

KINDS: Final = {  # the four of the paper's Fig. 1, with their colours
    MEASURED: ("physics only", PALETTE.physics),
    LEARNED: (LEARNED, PALETTE.learned),
    RESIDUAL_SAIN: ("residual SAIN", PALETTE.predicted),
    RECURRENT_SAIN: ("recurrent SAIN", PALETTE.history),
}
NEAREST: Final = 0.07  # of the axis' height, between two labels


def save_open_loop_plot(path: Path, loop: OpenLoop, seed: int) -> int:
    """Write a PNG of mean errors over steps with 95 % bands; return how many windows it shows.

    All steps are of the same windows: those of the full length, or of the longest there is.
    """
    lengths = loop.windows.known.sum(axis=1)
    rows = lengths == lengths.max()
    write_png(draw_open_loop(loop, rows, int(lengths.max()), seed), path)
    return int(rows.sum())


def draw_open_loop(loop: OpenLoop, rows: np.ndarray, steps: int, seed: int) -> Figure:
    """Draw the errors of the windows (W,) of a mask after each of so many steps."""
    figure = new_figure(6.6, 6.6)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, disk, title in zip(panels, (TARGET, MID), ("target", "mid disk"), strict=True):
        style_axes(axes, title, ylabel="mean position error [mm]")
        _draw(axes, loop, rows, steps, disk, seed)
    panels[1].set_xlabel("pushes predicted from the first scene alone", fontsize=TEXT)
    episodes = len(np.unique(loop.windows.episodes[rows]))
    count = f"{int(rows.sum())} rollouts of {steps} pushes, {episodes} held-out episodes"
    figure.suptitle(f"{count}; bands: 95 %", x=0.02, ha="left", fontsize=TEXT + 1.5)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, frameon=False, loc="outside lower center", ncols=4, fontsize=TEXT
    )
    return figure


def _draw(axes: Axes, loop: OpenLoop, rows: np.ndarray, steps: int, disk: int, seed: int) -> None:
    ends = []
    for name, (label, colour) in KINDS.items():
        if name not in loop.predictions:
            continue
        mean, low, high = _curve(loop, name, rows, steps, disk, seed)
        places = np.arange(1, steps + 1)
        axes.plot(places, mean, color=colour, linewidth=2.2, label=label)
        axes.fill_between(places, low, high, color=colour, alpha=0.15, linewidth=0)
        ends.append((float(mean[-1]), colour))
    axes.set_xlim(1, 1 + 1.1 * max(steps - 1, 1))
    axes.set_ylim(bottom=0)
    axes.set_xticks([1, *range(5, steps + 1, 5)])
    _label(axes, ends, steps)


def _label(axes: Axes, ends: list[tuple[float, str]], steps: int) -> None:
    """Write each curve's value at its end, labels kept apart."""
    apart = NEAREST * axes.get_ylim()[1]
    above = -np.inf
    for value, colour in sorted(ends):
        above = max(value, above + apart)
        style: dict[str, Any] = {"color": colour, "va": "center", "fontsize": TEXT}
        axes.annotate(
            f"{value:.0f} mm", (steps, above), (6, 0), textcoords="offset points", **style
        )


def _curve(
    loop: OpenLoop, name: str, rows: np.ndarray, steps: int, disk: int, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    episodes = loop.windows.episodes[rows]
    curve = []
    for step in range(steps):
        said, truth = loop.predictions[name][rows, step], loop.windows.next_scenes[rows, step]
        errors = position_errors(said, truth, disk)
        curve.append(bootstrap_mean(errors, generator(seed, "bootstrap"), episodes))
    mean, low, high = np.array(curve).T
    return mean, low, high
