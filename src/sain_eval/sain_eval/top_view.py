"""The table from above: reach, disks, goal, pushes, and predicted against actual targets."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import (
    Circle,
    FancyArrowPatch,
    FancyBboxPatch,
    Patch,
    Polygon,
    Rectangle,
    Wedge,
)
from matplotlib.patheffects import withStroke

from sain_core.feasibility import Feasibility
from sain_core.push import push_direction, tool_end, tool_start
from sain_core.scene import MID, POSITION, RADIUS, TARGET, THETA, Table, unit
from sain_core.types import Points, Scene
from sain_eval.episodes import EpisodeRecord, PushRecord


@dataclass(frozen=True)
class Palette:
    """The colours of a picture."""

    paper: str = "#ffffff"
    table: str = "#f4f1ea"
    table_edge: str = "#d9d3c5"
    reach: str = "#e6edf2"
    reach_edge: str = "#b4c4d0"
    ink: str = "#2b3036"
    faint: str = "#8a9096"
    mid: str = "#2f6da4"
    target: str = "#e0762f"
    other: str = "#9aa1a8"
    goal: str = "#1f9d61"
    predicted: str = "#7d3fb0"

    def disk(self, index: int) -> str:
        """Return the colour of a disk by its place in the scene."""
        return {MID: self.mid, TARGET: self.target}.get(index, self.other)


PALETTE: Final = Palette()
VIEW_MARGIN: Final = 0.06  # [m]
MAX_BEARING_STEPS: Final = 60
SHOWN_MOVE: Final = 0.01  # [m], a disk that moved less is not drawn again


def draw_top_view(
    axes: Axes, record: EpisodeRecord, feasibility: Feasibility | None = None
) -> None:
    """Draw an episode into axes, x to the right, y up, in metres."""
    feasibility = feasibility or Feasibility()
    _frame(axes, record, feasibility)
    _draw_table(axes, feasibility)
    scenes = record.scenes
    _draw_goal(axes, record)
    for disk in range(len(scenes[0])):
        _draw_trail(axes, record, disk)
    _draw_disks(axes, scenes[0], record.shapes, ghost=True)
    _draw_disks(axes, scenes[-1], record.shapes, ghost=False)
    for push in record.pushes:
        _draw_prediction(axes, push)
    for number, push in enumerate(record.pushes, start=1):
        _draw_push(axes, push, number, feasibility)


def _draw_table(axes: Axes, feasibility: Feasibility) -> None:
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
    base = Circle((0.0, 0.0), 0.055, facecolor="#dfe3e6", edgecolor="#aab0b6", zorder=1)
    axes.add_patch(base)
    axes.text(0.0, 0.0, "arm", ha="center", va="center", fontsize=8, color=PALETTE.faint, zorder=2)


def _visible_part(axes: Axes, table: Table) -> Rectangle:
    """Return the part of the table that is in view, to clip with."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    low = np.maximum([table.x_min, table.y_min], [left, bottom])
    high = np.minimum([table.x_max, table.y_max], [right, top])
    return Rectangle(tuple(low), *(high - low), transform=axes.transData)


def _draw_goal(axes: Axes, record: EpisodeRecord) -> None:
    x, y = record.goal
    axes.add_patch(
        Circle((x, y), record.tolerance, facecolor=PALETTE.goal, alpha=0.16, linewidth=0, zorder=5)
    )
    axes.add_patch(
        Circle(
            (x, y), record.tolerance, fill=False, edgecolor=PALETTE.goal, linewidth=1.6, zorder=9
        )
    )
    axes.plot(x, y, "+", color=PALETTE.goal, markersize=11, markeredgewidth=2.0, zorder=9)


def _outline(scene: Scene, disk: int, shape: str, **style: object) -> Patch:
    centre, radius = scene[disk, POSITION], float(scene[disk, RADIUS])
    if shape != "cube":
        return Circle(tuple(centre), radius, **style)
    corners = scene[disk, THETA] + np.pi / 4 + np.arange(4) * np.pi / 2
    return Polygon(centre + radius * 2**0.5 * unit(corners), closed=True, **style)


