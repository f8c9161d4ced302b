"""Things from above in Matplotlib's axes, x to the right and y up, and the legend of them."""

from collections.abc import Iterable, Sequence
from itertools import cycle, islice
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch, Patch, Polygon
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MultipleLocator

from sain_core.scene import unit
from sain_core.shapes.bodies import MOST_BODIES
from sain_core.types import Place, Points
from sain_core.view.figures import TEXT, style_axes
from sain_core.view.palette import BODIES, PALETTE, rgba
from sain_core.view.things import (
    BodyPath,
    DrawnBody,
    GoalMark,
    Look,
    PushArrow,
    ReachArea,
    Region,
    TableTop,
    Thing,
    hue,
)

VIEW_MARGIN: Final = 0.06  # [m]
BASE_RADIUS: Final = 0.055  # [m], of the arm's foot as drawn
TICK: Final = 0.2  # [m]
DASHED: Final = (0, (4, 2.5))  # outlines at the goal
DOTTED: Final = (0, (1, 1.3))  # those at the start
LOOKS: Final[dict[Look, tuple[float, float, dict[str, Any]]]] = {  # opacity inside, of the rim
    Look.NOW: (0.38, 1.0, {"linewidth": 1.8, "zorder": 4}),
    Look.START: (0.0, 0.8, {"linewidth": 1.1, "zorder": 3, "linestyle": DOTTED}),
    Look.BETWEEN: (0.07, 0.4, {"linewidth": 0.7, "zorder": 2}),
    Look.PLANNED: (0.06, 0.3, {"linewidth": 0.7, "zorder": 3.5}),
    Look.EXPECTED: (0.0, 0.8, {"linewidth": 0.9, "zorder": 6.8}),
    Look.PHYSICS: (0.0, 0.8, {"linewidth": 0.9, "zorder": 6.7}),
}
HOLLOW: Final = {"markerfacecolor": "none"}
EDGE: Final = {"markeredgecolor": PALETTE.reach_edge}
COLOURS: Final = [PALETTE.named(name) for name in islice(cycle(BODIES), MOST_BODIES)]
MARKS: Final[dict[str, tuple[str, str, dict[str, Any]]]] = {  # marker, colour, style
    "table": ("s", PALETTE.table, {"markeredgecolor": PALETTE.table_edge}),
    "reachable area": ("s", PALETTE.reach, EDGE),
    **{f"body {body}": ("s", colour, {"alpha": 0.75}) for body, colour in enumerate(COLOURS)},
    "other body": ("s", PALETTE.other, {"alpha": 0.75}),
    "start": ("o", PALETTE.soft, HOLLOW),
    "goal and tolerance": ("+", PALETTE.goal, {"markersize": 10, "markeredgewidth": 2}),
    "push": ("$\\rightarrow$", PALETTE.ink, {"markersize": 14}),
    "predicted by physics": ("s", PALETTE.physics, {}),
    "predicted by the planner": ("D", PALETTE.predicted, {"markersize": 6} | HOLLOW),
    "90 % region": ("o", PALETTE.region, HOLLOW),
    "other sequence, cheapest": ("_", PALETTE.goal, {"markersize": 14}),
    "other sequence, dearest": ("_", PALETTE.alarm, {"markersize": 14}),
}

NAMES: Final[dict[type, str]] = {
    TableTop: "table",
    ReachArea: "reachable area",
    GoalMark: "goal and tolerance",
    PushArrow: "push",
    Region: "90 % region",
}


def draw_things(axes: Axes, things: Iterable[Thing]) -> list[str]:
    """Draw things into axes, in metres; return what of `MARKS` was drawn."""
    names = []
    for thing in things:
        match thing:
            case TableTop():
                _draw_table(axes, thing)
            case ReachArea():
                _draw_reach(axes, thing)
            case DrawnBody():
                _draw_body(axes, thing)
            case BodyPath():
                _draw_path(axes, thing)
            case GoalMark():
                _draw_goal(axes, thing)
            case PushArrow():
                _draw_push(axes, thing)
            case Region():
                style: dict[str, Any] = {"edgecolor": hue(thing), "linewidth": 1.2, "zorder": 7}
                axes.add_patch(Circle(tuple(thing.place), thing.radius, fill=False, **style))
        names.append(_name(thing))
    return [name for name in MARKS if name in names]


def _name(thing: Thing) -> str:
    match thing:
        case DrawnBody(look=Look.START):
            return "start"
        case DrawnBody(look=Look.EXPECTED) | BodyPath(look=Look.ERROR):
            return "predicted by the planner"
        case DrawnBody(look=Look.PHYSICS):
            return "predicted by physics"
        case DrawnBody():
            return "other body" if thing.colour == "other" else f"body {thing.number}"
        case BodyPath(look=Look.OTHER):
            return f"other sequence, {'dearest' if thing.share > 0.5 else 'cheapest'}"
    return NAMES.get(type(thing), "")


def outline_patch(body: DrawnBody, **style: Any) -> Patch:
    """Return the outline of a body."""
    if body.shape.is_round:
        return Circle(tuple(body.place), body.radius, **style)
    return Polygon(body.outline, closed=True, **style)


