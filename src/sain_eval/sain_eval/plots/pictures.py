"""Pictures of plans and episodes: the table from above, how near, how well predicted.

Pure data in, a figure out. The closed loop with and without ROS and the bag tools draw with it.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter

from sain_core.feasibility import Feasibility
from sain_core.goal import Goal
from sain_core.scene import POSITION
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Scalars, Scene
from sain_core.view.figures import TEXT, new_figure, style_axes
from sain_core.view.palette import PALETTE
from sain_core.view.scenes import bodies_in, colours_of, episode_things, extent, plan_things, stage
from sain_eval.episode import EpisodeRecord
from sain_eval.plots.axes import (
    BASE_RADIUS,
    draw_error,
    draw_legend,
    draw_things,
    draw_tolerance,
    frame_view,
)
from sain_mppi.algorithms.sampling import PlanResult

SIZE: Final = (6.6, 7.4)  # [inch]
ASPECT: Final = 1.4  # of the top view
ZOOM: Final = 2.2  # half the width of the view round the goal, in tolerances
LEAST_DISTANCE: Final = 0.1  # [mm], one is drawn no smaller
LEAST_TURN: Final = 1e-3  # [rad], one is drawn no smaller


def draw_episode(
    record: EpisodeRecord, title: str = "", feasibility: Feasibility | None = None
) -> Figure:
    """Draw an episode: top view, distance to the goal, the arrival, prediction errors.

    For headings there are their errors in place of the arrival. Without a title the
    record's own is written; table and reach are the defaults if not given.
    """
    figure = new_figure(*SIZE)
    axes = figure.subplot_mosaic("vvv;dte", height_ratios=(2.7, 1.0))
    heading = describe_task(record, title)
    figure.suptitle(heading, x=0.02, ha="left", fontsize=13, fontweight="bold", color=PALETTE.ink)
    names = draw_top_view(axes["v"], record, feasibility, ASPECT)
    axes["v"].set_title(
        describe_result(record), fontsize=TEXT + 1, loc="left", color=result_colour(record)
    )
    _draw_distance(axes["d"], record)
    if record.goal.has_heading:
        _draw_turn(axes["t"], record)
    else:
        _draw_arrival(axes["t"], record)
    names += _draw_errors(axes["e"], record)
    draw_legend(figure, names, columns=3)
    return figure


def draw_top_view(
    axes: Axes, record: EpisodeRecord, feasibility: Feasibility | None = None, aspect: float = 1.0
) -> list[str]:
    """Draw an episode from above into axes whose width is `aspect` times their height.

    Returns:
        What of `sain_eval.plots.axes.MARKS` was drawn.
    """
    feasibility = feasibility or Feasibility()
    things = episode_things(
        record.start, record.pushes, record.goal, record.bodies, feasibility.limits
    )
    foot = np.array([[-BASE_RADIUS, 0.0]])
    frame_view(axes, np.concatenate([foot, extent(things)]), aspect)
    return draw_things(axes, stage(feasibility) + things)


def draw_plan(
    axes: Axes, scene: Scene, goal: Goal, plan: PlanResult, bodies: Bodies = PAPER_DISKS
) -> list[str]:
    """Draw a plan from a scene (N, 8) towards a goal into axes, in metres.

    Thin lines are where other sequences lead the wanted bodies, from green (cheap) to red
    (expensive); thick ones what the chosen sequence does to the bodies that it moves; faint
    outlines where they should come to rest; the arrow is the first push. Without `bodies` all are
    disks.

    Returns:
        What `draw_legend` explains.
    """
    others = plan.others.predicted[..., POSITION]
    things = plan_things(
        scene, bodies.fitted(len(scene)), goal, plan.pushes, plan.predicted, plan.regions, others
    )
    frame_view(axes, extent(things))
    now = bodies_in(scene, bodies, goal)
    return draw_things(axes, [*stage(), *now, *things])


def describe_result(record: EpisodeRecord) -> str:
    """Return in words how an episode ended."""
    count = len(record.pushes)
    pushes = f"{count} push" if count == 1 else f"{count} pushes"
    left = _millimetres(record.last.distance)
    left += f" and {record.last.turn:.3f} rad" if record.goal.has_heading else ""
    word = "reached" if record.last.reached else "not reached"
    return f"{word} in {pushes}, {left} from the goal"


def _colour(record: EpisodeRecord, body: int) -> str:
    return PALETTE.named(colours_of(record.bodies, record.goal)[body])


def describe_task(record: EpisodeRecord, title: str = "") -> str:
    """Return what an episode is called, and its tolerance."""
    name = title or record.title or "Episode"
    text = f"{name}, tolerance {1e3 * record.goal.tolerance:g} mm"
    if record.goal.has_heading:
        text += f", {record.goal.heading_tolerance:g} rad"
    return text


def _millimetres(distance: float) -> str:
    return f"{1e3 * distance:.1f} mm" if distance < 0.01 else f"{1e3 * distance:.0f} mm"


def result_colour(record: EpisodeRecord) -> str:
    """Return the colour of an episode's result: whether it reached the goal."""
    return PALETTE.success if record.last.reached else PALETTE.alarm


