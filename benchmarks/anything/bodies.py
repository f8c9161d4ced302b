"""Bodies of a file of outlines as a camera sees them: a file of bodies, with tags that fit."""

from itertools import product
from typing import Any, Final

import numpy as np

from sain_core.types import Points

MOST_TAGS: Final = 3  # on a body
TAG_SIDES: Final = (0.04, 0.036, 0.032, 0.028, 0.025, 0.022, 0.02, 0.018, 0.016)  # [m]
PAPER: Final = 1.25  # side of a tag with its white rim, over its own
STEP: Final = 0.003  # [m], between places that are tried
TURNS: Final = np.linspace(0.0, np.pi / 2, 7)[:-1]  # [rad], likewise


def place_tags(outline: Points, first: int) -> list[dict[str, Any]]:
    """Return up to three tags that lie on a body with an outline (M, 2) [m], numbered from one on.

    Each is the largest that finds room beside those before it; of the places for that, the one
    that is farthest from them.
    """
    from shapely import Point, Polygon, box
    from shapely.affinity import rotate, translate

    free, placed = Polygon(outline), list[dict[str, Any]]()
    low, high = outline.min(axis=0), outline.max(axis=0)
    columns, rows = (np.arange(*ends, STEP).tolist() for ends in zip(low, high, strict=True))
    for number in range(first, first + MOST_TAGS):
        room: list[tuple[float, float, float, float, float]] = []
        for side in TAG_SIDES:
            half = 0.5 * PAPER * side
            inner = free.buffer(-half)
            square = box(-half, -half, half, half)
            for turn in TURNS.tolist():
                turned = rotate(square, turn, origin=(0, 0), use_radians=True)
                for x, y in product(columns, rows):
                    if inner.covers(Point(x, y)) and free.covers(translate(turned, x, y)):
                        far = min(
                            (np.hypot(x - one["x"], y - one["y"]) for one in placed), default=0.0
                        )
                        room.append((float(far), side, x, y, turn))
            if room:
                break
        if not room:
            break
        _, side, x, y, turn = max(room)
        half = 0.5 * PAPER * side
        paper = rotate(box(-half, -half, half, half), turn, origin=(0, 0), use_radians=True)
        free = free.difference(translate(paper, x, y))
        at = {"x": round(x, 5), "y": round(y, 5), "angle": round(turn, 5)}
        placed.append({"id": number, "size": side} | at)
    return placed