def _draw_table(axes: Axes, table: TableTop) -> None:
    style: dict[str, Any] = {"facecolor": PALETTE.table, "edgecolor": PALETTE.table_edge}
    box = "round,pad=0,rounding_size=0.015"
    wide, long = (table.high - table.low).tolist()
    style |= {"boxstyle": box, "linewidth": 1.5, "zorder": 0}
    top = FancyBboxPatch(tuple(table.low), wide, long, **style)
    axes.add_patch(top)
    base = Circle((0.0, 0.0), BASE_RADIUS, zorder=1)
    base.set(facecolor=PALETTE.line, edgecolor=PALETTE.other)
    axes.add_patch(base)
    words: dict[str, Any] = {"fontsize": 8, "color": PALETTE.soft, "clip_on": True}
    axes.text(0.0, 0.0, "arm", zorder=2, ha="center", va="center", **words)


def _draw_reach(axes: Axes, reach: ReachArea) -> None:
    style: dict[str, Any] = {"linewidth": 0.9, "linestyle": (0, (5, 4)), "zorder": 0.5}
    style |= {"facecolor": PALETTE.reach, "edgecolor": PALETTE.reach_edge}
    for outline in reach.outlines:
        axes.add_patch(Polygon(outline, closed=True, **style))


def _draw_body(axes: Axes, body: DrawnBody) -> None:
    face, edge, style = LOOKS[body.look]
    colours = {"facecolor": rgba(hue(body), face), "edgecolor": rgba(hue(body), edge)}
    hatch = {"hatch": "////"} if body.fixed else {}
    axes.add_patch(outline_patch(body, **colours, **style, **hatch))
    if body.look is Look.NOW and body.marked:
        _draw_mark(axes, body, 6.0)


def _draw_mark(axes: Axes, body: DrawnBody, zorder: float) -> None:
    style: dict[str, Any] = {"linewidth": 1.6, "solid_capstyle": "round"}
    axes.plot(*body.mark.T, color=hue(body), zorder=zorder, **style)


def _draw_path(axes: Axes, path: BodyPath) -> None:
    colour, points = hue(path), path.points
    if path.look is Look.OTHER:
        axes.add_collection(LineCollection([points], colors=colour, linewidths=0.8, zorder=5))
    elif path.look is Look.ERROR:
        draw_error(axes, points[0], points[1])
    else:
        style: dict[str, Any] = {"linewidth": 1.8, "solid_capstyle": "round", "alpha": 0.85}
        axes.plot(*points.T, color=colour, zorder=6, **style)
        axes.plot(*points.T, "o", color=colour, markersize=3.8, zorder=6.5)


def _draw_goal(axes: Axes, goal: GoalMark) -> None:
    """Draw the outline of a goal, the tolerance, and in the body's colour a cross and a heading."""
    body, colour = goal.body, hue(goal.body)
    axes.plot(*body.place, "+", color=colour, markersize=9.0, markeredgewidth=1.6, zorder=9)
    if body.marked:
        _draw_mark(axes, body, 9.0)
    if goal.outlined:
        style: dict[str, Any] = {"linewidth": 1.8, "zorder": 9, "edgecolor": hue(goal)}
        axes.add_patch(outline_patch(body, fill=False, linestyle=DASHED, **style))
    draw_tolerance(axes, body.place, goal.tolerance)


def draw_tolerance(axes: Axes, place: Place, tolerance: float) -> None:
    """Draw the circle of a tolerance about a place (2,), in the units of the axes."""
    style = {"facecolor": rgba(PALETTE.goal, 0.16), "edgecolor": PALETTE.goal, "linewidth": 1.2}
    axes.add_patch(Circle(tuple(place), tolerance, zorder=5, **style))


def draw_error(axes: Axes, predicted: Place, actual: Place) -> None:
    """Draw a predicted place (2,), with a line to where the body came to rest (2,)."""
    axes.plot(*np.stack([predicted, actual]).T, color=PALETTE.predicted, linewidth=1.0, zorder=7)
    mark: dict[str, Any] = {"markerfacecolor": "none", "markeredgecolor": PALETTE.predicted}
    axes.plot(*predicted, "D", markersize=5.0, markeredgewidth=1.2, zorder=7, **mark)


def _draw_push(axes: Axes, push: PushArrow) -> None:
    arrow = FancyArrowPatch(
        tuple(push.start),
        tuple(push.end),
        arrowstyle="-|>,head_length=5,head_width=2.6",
        shrinkA=0,
        shrinkB=0,
        linewidth=1.5,
        color=hue(push),
        zorder=8,
        path_effects=[withStroke(linewidth=3.0, foreground="white", alpha=0.8)],
    )
    axes.add_patch(arrow)
    if not push.number:
        return
    way = push.end - push.start
    x, y = (push.start - 0.004 * unit(np.arctan2(way[1], way[0]))).tolist()
    edge: dict[str, Any] = {"markeredgecolor": "white", "markeredgewidth": 1.2}
    axes.plot(x, y, "o", markersize=12.5, color=hue(push), zorder=10, **edge)
    style: dict[str, Any] = {"ha": "center", "va": "center_baseline", "color": "white"}
    axes.text(x, y, str(push.number), fontsize=7.5, fontweight="bold", zorder=11, **style)


def frame_view(axes: Axes, points: Points, aspect: float = 1.0) -> None:
    """Show a part of the world that holds all points (M, 2) [m].

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