def _draw_distance(axes: Axes, record: EpisodeRecord) -> None:
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


def _draw_turn(axes: Axes, record: EpisodeRecord) -> None:
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
        colour = _colour(record, pose.body)
        axes.plot(line, "o-", color=colour, linewidth=1.8, markersize=4.0)
    axes.set_ylim(min(np.nanmin(shown), tolerance) / 2, max(np.nanmax(shown), tolerance) * 1.8)
    axes.set_xlim(-0.3, max(len(errors) - 1, 1) + 0.3)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))


def _draw_arrival(axes: Axes, record: EpisodeRecord) -> None:
    """Draw where each body came to rest about its place, in millimetres."""
    style_axes(axes, "Bodies at the goal", grid=None, xlabel="x [mm]", ylabel="y [mm]")
    for pose, place in zip(record.goal.poses, record.goal.places, strict=True):
        colour, body = _colour(record, pose.body), pose.body
        draw_tolerance(axes, np.zeros(2), 1e3 * pose.tolerance)
        trail = np.array([1e3 * (scene[body, POSITION] - place) for scene in record.scenes])
        axes.plot(*trail.T, "o-", color=colour, linewidth=1.6, markersize=4.5)
        for push, end in zip(record.pushes, trail[1:], strict=True):
            if push.predicted is not None:
                draw_error(axes, 1e3 * (push.predicted[body, POSITION] - place), end)
    half = ZOOM * 1e3 * record.goal.tolerance
    axes.set(xlim=(-half, half), ylim=(-half, half))
    axes.set_aspect("equal", adjustable="box")


def _draw_errors(axes: Axes, record: EpisodeRecord) -> list[str]:
    """Draw how far from each prediction bodies came to rest; return the series' names."""
    wanted = record.goal.wanted
    what = "of the bodies [mm]" if len(wanted) > 1 else f"of body {wanted[0]} [mm]"
    style_axes(axes, "Prediction error", xlabel="push", ylabel=what)
    pushes, bodies = record.pushes, wanted
    physics = [_error(push.physics, push.after, bodies) for push in pushes]
    planner = [_error(push.predicted, push.after, bodies) for push in pushes]
    series = {
        "predicted by physics": (PALETTE.physics, physics),
        "predicted by the planner": (PALETTE.predicted, planner),
    }
    known = {name: one for name, one in series.items() if any(e is not None for e in one[1])}
    number, width = np.arange(1, len(record.pushes) + 1), 0.76 / max(len(known), 1)
    for place, (name, (colour, errors)) in enumerate(known.items()):
        heights = [np.nan if error is None else 1e3 * error for error in errors]
        left = number + (place - (len(known) - 1) / 2) * width
        axes.bar(left, heights, width, color=colour, label=name)
    axes.set_xlim(0.4, max(len(number), 1) + 0.6)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    return list(known)


def _error(predicted: Scene | None, after: Scene, bodies: Sequence[int]) -> float | None:
    """Return the largest distance [m] of some bodies from their prediction."""
    if predicted is None:
        return None
    off = (predicted - after)[list(bodies), POSITION]
    return float(np.linalg.norm(off, axis=-1).max())
