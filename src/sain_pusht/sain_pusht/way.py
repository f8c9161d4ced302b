"""Ways round the block that do not touch it, inside the walls."""

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from shapely import LineString, Point, Polygon, box
from shapely.ops import nearest_points
from shapely.prepared import PreparedGeometry, prep

from sain_core.errors import UnreachableError

Corners = Float[ndarray, "M 2"]  # of an outline, in order
Way = Float[ndarray, "P 2"]  # places one after another

KEEP_OFF: Final = 0.004  # [m], gap between tool and block for which ways are planned
ROUNDING: Final = 1e-5  # [m], a way that enters what it should avoid by less does not enter it


@dataclass(frozen=True)
class Room:
    """A square in which places are allowed.

    Attributes:
        low: smallest x and y [m].
        high: largest x and y [m].
    """

    low: float
    high: float

    def contains(self, places: ndarray) -> bool:
        """Tell whether places (..., 2) are all inside."""
        low, high = self.low - ROUNDING, self.high + ROUNDING
        return bool(((places >= low) & (places <= high)).all())

    def around(self, outline: Corners, gap: float) -> list[Polygon]:
        """Return the parts of the room that keep a gap [m] from an outline (M, 2)."""
        room = box(self.low, self.low, self.high, self.high)
        free = room.difference(_grown(outline, gap))
        return list(getattr(free, "geoms", [free]))


def way_round(start: ndarray, end: ndarray, outline: Corners, gap: float, room: Room) -> Way:
    """Return the shortest way (P, 2) [m] from a place to another.

    Args:
        start: (2,) [m]. Nearer to the outline than `gap`, the way first leads straight away from
            it.
        end: (2,) [m]; likewise.
        outline: (M, 2) [m], which the way keeps away from.
        gap: [m], by which, from the tool's axis.
        room: that the way stays in.

    Raises:
        UnreachableError: there is no way.
    """
    grown = _grown(outline, gap)
    first, last = _way_out(start, grown), _way_out(end, grown)
    for part in room.around(outline, gap):
        if part.distance(Point(first)) < ROUNDING and part.distance(Point(last)) < ROUNDING:
            rings = [part.exterior, *part.interiors]
            corners = [np.array(corner) for ring in rings for corner in ring.coords[:-1]]
            middle = _shortest([first, last, *corners], prep(part.buffer(ROUNDING)))
            return np.array(list(_distinct([start, *middle, end])))
    raise UnreachableError(
        f"no way for the tool from ({start[0]:.3f}, {start[1]:.3f}) m to"
        f" ({end[0]:.3f}, {end[1]:.3f}) m round the block"
    )


def way_out(place: ndarray, outline: Corners, gap: float) -> ndarray:
    """Return the place (2,) nearest to another that has a gap [m] to an outline (M, 2)."""
    return _way_out(place, Polygon(outline).buffer(gap))


def _grown(outline: Corners, gap: float) -> Polygon:
    """Return what keeps less than a gap from an outline; cut off beyond its corners."""
    return Polygon(outline).buffer(gap, join_style="mitre", mitre_limit=1.5)


def _way_out(place: ndarray, grown: Polygon) -> ndarray:
    if not grown.contains(Point(place)):
        return place
    return np.array(nearest_points(grown.exterior, Point(place))[0].coords[0])


def _shortest(places: list[ndarray], free: PreparedGeometry) -> list[ndarray]:
    """Return the shortest way from the first place to the second, over others (Dijkstra)."""
    far, before, done = [np.inf] * len(places), [0] * len(places), set()
    far[0], queue = 0.0, [(0.0, 0)]
    while queue:
        so_far, here = heappop(queue)
        if here in done:
            continue
        if here == 1:
            break
        done.add(here)
        for other, place in enumerate(places):
            reach = so_far + float(np.hypot(*(place - places[here])))
            if reach < far[other] and free.covers(LineString([places[here], place])):
                far[other], before[other] = reach, here
                heappush(queue, (reach, other))
    way = [1]
    while way[-1] != 0:
        way.append(before[way[-1]])
    return [places[index] for index in reversed(way)]


def _distinct(places: list[ndarray]) -> Iterator[ndarray]:
    """Yield places without those that are where the one before is."""
    last = None
    for place in places:
        if last is None or np.hypot(*(place - last)) > ROUNDING:
            yield place
            last = place
