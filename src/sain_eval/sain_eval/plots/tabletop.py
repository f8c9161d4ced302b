"""What every picture from above stands on: the view, the table, the arm and its reach."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyBboxPatch, Rectangle, Wedge

from sain_core.feasibility import Feasibility
from sain_core.push import tool_start
from sain_core.scene import POSITION, RADIUS, Table, unit
from sain_core.types import Points
from sain_eval.plots.episode_record import EpisodeRecord
from sain_eval.plots.palette import PALETTE

VIEW_MARGIN: Final = 0.06  # [m]
BASE_RADIUS: Final = 0.055  # [m], of the arm's foot as drawn
MAX_BEARING_STEPS: Final = 60


def frame_view(axes: Axes, record: EpisodeRecord, feasibility: Feasibility) -> None:
    """Show the arm's base and all that happened, filling the axes' own shape."""
    low, high = _extent(record, feasibility)
    box = axes.get_position()
    figure = axes.get_figure(root=True)
    assert figure is not None
    width, height = figure.get_size_inches() * [box.width, box.height]
    centre, size = (low + high) / 2, high - low + 2 * VIEW_MARGIN
    half = max(size[0] / width, size[1] / height) * np.array([width, height]) / 2
    axes.set(
        xlim=(centre[0] - half[0], centre[0] + half[0]),
        ylim=(centre[1] - half[1], centre[1] + half[1]),
        aspect="equal",
        xticks=[],
        yticks=[],
    )
    for spine in axes.spines.values():
        spine.set_visible(False)
    corner = centre - half + [0.02, 0.02]
    axes.plot(
        [corner[0], corner[0] + 0.1],
        [corner[1]] * 2,
        color=PALETTE.ink,
        linewidth=2.5,
        solid_capstyle="butt",
        zorder=12,
    )
    axes.text(
        corner[0] + 0.05,
        corner[1] + 0.008,
        "10 cm",
        ha="center",
        va="bottom",
        fontsize=8,
        color=PALETTE.ink,
        zorder=12,
    )


def _extent(record: EpisodeRecord, feasibility: Feasibility) -> tuple[Points, Points]:
    points = [
        np.array([[-BASE_RADIUS, 0.0]]),
        record.goal[None] - record.tolerance,
        record.goal[None] + record.tolerance,
    ]
    for scene in record.scenes:
        radius = scene[:, RADIUS, None]
        points += [scene[:, POSITION] - radius, scene[:, POSITION] + radius]
    for push in record.pushes:
        points.append(tool_start(push.before, push.push, feasibility.limits)[None])
    every = np.concatenate(points)
    return every.min(axis=0), every.max(axis=0)


def draw_table(axes: Axes, feasibility: Feasibility) -> None:
    """Draw the table with the part that the tool reaches, and the arm's foot."""
    table, reach = feasibility.table, feasibility.reach
    size = (table.x_max - table.x_min, table.y_max - table.y_min)
    top = FancyBboxPatch(
        (table.x_min, table.y_min),
        *size,
        boxstyle="round,pad=0,rounding_size=0.015",
        facecolor=PALETTE.table,
        edgecolor=PALETTE.table_edge,
        linewidth=1.5,
        zorder=0,
    )
    axes.add_patch(top)
    half = np.degrees(reach.max_bearing)
    ring = Wedge(
        (0.0, 0.0),
        reach.outer,
        -half,
        half,
        width=reach.outer - reach.inner,
        facecolor=PALETTE.reach,
        edgecolor="none",
        zorder=0.5,
        alpha=0.75,
    )
    axes.add_patch(ring)
    bearing = np.linspace(-reach.max_bearing, reach.max_bearing, MAX_BEARING_STEPS)
    lines = [
        axes.plot(
            *(radius * unit(bearing).T),
            color=PALETTE.reach_edge,
            linewidth=0.9,
            linestyle=(0, (5, 4)),
            zorder=0.6,
        )[0]
        for radius in (reach.inner, reach.outer)
    ]
    visible = _visible_part(axes, table)
    for artist in (ring, *lines):
        artist.set_clip_path(visible)
    base = Circle((0.0, 0.0), BASE_RADIUS, facecolor="#dfe3e6", edgecolor="#aab0b6", zorder=1)
    axes.add_patch(base)
    axes.text(0.0, 0.0, "arm", ha="center", va="center", fontsize=8, color=PALETTE.faint, zorder=2)


def _visible_part(axes: Axes, table: Table) -> Rectangle:
    """Return the part of the table that is in view, to clip with."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    low = np.maximum([table.x_min, table.y_min], [left, bottom])
    high = np.minimum([table.x_max, table.y_max], [right, top])
    return Rectangle(tuple(low), *(high - low), transform=axes.transData)
