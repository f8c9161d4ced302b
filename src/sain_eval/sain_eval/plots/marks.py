"""The marks in pictures: bodies, goals and predictions from above, and what each mark means."""

from collections.abc import Sequence
from itertools import cycle, islice
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon
from numpy import ndarray

from sain_core.drawing.figures import TEXT
from sain_core.drawing.palette import PALETTE, rgba
from sain_core.goal import BodyPose
from sain_core.guarding.untrusted import MOST_BODIES
from sain_core.scene import POSITION, RADIUS, THETA, unit
from sain_core.shapes.shape import Shape
from sain_core.types import Points, Scene
from sain_eval.episode import EpisodeRecord

_COLOURS: Final = (
    PALETTE.mid,
    PALETTE.target,
    PALETTE.history,
    PALETTE.inside,
    PALETTE.learned,
    PALETTE.alarm,
    PALETTE.identified,
    PALETTE.physics,
    PALETTE.soft,
    PALETTE.ink,
)
BODY_COLOURS: Final = tuple(islice(cycle(_COLOURS), MOST_BODIES))
DASHED: Final = (0, (4, 2.5))
HEADING_MARK: Final = (0.0, 0.8)  # of the radius, from where to where it is drawn
HOLLOW: Final = {"markerfacecolor": "none"}
EDGE: Final = {"markeredgecolor": PALETTE.reach_edge}
MARKS: Final[dict[str, tuple[str, str, dict[str, Any]]]] = {  # marker, colour, style
    "table": ("s", PALETTE.table, {"markeredgecolor": PALETTE.table_edge}),
    "reachable area": ("s", PALETTE.reach, EDGE),
    **{f"body {body}": ("s", colour, {"alpha": 0.75}) for body, colour in enumerate(BODY_COLOURS)},
    "other body": ("s", PALETTE.other, {"alpha": 0.75}),
    "start": ("o", PALETTE.soft, HOLLOW),
    "goal and tolerance": ("+", PALETTE.goal, {"markersize": 10, "markeredgewidth": 2}),
    "push": ("$\\rightarrow$", PALETTE.ink, {"markersize": 14}),
    "predicted by physics": ("s", PALETTE.physics, {}),
    "predicted by the planner": ("D", PALETTE.predicted, {"markersize": 6} | HOLLOW),
    "90 % region": ("o", PALETTE.predicted, HOLLOW),
    "other sequence, cheapest": ("_", PALETTE.goal, {"markersize": 14}),
    "other sequence, dearest": ("_", PALETTE.alarm, {"markersize": 14}),
}


def body_names(record: EpisodeRecord) -> list[str]:
    """Return what of ``MARKS`stands for the bodies and their goal."""
    numbered = _numbered(record)
    others = ["other body"] * (len(numbered) < len(record.start))
    return [*(f"body {body}" for body in numbered), *others, "goal and tolerance"]


def body_colour(record: EpisodeRecord, body: int) -> str:
    """Return the colour of a body: its own if it has a pose or may be pushed."""
    return BODY_COLOURS[body] if body in _numbered(record) else PALETTE.other


def _numbered(record: EpisodeRecord) -> list[int]:
    return sorted({*record.goal.wanted, *record.bodies.pushable})


def outline_patch(state: Float[ndarray, "8"], shape: Shape, **style: Any) -> Patch:
    """Return the outline of a body in a state (8,)."""
    if shape.is_round:
        return Circle(tuple(state[POSITION]), float(state[RADIUS]), **style)
    return Polygon(shape.placed(state), closed=True, **style)


def draw_body(
    axes: Axes, record: EpisodeRecord, scene: Scene, body: int, face: float, **style: Any
) -> None:
    """Draw a body of a scene; `face` is the opacity of its inside, `edge` that of its rim."""
    colour, edge = body_colour(record, body), style.pop("edge", 1.0)
    style |= {"facecolor": rgba(colour, face), "edgecolor": rgba(colour, edge)}
    if body in record.bodies.fixed:
        style["hatch"] = "////"
    axes.add_patch(outline_patch(scene[body], record.bodies.shapes[body], **style))


def draw_pose(axes: Axes, record: EpisodeRecord, pose: BodyPose) -> None:
    """Draw where a body should come to rest: its outline, and its heading if that counts.

    The cross is in the middle of the tolerance. Cross and heading have the body's colour.
    """
    shape, colour = record.bodies.shapes[pose.body], body_colour(record, pose.body)
    state = record.start[pose.body].copy()
    state[POSITION] = pose.x, pose.y
    style: dict[str, Any] = {"fill": False, "linewidth": 1.8, "zorder": 9}
    style["edgecolor"] = PALETTE.goal
    axes.plot(*state[POSITION], "+", color=colour, markersize=9.0, markeredgewidth=1.6, zorder=9)
    if pose.heading is not None:
        state[THETA] = pose.heading
        draw_heading(axes, state, shape, colour, zorder=9)
    if pose.heading is not None or shape.is_round:
        axes.add_patch(outline_patch(state, shape, linestyle=DASHED, **style))
    draw_tolerance(axes, state[POSITION], pose.tolerance)


def draw_tolerance(axes: Axes, place: Points, tolerance: float) -> None:
    """Draw the circle of a tolerance about a place (2,), in the units of the axes."""
    style = {"facecolor": rgba(PALETTE.goal, 0.16), "edgecolor": PALETTE.goal, "linewidth": 1.2}
    axes.add_patch(Circle(tuple(place), tolerance, zorder=5, **style))


def draw_heading(
    axes: Axes, state: Float[ndarray, "8"], shape: Shape, colour: str, zorder: float
) -> None:
    """Draw a line from the centre of a body in a state (8,) along its x axis."""
    radius = shape.circumradius * float(state[RADIUS])
    reach = radius * np.array(HEADING_MARK)[:, None]
    line = state[POSITION] + reach * unit(state[THETA])
    axes.plot(*line.T, color=colour, linewidth=1.6, zorder=zorder, solid_capstyle="round")


def draw_ghost(axes: Axes, scene: Scene, record: EpisodeRecord, body: int) -> None:
    """Draw the outline of a body where it was expected."""
    shape = record.bodies.shapes[body]
    style: dict[str, Any] = {"edgecolor": rgba(PALETTE.predicted, 0.8), "linewidth": 0.9}
    axes.add_patch(outline_patch(scene[body], shape, fill=False, zorder=6.8, **style))


def draw_error(axes: Axes, predicted: Points, actual: Points) -> None:
    """Draw a predicted place (2,), with a line to where the body came to rest (2,)."""
    axes.plot(*np.stack([predicted, actual]).T, color=PALETTE.predicted, linewidth=1.0, zorder=7)
    mark: dict[str, Any] = {"markerfacecolor": "none", "markeredgecolor": PALETTE.predicted}
    axes.plot(*predicted, "D", markersize=5.0, markeredgewidth=1.2, zorder=7, **mark)


def draw_legend(figure: Figure, names: Sequence[str], columns: int) -> None:
    """Draw those of `MARKS` along the bottom of a figure with constrained layout, in columns."""
    handles = []
    for name, (marker, colour, style) in MARKS.items():
        if name in names:
            look: dict[str, Any] = {"linestyle": "none", "markersize": 9} | style
            handles.append(Line2D([], [], marker=marker, color=colour, label=name, **look))
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=columns,
        frameon=False,
        fontsize=TEXT,
        columnspacing=1.8,
        handletextpad=0.5,
    )
