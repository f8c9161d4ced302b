"""The picture of open loops: how errors grow with the number of pushes, for each kind."""

from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sain_core.scene import MID, TARGET
from sain_model.evaluation.metrics import (
    LEARNED,
    MEASURED,
    bootstrap_over_episodes,
    position_errors,
)
from sain_model.evaluation.open_loop import RECURRENT_SAIN, RESIDUAL_SAIN, OpenLoop
from sain_model.evaluation.png import write_png

KINDS: Final = {  # the four of the paper's Fig. 1, with their colours
    MEASURED: ("physics only", "#6b7280"),
    LEARNED: (LEARNED, "#d97706"),
    RESIDUAL_SAIN: ("residual SAIN", "#2563eb"),
    RECURRENT_SAIN: ("recurrent SAIN", "#be185d"),
}
NEAREST: Final = 0.045  # of the axis' height, between two labels


def save_open_loop_plot(path: Path, loop: OpenLoop, seed: int) -> int:
    """Write a PNG of mean errors over steps with 95 % bands; return how many windows it shows.

    All steps are of the same windows: those of the full length, or of the longest there is.
    """
    lengths = loop.windows.known.sum(axis=1)
    steps = int(lengths.max())
    rows = lengths == steps
    figure = Figure(figsize=(12, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for axes, disk, title in ((left, TARGET, "target disk"), (right, MID, "mid disk")):
        _draw(axes, loop, rows, steps, disk, seed)
        axes.set_title(title, loc="left", fontsize=13)
        axes.set_xlabel("pushes predicted without looking", fontsize=12)
    left.set_ylabel("mean position error, mm", fontsize=12)
    episodes = len(np.unique(loop.windows.episodes[rows]))
    figure.suptitle(
        f"Errors of {steps}-push rollouts: {int(rows.sum())} of them, {episodes} episodes held out;"
        " bands: 95 %",
        x=0.01,
        ha="left",
        fontsize=14,
    )
    write_png(path, figure, dots_per_inch=140)
    return int(rows.sum())


def _draw(axes: Axes, loop: OpenLoop, rows: np.ndarray, steps: int, disk: int, seed: int) -> None:
    ends = []
    for name, (label, colour) in KINDS.items():
        if name not in loop.predictions:
            continue
        mean, low, high = _curve(loop, name, rows, steps, disk, seed)
        places = np.arange(1, steps + 1)
        axes.plot(places, mean, color=colour, linewidth=2.4)
        axes.fill_between(places, low, high, color=colour, alpha=0.15, linewidth=0)
        ends.append((mean[-1], label, colour))
    axes.set_xlim(1, 1 + 1.5 * max(steps - 1, 1))
    axes.set_ylim(bottom=0)
    axes.set_xticks([1, *range(5, steps + 1, 5)])
    axes.grid(axis="y", alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    _label(axes, ends, steps)


def _label(axes: Axes, ends: list[tuple[float, str, str]], steps: int) -> None:
    """Write each curve's name at its end, labels kept apart."""
    apart = NEAREST * axes.get_ylim()[1]
    above = -np.inf
    for value, label, colour in sorted(ends):
        above = max(value, above + apart)
        text = f"{label}  {value:.0f}"
        axes.annotate(
            text,
            (steps, above),
            (6, 0),
            textcoords="offset points",
            color=colour,
            va="center",
            fontsize=12,
            in_layout=False,
        )


def _curve(
    loop: OpenLoop, name: str, rows: np.ndarray, steps: int, disk: int, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    episodes = loop.windows.episodes[rows]
    curve = []
    for step in range(steps):
        said, truth = loop.predictions[name][rows, step], loop.windows.next_scenes[rows, step]
        errors = position_errors(said, truth, disk)
        curve.append((errors.mean(), *bootstrap_over_episodes(errors, episodes, seed)))
    mean, low, high = np.array(curve).T
    return mean, low, high
