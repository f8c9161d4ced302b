"""The picture of an episode: the table from above, and beside it how near and how well predicted.

Pure data in, a figure out. The closed loop with and without ROS and the bag tools all draw with it.
"""

from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from sain_core.feasibility import Feasibility
from sain_core.push_record import PushRecord
from sain_core.scene import POSITION, TARGET, target_distance
from sain_core.storage import write_whole
from sain_eval.plots.episode_record import EpisodeRecord
from sain_eval.plots.legend import draw_legend
from sain_eval.plots.palette import PALETTE
from sain_eval.plots.top_view import draw_top_view

FIGURE_SIZE = (11.0, 6.8)  # [inch]
DOTS_PER_INCH = 160
ZOOM = 2.2  # half the width of the view round the goal, in tolerances


def draw_episode(
    record: EpisodeRecord, title: str = "", feasibility: Feasibility | None = None
) -> Figure:
    """Draw an episode: top view, distance to the goal, the arrival, prediction errors.

    Args:
        record: the episode.
        title: one line; without it the record's own, or its result in words.
        feasibility: table, reach and tool to draw; the project's defaults if not given.
    """
    figure = Figure(figsize=FIGURE_SIZE, facecolor=PALETTE.paper)
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(
        3,
        2,
        width_ratios=(2.0, 1.0),
        height_ratios=(1.0, 1.3, 0.9),
        left=0.02,
        right=0.975,
        top=0.90,
        bottom=0.125,
        wspace=0.10,
        hspace=0.55,
    )
    draw_top_view(figure.add_subplot(grid[:, 0]), record, feasibility)
    _draw_distance(figure.add_subplot(grid[0, 1]), record)
    _draw_arrival(figure.add_subplot(grid[1, 1]), record)
    _draw_errors(figure.add_subplot(grid[2, 1]), record)
    heading = title or record.title
    figure.text(
        0.025,
        0.95,
        heading or "Episode",
        fontsize=14,
        fontweight="bold",
        color=PALETTE.ink,
        va="center",
    )
    figure.text(
        0.975,
        0.95,
        describe_result(record),
        fontsize=11,
        color=_result_colour(record),
        va="center",
        ha="right",
    )
    draw_legend(figure, physics=any(push.physics is not None for push in record.pushes))
    return figure


def save_picture(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG, whole or not at all; raises `OutputError`."""
    memory = BytesIO()
    # Without the date the same episode gives the same bytes.
    figure.savefig(memory, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return write_whole(path, memory.getvalue())


def describe_result(record: EpisodeRecord) -> str:
    """Return in words how an episode ended."""
    count = len(record.pushes)
    pushes = f"{count} push" if count == 1 else f"{count} pushes"
    left = _millimetres(record.final_distance)
    within = f"within {100 * record.tolerance:g} cm"
    if record.final_distance <= record.tolerance:
        return f"reached {within} in {pushes}, {left} from the goal"
    return f"not {within} after {pushes}: {left} from the goal"


def _millimetres(distance: float) -> str:
    return f"{1e3 * distance:.1f} mm" if distance < 0.01 else f"{1e3 * distance:.0f} mm"


def _result_colour(record: EpisodeRecord) -> str:
    return PALETTE.goal if record.final_distance <= record.tolerance else "#c0392b"


def _panel(axes: Axes, title: str) -> None:
    axes.set_title(title, fontsize=9.5, loc="left", color=PALETTE.ink, pad=5)
    axes.tick_params(labelsize=8, colors=PALETTE.faint, length=2.5)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color("#c3c8cc")


def _draw_distance(axes: Axes, record: EpisodeRecord) -> None:
    distance = [1e3 * float(target_distance(scene, record.goal)) for scene in record.scenes]
    _panel(axes, "Target to goal after each push [mm]")
    axes.set_yscale("log")
    tolerance = 1e3 * record.tolerance
    axes.axhspan(1e-3, tolerance, color=PALETTE.goal, alpha=0.13, linewidth=0)
    axes.axhline(tolerance, color=PALETTE.goal, linewidth=1.2)
    shown = np.maximum(distance, 0.1)
    axes.plot(shown, "o-", color=PALETTE.target, linewidth=1.8, markersize=4.5)
    axes.set_ylim(min(shown.min(), tolerance) / 2, max(shown.max(), tolerance) * 1.8)
    axes.set_xticks(range(len(distance)))
    axes.set_xlim(-0.3, max(len(distance) - 1, 1) + 0.3)


def _draw_arrival(axes: Axes, record: EpisodeRecord) -> None:
    """Draw where the target came to rest about the goal, in millimetres."""
    _panel(axes, "At the goal: actual and predicted centres [mm]")
    tolerance = 1e3 * record.tolerance
    half = ZOOM * tolerance
    axes.add_patch(Circle((0, 0), tolerance, color=PALETTE.goal, alpha=0.13, linewidth=0))
    axes.add_patch(Circle((0, 0), tolerance, fill=False, color=PALETTE.goal, linewidth=1.2))
    axes.plot(0, 0, "+", color=PALETTE.goal, markersize=9, markeredgewidth=1.8)
    trail = np.array([1e3 * (scene[TARGET, POSITION] - record.goal) for scene in record.scenes])
    axes.plot(*trail.T, "o-", color=PALETTE.target, linewidth=1.6, markersize=4.5)
    for push, end in zip(record.pushes, trail[1:], strict=True):
        if push.predicted is not None:
            expected = 1e3 * (push.predicted[TARGET, POSITION] - record.goal)
            axes.plot(*np.stack([expected, end]).T, color=PALETTE.predicted, linewidth=1.0)
            axes.plot(
                *expected,
                "D",
                markersize=5.5,
                markerfacecolor="none",
                markeredgecolor=PALETTE.predicted,
                markeredgewidth=1.2,
            )
    axes.set(xlim=(-2 * half, 2 * half), ylim=(-half, half))
    axes.set_aspect("equal", adjustable="box")


def _draw_errors(axes: Axes, record: EpisodeRecord) -> None:
    _panel(axes, "Prediction error of the target by push [mm]")
    number = np.arange(1, len(record.pushes) + 1)
    model = [push.target_error for push in record.pushes]
    physics = [_physics_error(push) for push in record.pushes]
    both = any(error is not None for error in physics)
    width = 0.36 if both else 0.5
    shift = width / 2 if both else 0.0
    axes.bar(number - shift, _bars(model), width, color=PALETTE.predicted, alpha=0.85)
    if both:
        axes.bar(number + shift, _bars(physics), width, color=PALETTE.faint, alpha=0.6)
    axes.set_xticks(number)
    axes.set_xlim(0.4, max(len(number), 1) + 0.6)


def _physics_error(push: PushRecord) -> float | None:
    if push.physics is None:
        return None
    return float(np.linalg.norm(push.physics[TARGET, POSITION] - push.after[TARGET, POSITION]))


def _bars(errors: list[float | None]) -> np.ndarray:
    return np.array([np.nan if error is None else 1e3 * error for error in errors])
