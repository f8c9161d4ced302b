"""The picture of rollouts: how errors grow with the number of pushes, for each kind of model."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sain_core.randomness import Interval, bootstrap_mean, generator
from sain_core.scene import MID, TARGET
from sain_core.view.figures import TEXT, new_figure, style_axes, write_png
from sain_core.view.palette import PALETTE
from sain_model.evaluation.errors import position_errors
from sain_model.evaluation.predictors import (
    LEARNED,
    MEASURED,
    RECURRENT_SAIN,
    SAIN,
    Predictions,
)

KINDS: Final = {  # the four of the paper's Fig. 1, with their colours
    MEASURED: ("physics only", PALETTE.physics),
    LEARNED: (LEARNED, PALETTE.learned),
    SAIN: ("residual SAIN", PALETTE.predicted),
    RECURRENT_SAIN: ("recurrent SAIN", PALETTE.history),
}
NEAREST: Final = 0.07  # of the axis' height, between two labels


def save_rollout_plot(path: Path, predictions: Sequence[Predictions], seed: int) -> None:
    """Write a PNG of mean errors over steps with 95 % bands, of scenes with a target.

    All steps are of the same windows: those of the full length, or of the longest there is.
    """
    shown = [one for one in predictions if one.part.disks > TARGET]
    if shown:
        write_png(draw_rollouts(shown, seed), path)


def draw_rollouts(predictions: Sequence[Predictions], seed: int) -> Figure:
    """Draw the errors after each step of the longest windows."""
    lengths = [one.windows.known.sum(axis=1) for one in predictions]
    steps = max(int(length.max()) for length in lengths)
    masks = [length == steps for length in lengths]
    figure = new_figure(6.6, 6.6)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, body, title in zip(panels, (TARGET, MID), ("target", "body 0"), strict=True):
        style_axes(axes, title, ylabel="mean position error [mm]")
        curves = {
            label: (_curve(predictions, masks, name, steps, body, seed), colour)
            for name, (label, colour) in KINDS.items()
            if all(name in one.by_name for one in predictions)
        }
        _draw(axes, curves, steps)
    panels[1].set_xlabel("pushes predicted from the first scene alone", fontsize=TEXT)
    episodes = [one.windows.episodes[rows] for one, rows in zip(predictions, masks, strict=True)]
    joined = np.concatenate(episodes)
    count = f"{len(joined)} rollouts of {steps} pushes, {len(np.unique(joined))} held-out episodes"
    figure.suptitle(f"{count}; bands: 95 %", x=0.02, ha="left", fontsize=TEXT + 1.5)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, frameon=False, loc="outside lower center", ncols=4, fontsize=TEXT
    )
    return figure


def _draw(axes: Axes, curves: dict[str, tuple[list[Interval], str]], steps: int) -> None:
    ends = []
    places = np.arange(1, steps + 1)
    for label, (curve, colour) in curves.items():
        mean, low, high = np.array(curve).T
        axes.plot(places, mean, color=colour, linewidth=2.2, label=label)
        axes.fill_between(places, low, high, color=colour, alpha=0.15, linewidth=0)
        ends.append((float(mean[-1]), colour))
    axes.set_xlim(1, 1 + 1.1 * max(steps - 1, 1))
    axes.set_ylim(bottom=0)
    axes.set_xticks([1, *range(5, steps + 1, 5)])
    apart, above = NEAREST * axes.get_ylim()[1], -np.inf
    for value, colour in sorted(ends):  # each curve's value at its end, labels kept apart
        above = max(value, above + apart)
        style: dict[str, Any] = {"color": colour, "va": "center", "fontsize": TEXT}
        axes.annotate(
            f"{value:.0f} mm", (steps, above), (6, 0), textcoords="offset points", **style
        )


def _curve(
    predictions: Sequence[Predictions],
    masks: Sequence[np.ndarray],
    name: str,
    steps: int,
    body: int,
    seed: int,
) -> list[Interval]:
    curve, shown = [], list(zip(predictions, masks, strict=True))
    episodes = np.concatenate([one.windows.episodes[rows] for one, rows in shown])
    for step in range(steps):
        errors = [
            position_errors(
                one.by_name[name][rows, step], one.windows.next_scenes[rows, step], body
            )
            for one, rows in shown
        ]
        random = generator(seed, "bootstrap")
        curve.append(bootstrap_mean(np.concatenate(errors), random, episodes))
    return curve
