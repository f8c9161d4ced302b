"""Bodies and goals as a small image: x points up and y to the left, as seen from behind the arm.

Everything is drawn larger and averaged down, which smooths the edges. The arm is not drawn.
"""

from collections.abc import Iterable
from functools import cache
from typing import Final

import numpy as np
from jaxtyping import UInt8
from numpy import ndarray
from PIL import Image, ImageDraw

from sain_core.goal import Goal
from sain_core.scene import Table
from sain_core.shapes.bodies import Bodies
from sain_core.types import Place, Points, Scene
from sain_core.view.palette import PALETTE
from sain_core.view.scenes import bodies_in, goal_marks, stage
from sain_core.view.things import DrawnBody, GoalMark, ReachArea, TableTop, Thing, hue

TopImage = UInt8[ndarray, "size size 3"]

MARGIN: Final = 0.02  # [m], about the table
FINENESS: Final = 4  # drawn so many times larger
LINE: Final = 0.009  # [m], width of the outline of a goal
DOT: Final = 0.012  # [m], radius of the middle of a goal


class TopPicture:
    """Draws scenes from above, always the same part of the world: the table."""

    def __init__(self, size: int) -> None:
        """Draw images of size x size pixels."""
        table = Table()
        self._side = max(table.x_max - table.x_min, table.y_max - table.y_min) + 2 * MARGIN
        middle = np.array([table.x_min + table.x_max, table.y_min + table.y_max]) / 2
        self._corner = middle + self._side / 2  # the upper left one
        self._scale = FINENESS * size / self._side  # [px/m]
        self._empty = Image.new("RGB", (FINENESS * size,) * 2, PALETTE.line)
        self._draw_stage(stage())

    def draw(self, things: Iterable[DrawnBody | GoalMark]) -> TopImage:
        """Return an image of things on the table."""
        canvas = self._empty.copy()
        draw = ImageDraw.Draw(canvas)
        for thing in things:
            if isinstance(thing, GoalMark):
                self._draw_goal(draw, thing)
            else:
                draw.polygon(self._pixels(thing.outline), fill=hue(thing))
        return np.array(canvas.reduce(FINENESS))

    def pixel(self, place: Place) -> tuple[int, int]:
        """Return row and column of a place (2,) [m]."""
        ((column, row),) = self._pixels(place[None])
        return int(row / FINENESS), int(column / FINENESS)

    def _draw_stage(self, things: Iterable[Thing]) -> None:
        draw = ImageDraw.Draw(self._empty)
        for thing in things:
            if isinstance(thing, TableTop):
                draw.polygon(self._pixels(thing.outline), PALETTE.table)
            elif isinstance(thing, ReachArea):
                for outline in thing.outlines:
                    draw.polygon(self._pixels(outline), PALETTE.reach)

    def _draw_goal(self, draw: ImageDraw.ImageDraw, goal: GoalMark) -> None:
        """Draw the outline, over the bodies, and a dot of the colour of the body."""
        corners, width = goal.body.outline, max(1, round(LINE * self._scale))
        closed = np.concatenate([corners, corners[:2]])  # all joints round
        draw.line(self._pixels(closed), fill=hue(goal), width=width, joint="curve")
        ((x, y),), size = self._pixels(goal.body.place[None]), DOT * self._scale
        box, rim = (x - size, y - size, x + size, y + size), PALETTE.paper
        draw.ellipse(box, fill=hue(goal.body), outline=rim, width=FINENESS)

    def _pixels(self, points: Points) -> list[tuple[float, float]]:
        """Return points (M, 2) [m] on the canvas."""
        away = (self._corner - points) * self._scale
        return [(float(y), float(x)) for x, y in away]


@cache
def _picture(size: int) -> TopPicture:
    return TopPicture(size)


def picture_of(scene: Scene, bodies: Bodies, goal: Goal, size: int) -> TopImage:
    """Return a scene (N, 8) and a goal from above, in an image of size x size pixels."""
    marks = goal_marks(goal, scene, bodies)
    return _picture(size).draw([*bodies_in(scene, bodies, goal), *marks])
