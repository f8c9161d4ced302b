"""Bodies from above: their outlines, where they should be, and where they were expected."""

from itertools import cycle, islice
from typing import Any, Final, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Patch, Polygon
from numpy import ndarray

from sain_core.drawing.palette import PALETTE, rgba
from sain_core.goal import BodyPose, Goal
from sain_core.scene import POSITION, RADIUS, THETA, unit
from sain_core.shapes.bodies import MOST_BODIES, Bodies
from sain_core.shapes.shape import Shape
from sain_core.types import Points, Scene

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


@runtime_checkable
class Depicted(Protocol):
    """What pictures take from an episode or a plan: the bodies, and what they are wanted for."""

    @property
    def start(self) -> Scene:
        """The first scene (N, 8)."""

    @property
    def goal(self) -> Goal:
        """What bodies should come to."""

    @property
    def bodies(self) -> Bodies:
        """Shape and role of each body."""


def body_names(record: Depicted) -> list[str]:
    """Return what of `sain_eval.legend.MARKS` stands for the bodies and their goal."""
    numbered = _numbered(record)
    others = ["other body"] * (len(numbered) < len(record.start))
    return [*(f"body {body}" for body in numbered), *others, "goal and tolerance"]


def body_colour(record: Depicted, body: int) -> str:
    """Return the colour of a body: its own if it has a pose or may be pushed."""
    return BODY_COLOURS[body] if body in _numbered(record) else PALETTE.other


def _numbered(record: Depicted) -> list[int]:
    return sorted({*record.goal.wanted, *record.bodies.fitted(len(record.start)).pushable})


def outline_patch(state: Float[ndarray, "8"], shape: Shape, **style: Any) -> Patch:
    """Return the outline of a body in a state (8,)."""
    if shape.is_round:
        return Circle(tuple(state[POSITION]), float(state[RADIUS]), **style)
    return Polygon(shape.placed(state), closed=True, **style)


def draw_body(
    axes: Axes, record: Depicted, scene: Scene, body: int, face: float, **style: Any
) -> None:
    """Draw a body of a scene; `face` is the opacity of its inside, `edge` that of its rim."""
    colour, edge = body_colour(record, body), style.pop("edge", 1.0)
    style |= {"facecolor": rgba(colour, face), "edgecolor": rgba(colour, edge)}
    if body in record.bodies.fixed:
        style["hatch"] = "////"
    axes.add_patch(outline_patch(scene[body], record.bodies.shapes[body], **style))


def draw_pose(axes: Axes, record: Depicted, pose: BodyPose) -> None:
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


def draw_ghost(axes: Axes, scene: Scene, record: Depicted, body: int) -> None:
    """Draw the outline of a body where it was expected."""
    shape = record.bodies.shapes[body]
    style: dict[str, Any] = {"edgecolor": rgba(PALETTE.predicted, 0.8), "linewidth": 0.9}
    axes.add_patch(outline_patch(scene[body], shape, fill=False, zorder=6.8, **style))


def draw_error(axes: Axes, predicted: Points, actual: Points) -> None:
    """Draw a predicted place (2,), with a line to where the body came to rest (2,)."""
    axes.plot(*np.stack([predicted, actual]).T, color=PALETTE.predicted, linewidth=1.0, zorder=7)
    mark: dict[str, Any] = {"markerfacecolor": "none", "markeredgecolor": PALETTE.predicted}
    axes.plot(*predicted, "D", markersize=5.0, markeredgewidth=1.2, zorder=7, **mark)
