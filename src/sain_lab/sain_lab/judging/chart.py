"""The chart of a laboratory: errors and parameters against the number of pushes, and events."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sain_core.view.figures import TEXT, new_figure, style_axes
from sain_core.view.palette import PALETTE
from sain_lab.judging.curves import SERVICE, WINDOW, Curves, running
from sain_lab.storage.laboratory import PHYSICS, PLANAR
from sain_lab.storage.log import DROPPED, JUMPED, LOADED
from sain_model.physics.parameters import BY_NAME

LINES: Final = {
    PLANAR: ("planar", PALETTE.physics),
    PHYSICS: ("physics, as believed", PALETTE.goal),
    SERVICE: ("in service", PALETTE.predicted),
}
MARKS: Final = {
    LOADED: PALETTE.predicted,
    DROPPED: PALETTE.alarm,
    JUMPED: PALETTE.ink,
}
MOST_PARAMETERS: Final = 6  # those that grew sharpest


def draw_curves(curves: Curves, title: str = "") -> Figure:
    """Return the chart: errors with 95 % intervals above, spreads of parameters below."""
    figure = new_figure(6.5, 5.6)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    _draw_errors(above, curves, title)
    _draw_parameters(below, curves)
    for axes in (above, below):
        axes.set_xlim(0, max(curves.pushes, 1))
    return figure


def _draw_errors(axes: Axes, curves: Curves, title: str) -> None:
    style_axes(axes, title, ylabel=f"error of the next push [mm], mean of {WINDOW}")
    count = np.arange(1, curves.pushes + 1)
    top = 0.0
    for name, (label, colour) in LINES.items():
        mean, half = running(curves.errors[name])
        axes.plot(count, mean, color=colour, label=label, linewidth=1.4)
        axes.fill_between(count, mean - half, mean + half, color=colour, alpha=0.15, linewidth=0)
        top = max(top, float(np.nanmax(mean, initial=0.0)))
    axes.set_ylim(0.0, 1.25 * top or 1.0)
    for kind, colour in MARKS.items():
        places = [one.pushes for one in curves.events if one.kind == kind]
        for number, place in enumerate(places):
            label = "_nolegend_" if number else kind
            axes.axvline(place, color=colour, linewidth=0.9, linestyle=":", label=label)
    axes.legend(frameon=False, fontsize=TEXT - 1, ncols=3, loc="upper right")


def _draw_parameters(axes: Axes, curves: Curves) -> None:
    style_axes(axes, xlabel="pushes learned from", ylabel="spread, share of that before")
    shares = {
        name: values[:, 2] / BY_NAME[name].spread for name, values in curves.parameters.items()
    }
    sharpest = sorted(shares, key=lambda name: shares[name][-1])[:MOST_PARAMETERS]
    colours = (PALETTE.physics, PALETTE.predicted, PALETTE.goal, PALETTE.alarm, PALETTE.mid)
    for name, colour in zip(sharpest, (*colours, PALETTE.soft), strict=False):
        pushes = np.concatenate([[0.0], curves.parameters[name][:, 0], [curves.pushes]])
        spread = np.concatenate([[1.0], shares[name], shares[name][-1:]])
        axes.step(pushes, spread, where="post", color=colour, label=name, linewidth=1.2)
    axes.set_ylim(0.0, 1.1)
    if sharpest:
        axes.legend(frameon=False, fontsize=TEXT - 1, ncols=2, loc="upper right")
