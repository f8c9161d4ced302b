"""An episode from above: disks, goal, pushes, and predicted against actual targets."""

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrowPatch, Patch, Polygon
from matplotlib.patheffects import withStroke

from sain_core.feasibility import Feasibility
from sain_core.push import push_direction, tool_end, tool_start
from sain_core.push_record import PushRecord
from sain_core.scene import POSITION, RADIUS, TARGET, THETA, unit
from sain_core.types import Scene
from sain_eval.plots.episode_record import EpisodeRecord
from sain_eval.plots.palette import PALETTE
from sain_eval.plots.tabletop import draw_table, frame_view

SHOWN_MOVE: Final = 0.01  # [m], a disk that moved less is not drawn again


def draw_top_view(
    axes: Axes, record: EpisodeRecord, feasibility: Feasibility | None = None
) -> None:
    """Draw an episode into axes, x to the right, y up, in metres."""
    feasibility = feasibility or Feasibility()
    frame_view(axes, record, feasibility)
    draw_table(axes, feasibility)
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


def _outline(scene: Scene, disk: int, shape: str, **style: Any) -> Patch:
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