def _draw_disks(axes: Axes, scene: Scene, shapes: tuple[str, ...], ghost: bool) -> None:
    for disk in range(len(scene)):
        colour = PALETTE.disk(disk)
        shape = shapes[disk] if shapes else "disk"
        if ghost:
            patch = _outline(
                scene,
                disk,
                shape,
                facecolor="none",
                edgecolor=colour,
                linewidth=1.1,
                linestyle=(0, (3, 2.5)),
                alpha=0.8,
                zorder=3,
            )
        else:
            patch = _outline(
                scene,
                disk,
                shape,
                facecolor=(*_rgb(colour), 0.38),
                edgecolor=colour,
                linewidth=1.8,
                zorder=4,
            )
        axes.add_patch(patch)


def _rgb(colour: str) -> tuple[float, float, float]:
    return tuple(int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))  # type: ignore[return-value]


def _draw_trail(axes: Axes, record: EpisodeRecord, disk: int) -> None:
    """Draw where a disk's centre came to rest, and the disk itself, faintly, in between."""
    scenes = record.scenes
    trail = np.array([scene[disk, POSITION] for scene in scenes])
    colour = PALETTE.disk(disk)
    if np.linalg.norm(np.diff(trail, axis=0), axis=1).sum() < 1e-3:
        return
    axes.plot(*trail.T, color=colour, linewidth=1.8, alpha=0.85, zorder=6, solid_capstyle="round")
    axes.plot(*trail.T, "o", color=colour, markersize=3.8, zorder=6.5)
    shape = record.shapes[disk] if record.shapes else "disk"
    moved = np.linalg.norm(np.diff(trail, axis=0), axis=1) > SHOWN_MOVE
    for scene, shown in zip(scenes[1:-1], moved[:-1], strict=True):
        if shown:
            axes.add_patch(
                _outline(
                    scene,
                    disk,
                    shape,
                    facecolor=(*_rgb(colour), 0.07),
                    edgecolor=(*_rgb(colour), 0.4),
                    linewidth=0.7,
                    zorder=2,
                )
            )


def _draw_prediction(axes: Axes, push: PushRecord) -> None:
    moved = push.after[TARGET, POSITION] - push.before[TARGET, POSITION]
    if push.predicted is None or np.linalg.norm(moved) < SHOWN_MOVE:
        return
    ends = np.stack([push.predicted[TARGET, POSITION], push.after[TARGET, POSITION]])
    axes.plot(*ends.T, color=PALETTE.predicted, linewidth=1.0, zorder=7)
    axes.plot(
        *ends[0],
        "D",
        markersize=5.0,
        markerfacecolor="none",
        markeredgecolor=PALETTE.predicted,
        markeredgewidth=1.1,
        zorder=7,
    )


def _draw_push(axes: Axes, push: PushRecord, number: int, feasibility: Feasibility) -> None:
    start = tool_start(push.before, push.push, feasibility.limits)
    end = tool_end(push.before, push.push, feasibility.limits)
    axes.add_patch(
        FancyArrowPatch(
            tuple(start),
            tuple(end),
            arrowstyle="-|>,head_length=5,head_width=2.6",
            shrinkA=0,
            shrinkB=0,
            linewidth=1.5,
            color=PALETTE.ink,
            zorder=8,
            path_effects=[withStroke(linewidth=3.0, foreground="white", alpha=0.8)],
        )
    )
    badge = start - 0.004 * unit(push_direction(push.push))
    axes.plot(
        *badge,
        "o",
        markersize=12.5,
        color=PALETTE.ink,
        markeredgecolor="white",
        markeredgewidth=1.2,
        zorder=10,
    )
    axes.text(
        *badge,
        str(number),
        ha="center",
        va="center_baseline",
        color="white",
        fontsize=7.5,
        fontweight="bold",
        zorder=11,
    )


def _frame(axes: Axes, record: EpisodeRecord, feasibility: Feasibility) -> None:
    """Show the arm's base and all that happened, filling the axes' own shape."""
    low, high = _extent(record, feasibility)
    box = axes.get_position()
    width, height = axes.figure.get_size_inches() * [box.width, box.height]
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
        np.array([[-0.055, 0.0]]),
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
