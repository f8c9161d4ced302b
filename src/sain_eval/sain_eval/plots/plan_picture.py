"""The picture of a plan from above: the sequence chosen, what else was tried, where it may lead."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.patches import Circle

from sain_core.drawing.palette import PALETTE
from sain_core.feasibility import Feasibility
from sain_core.goal import Goal
from sain_core.push import pushed_bodies, tool_end, tool_start
from sain_core.scene import POSITION, RADIUS
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Points, Scene
from sain_eval.episode import EpisodeRecord
from sain_eval.plots.marks import body_colour, body_names, draw_body, draw_pose
from sain_eval.plots.top_view import draw_arrow, draw_table, frame_view
from sain_mppi.algorithms.result import PlanResult

MOVED: Final = 1e-3  # [m], a body that should move less has no way
COSTS: Final = LinearSegmentedColormap.from_list(
    "costs", [PALETTE.goal, PALETTE.learned, PALETTE.alarm]
)


def draw_plan(
    axes: Axes,
    scene: Scene,
    goal: Goal,
    plan: PlanResult,
    feasibility: Feasibility | None = None,
    bodies: Bodies = PAPER_DISKS,
) -> list[str]:
    """Draw a plan from a scene (N, 8) towards a goal into axes, in metres.

    Thin lines are where other sequences lead the wanted bodies, from green (cheap) to red
    (expensive); thick ones what the chosen sequence does to the bodies that it moves; faint
    outlines where they should come to rest; the arrow is the first push. Without `bodies` all are
    disks.

    Returns:
        What `draw_legend` explains.
    """
    feasibility = feasibility or Feasibility()
    planned = EpisodeRecord(goal, (), scene, bodies)
    followed = _followed(planned, plan)
    frame_view(axes, _extent(planned, plan, followed))
    draw_table(axes, feasibility)
    _draw_others(axes, planned, plan)
    for body in range(len(scene)):
        draw_body(axes, planned, scene, body, 0.4, edge=0.7, linewidth=0.9, zorder=3)
    for body in followed:
        _draw_way(axes, planned, plan, body)
    start = tool_start(scene, plan.push, feasibility.limits, planned.bodies)
    end = tool_end(scene, plan.push, feasibility.limits, planned.bodies)
    draw_arrow(axes, start, end)
    for pose in goal.poses:
        draw_pose(axes, planned, pose)
    return _names(planned, plan)


def _followed(planned: EpisodeRecord, plan: PlanResult) -> tuple[int, ...]:
    """Return the bodies whose paths are drawn: those wanted, pushed or moved."""
    moves = np.linalg.norm(plan.predicted[..., POSITION] - planned.start[:, POSITION], axis=-1)
    moved = np.flatnonzero(moves.max(axis=0, initial=0.0) > MOVED).tolist()
    return tuple(sorted({*planned.goal.wanted, *pushed_bodies(plan.pushes).tolist(), *moved}))


def _extent(planned: EpisodeRecord, plan: PlanResult, followed: Sequence[int]) -> Points:
    """Return points (M, 2) that all have to be in view."""
    scenes = [planned.start, *plan.predicted, planned.goal.placed(planned.start)]
    points = []
    for body in followed:
        size = planned.bodies.shapes[body].circumradius * planned.start[body, RADIUS]
        places = np.array([scene[body, POSITION] for scene in scenes])
        points += [places - size, places + size]
    return np.concatenate(points)


def _draw_others(axes: Axes, planned: EpisodeRecord, plan: PlanResult) -> None:
    count = len(plan.others.costs)
    colours = COSTS(np.linspace(0.0, 1.0, count))
    for body in planned.goal.wanted if count else ():
        ways = plan.others.ways(planned.start, body)
        lines = LineCollection(list(ways[::-1]), colors=colours[::-1], linewidths=0.8, zorder=5)
        axes.add_collection(lines)


def _draw_way(axes: Axes, planned: EpisodeRecord, plan: PlanResult, body: int) -> None:
    """Draw what the plan does to a body, and the region of the first push."""
    for predicted in plan.predicted:
        draw_body(axes, planned, predicted, body, 0.06, edge=0.3, linewidth=0.7, zorder=3.5)
    way, colour = plan.way(planned.start, body), body_colour(planned, body)
    axes.plot(*way.T, "o-", color=colour, linewidth=2.0, markersize=3.5, zorder=6)
    if plan.regions is not None:
        region = Circle(tuple(way[1]), float(plan.regions[0, body]), zorder=7)
        region.set(facecolor="none", edgecolor=PALETTE.predicted, linewidth=1.2)
        axes.add_patch(region)


def _names(planned: EpisodeRecord, plan: PlanResult) -> list[str]:
    names = ["table", "reachable area", *body_names(planned), "push"]
    names += ["90 % region"] * (plan.regions is not None)
    others = ["other sequence, cheapest", "other sequence, dearest"]
    return names + others * bool(len(plan.others.costs))
