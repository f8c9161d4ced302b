"""Pictures of episodes: the table from above, how near, how well predicted; or all of a run.

Pure data in, a figure out. The closed loop with and without ROS and the bag tools all draw with it.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from sain_core.drawing.figures import TEXT, new_figure, style_axes
from sain_core.drawing.palette import PALETTE
from sain_core.feasibility import Feasibility
from sain_core.scene import POSITION
from sain_core.types import Scene
from sain_eval.episode import EpisodeRecord
from sain_eval.plots.body_marks import body_colour, draw_error, draw_tolerance
from sain_eval.plots.legend import draw_legend
from sain_eval.plots.pose_panels import draw_pose_distance, draw_pose_turn
from sain_eval.plots.top_view import draw_top_view

SIZE: Final = (6.6, 7.4)  # [inch]
ASPECT: Final = 1.4  # of the top view
ZOOM: Final = 2.2  # half the width of the view round the goal, in tolerances
COLUMNS: Final = 2  # of an overview
TILE: Final = (3.5, 3.5)  # [inch], of an episode in it
LEGEND: Final = 0.8  # [inch]


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
    draw_pose_distance(axes["d"], record)
    if record.goal.has_heading:
        draw_pose_turn(axes["t"], record)
    else:
        _draw_arrival(axes["t"], record)
    names += _draw_errors(axes["e"], record)
    draw_legend(figure, names, columns=3)
    return figure


def describe_result(record: EpisodeRecord) -> str:
    """Return in words how an episode ended."""
    count = len(record.pushes)
    pushes = f"{count} push" if count == 1 else f"{count} pushes"
    left = _millimetres(record.last.distance)
    left += f" and {record.last.turn:.3f} rad" if record.goal.has_heading else ""
    word = "reached" if record.last.reached else "not reached"
    return f"{word} in {pushes}, {left} from the goal"


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


def _draw_arrival(axes: Axes, record: EpisodeRecord) -> None:
    """Draw where each body came to rest about its place, in millimetres."""
    style_axes(axes, "Bodies at the goal", grid=None, xlabel="x [mm]", ylabel="y [mm]")
    for pose, place in zip(record.goal.poses, record.goal.places, strict=True):
        colour, body = body_colour(record, pose.body), pose.body
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


def draw_overview(records: Sequence[EpisodeRecord]) -> Figure:
    """Draw all episodes of a run into one figure."""
    columns = min(COLUMNS, len(records))
    rows = -(-len(records) // columns)
    figure = new_figure(columns * TILE[0], rows * TILE[1] + LEGEND)
    names: set[str] = set()
    for place, record in enumerate(records, start=1):
        axes = figure.add_subplot(rows, columns, place)
        names.update(draw_top_view(axes, record))
        axes.set_title(" \n ", fontsize=TEXT)  # space for the two lines below
        _write(
            axes,
            describe_task(record),
            17,
            fontsize=TEXT + 0.5,
            fontweight="bold",
            color=PALETTE.ink,
        )
        _write(axes, describe_result(record), 5, fontsize=TEXT, color=result_colour(record))
    draw_legend(figure, sorted(names), columns=columns + 1)
    return figure


def _write(axes: Axes, text: str, above: float, **style: Any) -> None:
    """Write a line so many points above axes, from the left edge of their labels on."""
    style |= {"xycoords": "axes fraction", "textcoords": "offset points"}
    axes.annotate(text, (0.0, 1.0), (-32, above), **style)
