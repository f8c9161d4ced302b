"""The things that every picture, page and viewer draws, in metres and radians.

`sain_core.view.scenes` makes lists of them from a scene, a row (an executed push) or a plan. What
draws them is thin and computes no outline, colour, arrow or region: Matplotlib
(`sain_eval.plots`), viser (`sain_live.page`), markers for RViz (`sain_core.ros.markers`), the JSON
of the report page (`sain_bags.report.drawn`) and, bodies and goals alone, the images of the
Gymnasium environment (`sain_core.view.image`).
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.scene import POSITION, RADIUS, THETA, unit
from sain_core.shapes.shape import Shape
from sain_core.types import Place, Points
from sain_core.view.palette import PALETTE, cost_colour

HEADING_MARK: Final = 0.8  # of the circumscribed radius, length of a mark of a heading


class Look(StrEnum):
    """What a body or a path is drawn for."""

    NOW = "now"  # where it is
    START = "start"  # where it was first
    BETWEEN = "between"  # where it came to rest on its way
    EXPECTED = "expected"  # where the planner's model predicted it after a push
    PHYSICS = "physics"  # where physics alone predicted it
    PLANNED = "planned"  # where a plan should lead it
    OTHER = "other"  # where another sequence of pushes would lead it
    ERROR = "error"  # from where it was expected to where it came to rest


@dataclass(frozen=True, eq=False)
class TableTop:
    """The table from its lower left to its upper right corner (2,) [m]."""

    low: Place
    high: Place

    @property
    def outline(self) -> Points:
        """The corners (4, 2) [m]."""
        (left, bottom), (right, top) = self.low, self.high
        return np.array([(left, bottom), (right, bottom), (right, top), (left, top)])


@dataclass(frozen=True, eq=False)
class ReachArea:
    """The part of a table where the tool can stand."""

    pieces: list[Points]  # of the reach, the corners (M, 2) [m] of each
    table: TableTop  # it

    @property
    def outlines(self) -> list[Points]:
        """The corners (M, 2) [m] of each piece of it."""
        from shapely import Polygon, get_parts

        table = Polygon(self.table.outline)
        parts = [get_parts(Polygon(piece).intersection(table)) for piece in self.pieces]
        whole = [part for some in parts for part in some if part.area > 0.0]
        return [np.array(part.exterior.coords)[:-1] for part in whole]


@dataclass(frozen=True, eq=False)
class DrawnBody:
    """A body of a scene."""

    number: int  # its place in the scene
    name: str  # what it is called beside it
    shape: Shape  # its shape
    state: Float[ndarray, "8"]  # (8,)
    colour: str  # the name of its colour in the palette
    look: Look = Look.NOW  # what it is drawn for
    fixed: bool = False  # whether nothing moves it
    marked: bool = False  # whether its heading counts
    share: float = 0.0  # of the pushes of a plan that are over, 1 for the last; of other looks 0

    @property
    def place(self) -> Place:
        """Its centre (2,) [m]."""
        return np.asarray(self.state[POSITION])

    @property
    def heading(self) -> float:
        """Where its x axis points [rad]."""
        return float(self.state[THETA])

    @property
    def radius(self) -> float:
        """The radius of its state [m]."""
        return float(self.state[RADIUS])

    @property
    def size(self) -> float:
        """The radius [m] of the circle about it."""
        return self.shape.circumradius * self.radius

    @property
    def outline(self) -> Points:
        """Its corners (M, 2) [m] in the world."""
        return self.shape.placed(self.state)

    @property
    def mark(self) -> Points:
        """The line (2, 2) [m] from its centre along its x axis."""
        return self.place + np.array([[0.0], [HEADING_MARK * self.size]]) * unit(self.state[THETA])


@dataclass(frozen=True, eq=False)
class BodyPath:
    """Where a body's centre goes, by places (M, 2) [m]."""

    number: int
    points: Points
    colour: str
    look: Look = Look.NOW
    share: float = 0.0  # of other sequences, 0 for the cheapest and 1 for the dearest


@dataclass(frozen=True, eq=False)
class GoalMark:
    """Where a body should come to rest."""

    body: DrawnBody  # it, as it should lie; with a mark where its heading counts
    tolerance: float  # [m], about its place
    colour: str = "goal"  # of the mark; that of the body is the body's

    @property
    def number(self) -> int:
        """Place of the body in the scene."""
        return self.body.number

    @property
    def outlined(self) -> bool:
        """Whether the body's outline is the goal's: no, where any heading will do."""
        return self.body.marked or self.body.shape.is_round


@dataclass(frozen=True, eq=False)
class PushArrow:
    """The way of the tool's axis from a start (2,) to an end (2,) [m]; number 0: none is shown."""

    start: Place
    end: Place
    number: int = 0
    colour: str = "ink"


@dataclass(frozen=True, eq=False)
class Region:
    """The circle [m] that should hold a body's centre after a push, by nine chances in ten."""

    number: int
    place: Place
    radius: float
    colour: str = "region"


Thing = TableTop | ReachArea | DrawnBody | BodyPath | GoalMark | PushArrow | Region


def hue(thing: DrawnBody | BodyPath | GoalMark | PushArrow | Region) -> str:
    """Return the colour of a thing on white, as ``#rrggbb``."""
    if isinstance(thing, BodyPath) and thing.look is Look.OTHER:
        return cost_colour(thing.share)
    return PALETTE.named(thing.colour)
