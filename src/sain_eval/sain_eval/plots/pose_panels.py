"""How far bodies were from their poses after each push: places and headings."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator, NullFormatter

from sain_core.drawing.figures import style_axes
from sain_core.drawing.palette import PALETTE
from sain_core.types import Scalars
from sain_eval.episode import EpisodeRecord
from sain_eval.plots.body_marks import body_colour

LEAST_DISTANCE: Final = 0.1  # [mm], one is drawn no smaller
LEAST_TURN: Final = 1e-3  # [rad], one is drawn no smaller


def draw_pose_distance(axes: Axes, record: EpisodeRecord) -> None:
    """Draw the distance of each body to its pose after each push, over the tolerance."""
    style_axes(axes, "Bodies to poses", grid=None, xlabel="pushes", ylabel="distance [mm]")
    goal = record.goal
    _draw_lines(
        axes,
        record,
        1e3 * goal.errors(np.stack(record.scenes), record.bodies)[0],
        1e3 * goal.tolerance,
        LEAST_DISTANCE,
    )


def draw_pose_turn(axes: Axes, record: EpisodeRecord) -> None:
    """Draw the turn of each body to its heading after each push, over the tolerance."""
    style_axes(axes, "Headings", grid=None, xlabel="pushes", ylabel="turn [rad]")
    goal = record.goal
    turns = np.abs(goal.errors(np.stack(record.scenes), record.bodies)[1])
    turns[:, [pose.heading is None for pose in goal.poses]] = np.nan
    _draw_lines(axes, record, turns, goal.heading_tolerance, LEAST_TURN)


def _draw_lines(
    axes: Axes, record: EpisodeRecord, errors: Scalars, tolerance: float, least: float
) -> None:
    """Draw errors (pushes + 1, P) as a line for each pose, on a logarithmic scale."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())  # it labels ticks where a decade is not full
    axes.axhspan(1e-9, tolerance, color=PALETTE.goal, alpha=0.13, linewidth=0)
    axes.axhline(tolerance, color=PALETTE.goal, linewidth=1.2)
    shown = np.maximum(errors, least)
    for pose, line in zip(record.goal.poses, shown.T, strict=True):
        colour = body_colour(record, pose.body)
        axes.plot(line, "o-", color=colour, linewidth=1.8, markersize=4.0)
    axes.set_ylim(min(np.nanmin(shown), tolerance) / 2, max(np.nanmax(shown), tolerance) * 1.8)
    axes.set_xlim(-0.3, max(len(errors) - 1, 1) + 0.3)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
