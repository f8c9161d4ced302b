"""An episode from above: disks, goal, pushes, and predicted against actual targets."""

from typing import Any, Final

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Patch, Polygon, Wedge
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MultipleLocator
from numpy import ndarray

from sain_core.drawing.figures import style_axes
from sain_core.drawing.palette import PALETTE, rgba
from sain_core.feasibility import Feasibility
from sain_core.push import push_direction, tool_end, tool_start
from sain_core.push_record import PushRecord
from sain_core.scene import POSITION, RADIUS, TARGET, unit
from sain_core.shapes.disk import DISK
from sain_core.shapes.registry import get_shape
from sain_core.shapes.shape import Shape
from sain_core.types import Points, Scene
from sain_eval.plots.episode_record import EpisodeRecord

SHOWN_MOVE: Final = 0.01  # [m], a disk that moved less is not drawn again
SHOWN_TRAIL: Final = 1e-3  # [m], a disk that moved less has no trail
VIEW_MARGIN: Final = 0.06  # [m]
BASE_RADIUS: Final = 0.055  # [m], of the arm's foot as drawn
TICK: Final = 0.2  # [m]


def draw_top_view(
    axes: Axes,
    record: EpisodeRecord,
    feasibility: Feasibility | None = None,
    aspect: float = 1.0,
) -> list[str]:
    """Draw an episode into axes whose width is `aspect` times their height.

    Returns:
        What of `sain_eval.legend.MARKS` was drawn.
    """
    feasibility = feasibility or Feasibility()
    frame_view(axes, _extent(record, feasibility), aspect)
    draw_table(axes, feasibility)
    draw_goal(axes, record.goal, record.tolerance)
    scenes = record.scenes
    for disk in range(len(scenes[0])):
        _draw_trail(axes, record, disk)
        start = {"linestyle": (0, (3, 2.5)), "linewidth": 1.1, "edge": 0.8}
        _draw_disk(axes, record, scenes[0], disk, 0.0, zorder=3, **start)
        _draw_disk(axes, record, scenes[-1], disk, 0.38, zorder=4, linewidth=1.8)
    for push in record.pushes:
        _draw_prediction(axes, push)
    for number, push in enumerate(record.pushes, start=1):
        _draw_push(axes, push, number, feasibility)
    names = ["table", "reachable area", "mid disk", "target", "start", "goal and tolerance"]
    names += ["other disk"] if len(scenes[0]) > 2 else []
    names += ["push"] if record.pushes else []
    predicted = any(push.predicted is not None for push in record.pushes)
    return names + ["predicted by the planner"] * predicted


def _extent(record: EpisodeRecord, feasibility: Feasibility) -> Points:
    """Return points (M, 2) that all have to be in view."""
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
    return np.concatenate(points)


def draw_goal(axes: Axes, place: Points, tolerance: float, size: float = 11.0) -> None:
    """Draw a goal (2,) with its tolerance, in the units of the axes."""
    face, edge = rgba(PALETTE.goal, 0.16), PALETTE.goal
    axes.add_patch(Circle(tuple(place), tolerance, facecolor=face, linewidth=0, zorder=5))
    axes.add_patch(
        Circle(tuple(place), tolerance, fill=False, edgecolor=edge, linewidth=1.6, zorder=9)
    )
    axes.plot(*place, "+", color=edge, markersize=size, markeredgewidth=2.0, zorder=9)


def _outline(state: Float[ndarray, "8"], shape: Shape, **style: Any) -> Patch:
    if shape.is_round:
        return Circle(tuple(state[POSITION]), float(state[RADIUS]), **style)
    return Polygon(shape.placed(state), closed=True, **style)


def _draw_disk(
    axes: Axes, record: EpisodeRecord, scene: Scene, disk: int, face: float, **style: Any
) -> None:
    """Draw one disk of a scene; `face` is the opacity of its inside, `edge` that of its rim."""
    shape = get_shape(record.shapes[disk] if record.shapes else DISK)
    colour = PALETTE.disk(disk)
    edge = rgba(colour, style.pop("edge", 1.0))
    axes.add_patch(
        _outline(scene[disk], shape, facecolor=rgba(colour, face), edgecolor=edge, **style)
    )


def _draw_trail(axes: Axes, record: EpisodeRecord, disk: int) -> None:
    """Draw where a disk's centre came to rest, and the disk itself, faintly, in between."""
    scenes = record.scenes
    trail = np.array([scene[disk, POSITION] for scene in scenes])
    moves = np.linalg.norm(np.diff(trail, axis=0), axis=1)
    if moves.sum() < SHOWN_TRAIL:
        return
    colour = PALETTE.disk(disk)
    axes.plot(*trail.T, color=colour, linewidth=1.8, alpha=0.85, zorder=6, solid_capstyle="round")
    axes.plot(*trail.T, "o", color=colour, markersize=3.8, zorder=6.5)
    for scene, move in zip(scenes[1:-1], moves[:-1], strict=True):
        if move > SHOWN_MOVE:
            _draw_disk(axes, record, scene, disk, 0.07, edge=0.4, linewidth=0.7, zorder=2)


def _draw_prediction(axes: Axes, push: PushRecord) -> None:
    moved = push.after[TARGET, POSITION] - push.before[TARGET, POSITION]
    if push.predicted is not None and np.linalg.norm(moved) >= SHOWN_MOVE:
        draw_error(axes, push.predicted[TARGET, POSITION], push.after[TARGET, POSITION])


def draw_error(axes: Axes, predicted: Points, actual: Points) -> None:
    """Draw a predicted place (2,), with a line to where the target came to rest (2,)."""
    axes.plot(*np.stack([predicted, actual]).T, color=PALETTE.predicted, linewidth=1.0, zorder=7)
    mark: dict[str, Any] = {"markerfacecolor": "none", "markeredgecolor": PALETTE.predicted}
    axes.plot(*predicted, "D", markersize=5.0, markeredgewidth=1.2, zorder=7, **mark)


def draw_arrow(axes: Axes, start: Points, end: Points) -> None:
    """Draw the tool's way from start (2,) to end (2,)."""
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


def _draw_push(axes: Axes, push: PushRecord, number: int, feasibility: Feasibility) -> None:
    start = tool_start(push.before, push.push, feasibility.limits)
    draw_arrow(axes, start, tool_end(push.before, push.push, feasibility.limits))
    badge = start - 0.004 * unit(push_direction(push.push))
    edge: dict[str, Any] = {"markeredgecolor": "white", "markeredgewidth": 1.2}
    axes.plot(*badge, "o", markersize=12.5, color=PALETTE.ink, zorder=10, **edge)
    axes.text(
        float(badge[0]),
        float(badge[1]),
        str(number),
        ha="center",
        va="center_baseline",
        color="white",
        fontsize=7.5,
        fontweight="bold",
        zorder=11,
    )


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
