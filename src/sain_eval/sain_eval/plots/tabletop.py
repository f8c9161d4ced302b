"""What every picture from above stands on: the view in metres, the table, the arm and its reach."""

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyBboxPatch, Wedge
from matplotlib.ticker import MultipleLocator

from sain_core.drawing.figures import style_axes
from sain_core.drawing.palette import PALETTE
from sain_core.feasibility import Feasibility
from sain_core.types import Points

VIEW_MARGIN: Final = 0.06  # [m]
BASE_RADIUS: Final = 0.055  # [m], of the arm's foot as drawn
TICK: Final = 0.2  # [m]


def frame_view(axes: Axes, points: Points, aspect: float = 1.0) -> None:
    """Show a part of the world, x to the right and y up, in metres, that holds all points (M, 2).

    Its width is `aspect` times its height.
    """
    low, high = points.min(axis=0) - VIEW_MARGIN, points.max(axis=0) + VIEW_MARGIN
    shape = np.array([aspect, 1.0])
    centre, half = (low + high) / 2, shape * ((high - low) / shape).max() / 2
    (left, bottom), (right, top) = centre - half, centre + half
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
    style_axes(axes, grid=None, xlabel="x [m]", ylabel="y [m]")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(TICK))


def draw_table(axes: Axes, feasibility: Feasibility) -> None:
    """Draw the table with the part that the tool reaches, and the arm's foot."""
    table, reach = feasibility.table, feasibility.reach
    top = FancyBboxPatch(
        (table.x_min, table.y_min),
        table.x_max - table.x_min,
        table.y_max - table.y_min,
        boxstyle="round,pad=0,rounding_size=0.015",
        facecolor=PALETTE.table,
        edgecolor=PALETTE.table_edge,
        linewidth=1.5,
        zorder=0,
    )
    half = np.degrees(reach.max_bearing)
    ring = Wedge(
        (0.0, 0.0),
        reach.outer,
        -half,
        half,
        width=reach.outer - reach.inner,
        facecolor=PALETTE.reach,
        edgecolor=PALETTE.reach_edge,
        linewidth=0.9,
        linestyle=(0, (5, 4)),
        zorder=0.5,
    )
    base = Circle(
        (0.0, 0.0), BASE_RADIUS, facecolor=PALETTE.line, edgecolor=PALETTE.other, zorder=1
    )
    for patch in (top, ring, base):
        axes.add_patch(patch)
    ring.set_clip_path(top)
    style: dict[str, Any] = {"fontsize": 8, "color": PALETTE.soft, "clip_on": True}
    axes.text(0.0, 0.0, "arm", zorder=2, ha="center", va="center", **style)
