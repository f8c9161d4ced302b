"""Things to draw as the page's script reads them: metres and radians, rounded; None: not finite."""

from typing import Any, Final

import numpy as np

from sain_core.view.things import (
    BodyPath,
    DrawnBody,
    GoalMark,
    PushArrow,
    ReachArea,
    Region,
    TableTop,
    Thing,
)

PLACE_DIGITS: Final = 5  # hundredths of a millimetre


def as_json(thing: Thing) -> dict[str, Any]:
    """Return a thing: its kind, the name of its colour, and corners or a pose and what is there."""
    match thing:
        case TableTop():
            return {"kind": "table", "points": rounded_places(thing.outline)}
        case ReachArea():
            return {"kind": "reach", "pieces": list(map(rounded_places, thing.outlines))}
        case DrawnBody():
            return _body(thing)
        case BodyPath():
            return _coloured(thing, "path", points=rounded_places(thing.points), look=thing.look)
        case GoalMark():
            mark = _coloured(thing, "goal", pose=_pose(thing.body), radius=thing.tolerance)
            return mark | ({"body": _body(thing.body)} if thing.body.marked else {})
        case PushArrow():
            ends = rounded_places(np.stack([thing.start, thing.end]))
            return _coloured(thing, "push", points=ends)
        case Region():
            pose = [*rounded_places(thing.place[None])[0], 0.0]
            return _coloured(thing, "region", pose=pose, radius=thing.radius)


def rounded_places(points: np.ndarray) -> list[list[float]]:
    """Return places (M, 2) or poses (M, 3)."""
    return [[round(float(value), PLACE_DIGITS) for value in point] for point in points]


def _body(body: DrawnBody) -> dict[str, Any]:
    """Return a body: a radius, and unless it is round its outline in its own frame."""
    outline = None if body.shape.is_round else rounded_places(body.shape.outline(body.radius))
    return _coloured(
        body,
        "body",
        pose=_pose(body),
        radius=round(max(body.radius, 0.0), PLACE_DIGITS),
        outline=outline,
        look=body.look,
        fixed=body.fixed,
    )


def _pose(body: DrawnBody) -> list[float]:
    return rounded_places(body.state[None, :3])[0]


def _coloured(
    thing: DrawnBody | BodyPath | GoalMark | PushArrow | Region, kind: str, **more: Any
) -> dict[str, Any]:
    return {"kind": kind, "number": thing.number, "colour": thing.colour, **more}
