"""The bodies of an episode as a message states them: checked before anything is made of them.

Messages are read by their attributes and never by their class, as in `sain_core.wire`. A shape that
is installed here is that shape, once its outline was compared. Any other is made of the parts that
the message has, so a planner can push bodies of which it has only the outline.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import ConfigError, InvalidInputError, OutOfRangeError
from sain_core.guarding.untrusted import LEAST_RADIUS, LONGEST_NAME, MOST_BODIES, MOST_RADIUS
from sain_core.scene import DISK_HEIGHT
from sain_core.shapes.bodies import Bodies, as_roles
from sain_core.shapes.library import get_shape
from sain_core.shapes.outlines import MOST_HEIGHT
from sain_core.shapes.shape import FEET, FLAT, FLAT_MARK, Pair, Ring, Shape, Solid
from sain_core.shapes.solids import DISK, Prism
from sain_core.types import Points

BOX: Final = 1  # of shape_msgs/SolidPrimitive
CYLINDER: Final = 3
PRISM: Final = 5
DIGITS: Final = 6  # of heights [m]
SINGLE: Final = 1e-5  # [radii], corners come as float32
FEET_COUNT: Final = 3  # of supports in a message; any other number is those of a flat bottom


def decode_bodies(message: Any) -> Bodies:
    """Return the shapes, roles and heights that a ``Bodies`` message states.

    Raises `InvalidInputError`: a number of bodies, or parts, that cannot be; another outline than
    the shape has here; `OutOfRangeError`: a radius, a height; `ConfigError`: a role.
    """
    count = len(message.bodies)
    if not 1 <= count <= MOST_BODIES:
        raise InvalidInputError(f"the message has {count} bodies; allowed: 1 to {MOST_BODIES}")
    shapes = tuple(_shape(number, body) for number, body in enumerate(message.bodies))
    heights = tuple(_height(number, body) for number, body in enumerate(message.bodies))
    return Bodies(shapes, as_roles([body.role for body in message.bodies]), heights)


def decode_request_bodies(request: Any, stated: Bodies) -> Bodies:
    """Return the bodies of a ``Rollout`` or ``PredictResidual`` request; by default disks.

    A request names shapes. One that is not installed here, as of a user's file, is that of this
    name among the bodies that the topic `shapes` stated last.
    """
    shapes, roles = request.shapes, request.roles
    for name, given in (("shapes", shapes), ("roles", roles)):
        if len(given) not in (0, request.disks):
            raise InvalidInputError(f"{len(given)} {name} are given for {request.disks} bodies")
    known = {shape.name: shape for shape in stated.shapes}
    named = enumerate(shapes or [DISK] * request.disks)
    return Bodies(
        tuple(known[name] if name in known else get_shape(name, body) for body, name in named),
        as_roles(roles),
    )


def stated_parts(
    shape: Shape, radius: float, height: float
) -> list[tuple[int, list[float], Points]]:
    """Return what a message states of a body: of each part type, dimensions and corners (M, 2)."""
    if shape.solid is Solid.CYLINDER:
        return [(CYLINDER, [height, radius], np.empty((0, 2)))]
    if shape.solid is Solid.BOX:
        return [(BOX, [2 * radius, 2 * radius, height], np.empty((0, 2)))]
    return [(PRISM, [height], part) for part in shape.parts(radius)]


def check_unchanged(first: Bodies, now: Bodies) -> None:
    """Raise `InvalidInputError` where bodies are no longer what they were in their episode."""
    if len(now) != len(first):
        raise InvalidInputError(
            f"the episode began with {len(first)} bodies and has {len(now)} now; it cannot:"
            " reset the scene"
        )
    for what, before, after in (
        ("shape", [s.name for s in first.shapes], [s.name for s in now.shapes]),
        ("role", first.roles, now.roles),
        ("outline", first.shapes, now.shapes),
    ):
        for body, (old, new) in enumerate(zip(before, after, strict=True)):
            if old != new:
                values = f"from {old!s} to {new!s}" if what != "outline" else "of its shape"
                raise InvalidInputError(
                    f"the {what} of body {body} changed {values} within its episode; it cannot:"
                    " reset the scene"
                )


def _height(number: int, body: Any) -> float:
    """Return how high a body is [m]: the highest of its parts, which all stand on the table."""
    places = ((part, 2 if int(part.type) == BOX else 0) for part in body.parts)
    stated = [size for part, place in places for size in part.dimensions[place : place + 1]]
    height = round(max(stated, default=DISK_HEIGHT), DIGITS)
    if not LEAST_RADIUS <= height <= MOST_HEIGHT:  # also NaN
        raise OutOfRangeError(
            f"body {number} is {height} m high; allowed: {LEAST_RADIUS} to {MOST_HEIGHT} m"
        )
    return height


def _shape(number: int, body: Any) -> Shape:
    radius = float(body.radius)
    if not LEAST_RADIUS <= radius <= MOST_RADIUS:  # also NaN
        raise OutOfRangeError(
            f"radius of body {number} is {radius} m; allowed: {LEAST_RADIUS} to {MOST_RADIUS} m"
        )
    parts = _parts(f"body {number} ({body.name[:LONGEST_NAME]!r})", body, radius)
    bottom = FLAT if body.name.endswith(FLAT_MARK) or len(body.supports) != FEET_COUNT else FEET
    name = body.name.removesuffix(FLAT_MARK)
    try:
        installed = get_shape(name)
    except ConfigError:
        return _made(number, name, parts).on(bottom)
    if not _same(installed, parts):
        raise InvalidInputError(
            f"body {number} is a {body.name!r} with another outline than that shape has here;"
            " install the same version of the shape, or give it another name"
        )
    return installed.on(bottom)


def _parts(what: str, body: Any, radius: float) -> list[Ring] | None:
    """Return the parts (M, 2) [radii]; None: one cylinder of the body's radius."""
    kinds = [int(part.type) for part in body.parts]
    if kinds == [CYLINDER]:
        across = _lengths(what, body.parts[0].dimensions, 2)[1]
        if abs(across - radius) > SINGLE * radius:
            raise InvalidInputError(
                f"{what} is a cylinder with radius {across} m; the body has {radius} m"
            )
        return None
    return [_part(what, part) / radius for part in body.parts]


