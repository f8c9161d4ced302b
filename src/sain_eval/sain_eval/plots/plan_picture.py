"""The picture of a plan from above: the sequence chosen, what else was tried, where it may lead."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from sain_core.drawing.palette import PALETTE
from sain_core.feasibility import Feasibility
from sain_core.push import tool_end, tool_start
from sain_core.scene import MID, POSITION, RADIUS, TARGET
from sain_core.types import Scene
from sain_eval.plots.legend import draw_legend
from sain_eval.plots.top_view import draw_arrow, draw_table, frame_view
from sain_mppi.search.goal import Goal
from sain_mppi.search.result import PlanResult

MARGIN: Final = 0.06  # [m] of a disk about its centre
COSTS: Final = LinearSegmentedColormap.from_list(
    "costs", [PALETTE.goal, PALETTE.learned, PALETTE.alarm]
)


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
    scenes = np.concatenate([scene[None], plan.predicted])
    places = np.concatenate([scenes[:, [MID, TARGET], POSITION].reshape(-1, 2), goal[None]])
    frame_view(axes, np.concatenate([places - MARGIN, places + MARGIN]))
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
    draw_arrow(axes, start, end)
    axes.plot(*goal, "+", color=PALETTE.goal, markersize=13, markeredgewidth=2.4, zorder=9)


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


def draw_plan_legend(figure: Figure, columns: int = 3) -> None:
    """Explain the marks of `draw_plan` along the bottom of a figure."""
    names = ["table", "reachable area", "mid disk", "target", "goal", "push", "90 % region"]
    draw_legend(figure, [*names, "other sequence, cheapest", "other sequence, dearest"], columns)
