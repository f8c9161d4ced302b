"""All shapes in one picture: outlines, names, feet and centroid."""

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon

from sain_core.drawing.figures import TEXT, new_figure
from sain_core.drawing.palette import PALETTE, rgba
from sain_core.shapes.library import footprint_names, get_shape
from sain_core.shapes.shape import Shape

COLUMNS: Final = 7
TILE: Final = (1.3, 1.45)  # [inch]
HALF: Final = 1.12  # [circumscribed radii], half of the width of a tile


def draw_library() -> Figure:
    """Draw every shape with its circumscribed circle, x to the right."""
    shapes = [get_shape(name) for name in footprint_names()]
    rows = -(-len(shapes) // COLUMNS)
    figure = new_figure(COLUMNS * TILE[0], rows * TILE[1])
    for place, shape in enumerate(shapes, start=1):
        axes = figure.add_subplot(rows, COLUMNS, place)
        draw_shape(axes, shape)
        axes.set_title(shape.footprint, fontsize=TEXT + 0.5, color=PALETTE.ink, pad=1.0)
    return figure


def draw_shape(axes: Axes, shape: Shape) -> None:
    """Draw one shape: its outline, the edges of its parts, its feet, its centroid and x axis."""
    radius = 1.0 / shape.circumradius
    circle: dict[str, Any] = {"fill": False, "edgecolor": PALETTE.line, "linewidth": 1.0}
    axes.add_patch(Circle((0.0, 0.0), 1.0, **circle))
    axes.add_patch(_outline(shape, radius))
    if not shape.is_round:
        for part in shape.parts(radius):
            seams: dict[str, Any] = {"edgecolor": rgba(PALETTE.mid, 0.35), "linewidth": 0.6}
            axes.add_patch(Polygon(part, closed=True, fill=False, **seams))
    feet = shape.supports(radius)
    axes.plot(*feet.T, "o", color=PALETTE.target, markersize=4.5)
    axes.plot(0.0, 0.0, "+", color=PALETTE.ink, markersize=8.0, markeredgewidth=1.4)
    axes.set(xlim=(-HALF, HALF), ylim=(-HALF, HALF), aspect="equal")
    axes.set_axis_off()


def _outline(shape: Shape, radius: float) -> Patch:
    style: dict[str, Any] = {"facecolor": rgba(PALETTE.mid, 0.22), "edgecolor": PALETTE.mid}
    if shape.is_round:
        return Circle((0.0, 0.0), radius, linewidth=1.6, **style)
    return Polygon(np.asarray(shape.outline(radius)), closed=True, linewidth=1.6, **style)
