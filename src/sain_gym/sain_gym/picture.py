"""The table from above as a small image: bodies, goals, and where the arm can reach.

x points up and y to the left, as seen from behind the arm. The outline of each goal is drawn over
the bodies, with a dot in its middle that has the colour of the body that should be there. The arm
is not drawn. Everything is drawn larger and averaged down, which smooths the edges.
"""

from typing import Final

import numpy as np
from jaxtyping import UInt8
from numpy import ndarray
from PIL import Image, ImageDraw

from sain_core.drawing.palette import PALETTE
from sain_core.feasibility import Feasibility
from sain_core.scene import POSITION, unit
from sain_core.types import Points, Scene
from sain_eval.episode import EpisodeRecord

TopImage = UInt8[ndarray, "size size 3"]

MARGIN: Final = 0.02  # [m], about the table
FINENESS: Final = 4  # drawn so many times larger
LINE: Final = 0.009  # [m], width of the outline of a goal
DOT: Final = 0.012  # [m], radius of the middle of a goal
ARC: Final = 90  # corners of the limits of the reach
WHITE: Final = "#ffffff"


class TopPicture:
    """Draws scenes from above."""

    def __init__(self, size: int, feasibility: Feasibility = Feasibility()) -> None:
        """Draw images of size x size pixels."""
        table = feasibility.table
        self._side = max(table.x_max - table.x_min, table.y_max - table.y_min) + 2 * MARGIN
        middle = np.array([table.x_min + table.x_max, table.y_min + table.y_max]) / 2
        self._corner = middle + self._side / 2  # the upper left one
        self._scale = FINENESS * size / self._side  # [px/m]
        self._empty = self._draw_empty(FINENESS * size, feasibility)

    def draw(self, record: EpisodeRecord, scene: Scene) -> TopImage:
        """Return an image of a scene (N, 8) and the goal of a record."""
        canvas = self._empty.copy()
        draw = ImageDraw.Draw(canvas)
        for body, shape in enumerate(record.bodies.shapes):
            outline = self._pixels(shape.placed(scene[body]))
            draw.polygon(outline, fill=_colour(record, body))
        self._draw_goals(draw, record, scene)
        return np.array(canvas.reduce(FINENESS))

    def _draw_goals(self, draw: ImageDraw.ImageDraw, record: EpisodeRecord, scene: Scene) -> None:
        placed = record.goal.placed(scene)
        for body in record.goal.wanted:
            outline = record.bodies.shapes[body].placed(placed[body])
            closed = np.concatenate([outline, outline[:2]])  # the first corner is rounded, too
            line = self._pixels(closed)
            draw.line(line, fill=PALETTE.goal, width=self._width, joint="curve")
            x, y = self._pixels(placed[body, POSITION][None])[0]
            radius = DOT * self._scale
            box = (x - radius, y - radius, x + radius, y + radius)
            draw.ellipse(box, fill=_colour(record, body), outline=WHITE, width=FINENESS // 2)

    @property
    def _width(self) -> int:
        return max(1, round(LINE * self._scale))

    def _pixels(self, points: Points) -> list[tuple[float, float]]:
        """Return points (M, 2) [m] in the picture."""
        away = (self._corner - points) * self._scale
        return [(float(y), float(x)) for x, y in away]

    def _draw_empty(self, size: int, feasibility: Feasibility) -> Image.Image:
        """Return the table without bodies."""
        canvas = Image.new("RGB", (size, size), PALETTE.line)
        reach, table = feasibility.reach, feasibility.table
        bearings = np.linspace(-reach.max_bearing, reach.max_bearing, ARC)
        ring = np.concatenate([reach.inner * unit(bearings), reach.outer * unit(bearings[::-1])])
        corners = np.array([[table.x_min, table.y_min], [table.x_max, table.y_max]])
        (left, top), (right, bottom) = self._pixels(corners[::-1])
        top_left, bottom_right = (left, top), (right, bottom)
        on_table = Image.new("L", canvas.size, 0)
        ImageDraw.Draw(on_table).rectangle((top_left, bottom_right), fill=255)
        top_view = Image.new("RGB", canvas.size, PALETTE.table)
        ImageDraw.Draw(top_view).polygon(self._pixels(ring), fill=PALETTE.reach)
        canvas.paste(top_view, mask=on_table)
        return canvas


def _colour(record: EpisodeRecord, body: int) -> str:
    """Return the colour of a body in all pictures."""
    from sain_eval.plots.marks import body_colour  # which loads matplotlib

    return body_colour(record, body)