def _part(what: str, part: Any) -> Points:
    if int(part.type) == BOX:
        x, y = _lengths(what, part.dimensions, 2)[:2] / 2
        return np.array([(x, y), (-x, y), (-x, -y), (x, -y)])
    if int(part.type) != PRISM:
        raise InvalidInputError(
            f"{what} has a part of type {part.type}; allowed: {PRISM} (prism), {BOX} (box), or one"
            f" {CYLINDER} (cylinder) alone"
        )
    corners = [length for corner in part.polygon.points for length in (corner.x, corner.y)]
    return _lengths(what, corners, 0).reshape(-1, 2)


def _lengths(what: str, values: Sequence[float], least: int) -> Float[ndarray, "M"]:
    """Return lengths [m], at least so many, of which none is larger than a body."""
    lengths = np.array(values, dtype=np.float64)
    if len(lengths) < least or not (np.abs(lengths) <= 2 * MOST_RADIUS).all():  # also NaN
        raise InvalidInputError(
            f"{what} has a part of {lengths.round(3).tolist()} m; allowed: {least} or more numbers"
            f" up to {2 * MOST_RADIUS:g} m"
        )
    return lengths


def _same(shape: Shape, parts: list[Ring] | None) -> bool:
    if shape.is_round or parts is None:
        return shape.is_round and parts is None
    own = shape.parts(1.0)
    return len(own) == len(parts) and all(
        mine.shape == theirs.shape and np.allclose(mine, theirs, atol=SINGLE, rtol=0.0)
        for mine, theirs in zip(own, parts, strict=True)
    )


def _made(number: int, name: str, parts: list[Ring] | None) -> Shape:
    """Return a shape that is not installed here, from its parts."""
    if parts is None:
        return get_shape(DISK)
    polygons: list[tuple[Pair, ...]] = [tuple((x, y) for x, y in part.tolist()) for part in parts]
    try:
        made = Prism.of(name, *polygons)
    except ConfigError as error:
        raise InvalidInputError(f"body {number}: {error}") from error
    moved = float(np.abs(made.parts(1.0)[0] - parts[0]).max())
    if moved > 10 * SINGLE:
        raise InvalidInputError(
            f"body {number} ({name!r}) has its centroid or circumscribed circle elsewhere than at"
            f" (0, 0) with its radius, by {moved:.3g} radii"
        )
    return made
