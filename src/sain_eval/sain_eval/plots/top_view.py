"""An episode from above: bodies, goals, pushes, and predicted against actual places."""

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Wedge
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MultipleLocator

from sain_core.drawing.figures import style_axes
from sain_core.drawing.palette import PALETTE
from sain_core.feasibility import Feasibility
from sain_core.push import LENGTH, strokes
from sain_core.scene import POSITION, RADIUS, THETA, unit, wrap_angle
from sain_core.types import Points, Scene
from sain_core.world import PushRecord
from sain_eval.episode import EpisodeRecord
from sain_eval.plots.marks import (
    body_colour,
    body_names,
    draw_body,
    draw_error,
    draw_ghost,
    draw_heading,
    draw_pose,
)

SHOWN_MOVE: Final = 0.01  # [m], a disk that moved less is not drawn again
SHOWN_TURN: Final = 0.1  # [rad], a body that moved and turned less has no ghost
GHOST_OFF: Final = 0.003  # [m], one that was predicted nearer and straighter has none either
GHOST_TURN: Final = 0.03  # [rad]
SHOWN_TRAIL: Final = 1e-3  # [m], a disk that moved less has no trail
VIEW_MARGIN: Final = 0.06  # [m]
BASE_RADIUS: Final = 0.055  # [m], of the arm's foot as drawn
TICK: Final = 0.2  # [m]
DOTTED: Final = (0, (1, 1.3))  # outlines at the start; those at the goal are dashed


def draw_top_view(
    axes: Axes,
    record: EpisodeRecord,
    feasibility: Feasibility | None = None,
    aspect: float = 1.0,
) -> list[str]:
    """Draw an episode into axes whose width is `aspect` times their height.

    Returns:
        What of `sain_eval.plots.marks.MARKS` was drawn.
    """
    feasibility = feasibility or Feasibility()
    frame_view(axes, _extent(record, feasibility), aspect)
    draw_table(axes, feasibility)
    scenes = record.scenes
    for disk in range(len(scenes[0])):
        _draw_trail(axes, record, disk)
        start = {"linestyle": DOTTED, "linewidth": 1.1, "edge": 0.8}
        draw_body(axes, record, scenes[0], disk, 0.0, zorder=3, **start)
        draw_body(axes, record, scenes[-1], disk, 0.38, zorder=4, linewidth=1.8)
    _draw_goals(axes, record)
    for push in record.pushes:
        _draw_prediction(axes, record, push)
    for number, push in enumerate(record.pushes, start=1):
        _draw_push(axes, record, push, number, feasibility)
    names = ["table", "reachable area", "start", *body_names(record)]
    names += ["push"] if record.pushes else []
    predicted = any(push.predicted is not None for push in record.pushes)
    return names + ["predicted by the planner"] * predicted


def _draw_goals(axes: Axes, record: EpisodeRecord) -> None:
    """Draw the goal, and marks of the headings where they count."""
    for pose in record.goal.poses:
        draw_pose(axes, record, pose)
        if pose.heading is not None:
            shape, colour = record.bodies.shapes[pose.body], body_colour(record, pose.body)
            draw_heading(axes, record.scenes[-1][pose.body], shape, colour, zorder=6)


def _extent(record: EpisodeRecord, feasibility: Feasibility) -> Points:
    """Return points (M, 2) that all have to be in view."""
    points = [np.array([[-BASE_RADIUS, 0.0]])]
    scenes = (*record.scenes, record.goal.placed(record.start))
    ratios = np.array([shape.circumradius for shape in record.bodies.shapes])
    for scene in scenes:
        radius = (ratios * scene[:, RADIUS])[:, None]
        points += [scene[:, POSITION] - radius, scene[:, POSITION] + radius]
    for push in record.pushes:
        start = strokes(push.before, push.push, feasibility.limits, record.bodies)[0]
        points.append(start[None])
    return np.concatenate(points)


def _draw_trail(axes: Axes, record: EpisodeRecord, disk: int) -> None:
    """Draw where a disk's centre came to rest, and the disk itself, faintly, in between."""
    scenes = record.scenes
    trail = np.array([scene[disk, POSITION] for scene in scenes])
    moves = np.linalg.norm(np.diff(trail, axis=0), axis=1)
    if moves.sum() < SHOWN_TRAIL:
        return
    colour = body_colour(record, disk)
    axes.plot(*trail.T, color=colour, linewidth=1.8, alpha=0.85, zorder=6, solid_capstyle="round")
    axes.plot(*trail.T, "o", color=colour, markersize=3.8, zorder=6.5)
    for scene, move in zip(scenes[1:-1], moves[:-1], strict=True):
        if move > SHOWN_MOVE:
            draw_body(axes, record, scene, disk, 0.07, edge=0.4, linewidth=0.7, zorder=2)


def _draw_prediction(axes: Axes, record: EpisodeRecord, push: PushRecord) -> None:
    """Draw where bodies were expected that moved; in outline where that was visibly elsewhere."""
    if push.predicted is None:
        return
    for body in record.goal.wanted:
        straight = record.bodies.shapes[body].is_round  # a disk's heading shows nowhere
        moved = _difference(push.before, push.after, body)
        if moved[0] < SHOWN_MOVE and (straight or moved[1] < SHOWN_TURN):
            continue
        draw_error(axes, push.predicted[body, POSITION], push.after[body, POSITION])
        off = _difference(push.predicted, push.after, body)
        if not straight and (off[0] > GHOST_OFF or off[1] > GHOST_TURN):
            draw_ghost(axes, push.predicted, record, body)


def _difference(first: Scene, second: Scene, body: int) -> tuple[float, float]:
    """Return by how much the poses of a body differ in two scenes: distance [m] and turn [rad]."""
    apart = np.linalg.norm(first[body, POSITION] - second[body, POSITION])
    turn = wrap_angle(first[body, THETA] - second[body, THETA])
    return float(apart), abs(float(turn))


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


def _draw_push(
    axes: Axes, record: EpisodeRecord, push: PushRecord, number: int, feasibility: Feasibility
) -> None:
    start, heading = strokes(push.before, push.push, feasibility.limits, record.bodies)
    draw_arrow(axes, start, start + push.push[LENGTH] * unit(heading))
    badge = start - 0.004 * unit(heading)
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
