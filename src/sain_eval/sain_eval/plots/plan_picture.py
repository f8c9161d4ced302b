"""The picture of a plan from above: the sequence chosen, what else was tried, where it may lead."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Circle

from sain_core.feasibility import Feasibility
from sain_core.push import tool_end, tool_start
from sain_core.scene import MID, POSITION, RADIUS, TARGET
from sain_core.types import Scene
from sain_eval.plots.palette import PALETTE
from sain_eval.plots.tabletop import draw_table
from sain_mppi.search.goal import Goal
from sain_mppi.search.result import PlanResult

MARGIN: Final = 0.12  # [m] of the view round what happens
COSTS: Final = LinearSegmentedColormap.from_list("costs", ["#1f9d61", "#d8b13c", "#b5483a"])


def draw_plan(
    axes: Axes,
    scene: Scene,
    goal: Goal,
    plan: PlanResult,
    feasibility: Feasibility | None = None,
) -> None:
    """Draw a plan from a scene (N, 8) towards a goal (2,) into axes, in metres.

    Thin lines are where other sequences lead the target, from green (cheap) to red (dear); thick
    ones what the chosen sequence does to mid disk and target; faint disks where they should come
    to rest; the arrow is the first push.
    """
    feasibility = feasibility or Feasibility()
    draw_table(axes, feasibility)
    _draw_others(axes, scene, plan)
    for disk in range(len(scene)):
        _draw_disk(axes, scene, disk, alpha=0.4)
    for predicted in plan.predicted:
        for disk in (MID, TARGET):
            _draw_disk(axes, predicted, disk, alpha=0.06)
    for disk in (MID, TARGET):
        way = plan.way(scene, disk)
        axes.plot(*way.T, "o-", color=PALETTE.disk(disk), linewidth=2.0, markersize=3.5, zorder=6)
        if plan.regions is not None:
            region = Circle(tuple(way[1]), float(plan.regions[0, disk]), zorder=7)
            region.set(facecolor="none", edgecolor=PALETTE.predicted, linewidth=1.2)
            axes.add_patch(region)
    start = tool_start(scene, plan.push, feasibility.limits)
    end = tool_end(scene, plan.push, feasibility.limits)
    arrow = {
        "arrowstyle": "-|>",
        "color": PALETTE.ink,
        "linewidth": 1.8,
        "shrinkA": 0,
        "shrinkB": 0,
    }
    axes.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=arrow, zorder=8)
    axes.plot(*goal, "+", color=PALETTE.goal, markersize=13, markeredgewidth=2.4, zorder=9)
    _frame(axes, np.concatenate([scene[None], plan.predicted]), goal)


def _draw_others(axes: Axes, scene: Scene, plan: PlanResult) -> None:
    count = len(plan.others.costs)
    if not count:
        return
    ways = plan.others.ways(scene, TARGET)
    colours = COSTS(np.linspace(0.0, 1.0, count))
    lines = LineCollection(list(ways[::-1]), colors=colours[::-1], linewidths=0.8, zorder=5)
    axes.add_collection(lines)


def _draw_disk(axes: Axes, scene: Scene, disk: int, alpha: float) -> None:
    patch = Circle(tuple(scene[disk, POSITION]), float(scene[disk, RADIUS]), zorder=3)
    patch.set(facecolor=PALETTE.disk(disk), alpha=alpha, linewidth=0)
    axes.add_patch(patch)


def _frame(axes: Axes, scenes: np.ndarray, goal: Goal) -> None:
    """Show the same square of table for all that happens."""
    places = np.concatenate([scenes[:, [MID, TARGET], POSITION].reshape(-1, 2), goal[None]])
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    half = float(np.ptp(places, axis=0).max()) / 2 + MARGIN
    axes.set(xlim=middle[0] + np.array([-half, half]), ylim=middle[1] + np.array([-half, half]))
    axes.set_aspect("equal")
    axes.set_axis_off()
    # Not the titles, which stand outside.
    for artist in (*axes.patches, *axes.lines, *axes.collections, *axes.texts):
        artist.set_clip_on(True)
        artist.set_clip_box(axes.bbox)
