"""All shapes in one picture: outlines, names, feet and centroid.

./env python -m benchmarks.results.shapes_figure
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from benchmarks.report import ReportOptions, read_options
from sain_core.scene import RADIUS, STATE_SIZE
from sain_core.shapes.library import get_shape, shape_names
from sain_core.shapes.shape import Shape
from sain_core.view.figures import TEXT, new_figure, write_png
from sain_core.view.palette import PALETTE, rgba
from sain_core.view.things import DrawnBody
from sain_eval.plots.axes import outline_patch

COLUMNS: Final = 7
TILE: Final = (1.3, 1.45)  # [inch]
HALF: Final = 1.12  # [circumscribed radii], half of the width of a tile


def draw_library() -> Figure:
    """Draw every shape with its circumscribed circle, x to the right."""
    shapes = [get_shape(name) for name in shape_names()]
    rows = -(-len(shapes) // COLUMNS)
    figure = new_figure(COLUMNS * TILE[0], rows * TILE[1])
    for place, shape in enumerate(shapes, start=1):
        axes = figure.add_subplot(rows, COLUMNS, place)
        draw_shape(axes, shape)
        axes.set_title(shape.name, fontsize=TEXT + 0.5, color=PALETTE.ink, pad=1.0)
    return figure


def draw_shape(axes: Axes, shape: Shape) -> None:
    """Draw one shape: its outline, the edges of its parts, its feet, its centroid and x axis."""
    state = np.zeros(STATE_SIZE)
    state[RADIUS] = radius = 1.0 / shape.circumradius
    circle: dict[str, Any] = {"fill": False, "edgecolor": PALETTE.line, "linewidth": 1.0}
    axes.add_patch(Circle((0.0, 0.0), 1.0, **circle))
    style: dict[str, Any] = {"facecolor": rgba(PALETTE.mid, 0.22), "edgecolor": PALETTE.mid}
    body = DrawnBody(0, shape.name, shape, state, "mid")
    axes.add_patch(outline_patch(body, linewidth=1.6, **style))
    if not shape.is_round:
        for part in shape.parts(radius):
            seams: dict[str, Any] = {"edgecolor": rgba(PALETTE.mid, 0.35), "linewidth": 0.6}
            axes.add_patch(Polygon(part, closed=True, fill=False, **seams))
    axes.plot(*shape.supports(radius).T, "o", color=PALETTE.target, markersize=4.5)
    axes.plot(0.0, 0.0, "+", color=PALETTE.ink, markersize=8.0, markeredgewidth=1.4)
    axes.set(xlim=(-HALF, HALF), ylim=(-HALF, HALF), aspect="equal")
    axes.set_axis_off()


def main() -> None:
    """Draw the picture, and print its path."""
    out = read_options(ReportOptions, __doc__).out or Path("results/shapes.png")
    print(write_png(draw_library(), out))


if __name__ == "__main__":
    main()
