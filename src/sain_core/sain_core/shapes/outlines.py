"""Bodies by their outlines: what a user states of them, and the file beside a data set of them.

A data set names shapes. Those that only it has stand in its `OUTLINES_FILE`, and whoever reads the
data set can find them. A name ends with a hash of the outline, so no two outlines have one name.
"""

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import pi, sin
from pathlib import Path
from typing import Any, Final

import numpy as np

from sain_core.config import check_number, check_numbers
from sain_core.errors import ConfigError, DatasetError, UntrustedFileError
from sain_core.guarding.documents import parse_json, read_json, read_yaml
from sain_core.guarding.untrusted import (
    LEAST_RADIUS,
    LONGEST_NAME,
    MOST_RADIUS,
    TIP_RADII,
    read_regular_text,
)
from sain_core.output import write_json
from sain_core.scene import unit
from sain_core.shapes.shape import FEET, Pair, Shape
from sain_core.shapes.solids import DISK, TOLERANCE, Disk, Prism, centroid
from sain_core.types import Points

OUTLINES_FILE: Final = "outlines.json"
SHAPES: Final = "shapes"  # key of the outlines by name, in the user's files and in this one
UNIT: Final = "unit"
RADII: Final = "circumscribed radius"  # unit of this file
METRES: Final = "m"  # unit of the user's
TIP_RADIUS: Final = "tip_radius"  # [m], key in the user's files
SEMI_AXES: Final = "semi_axes"  # [m], of an ellipse
MOST_POINTS: Final = 10_000  # of an outline as it is stated
MOST_SHAPES: Final = 1_000
FINEST: Final = 5e-5  # [m], within which points of an outline are left out
ELLIPSE: Final = 64  # corners
HASH: Final = 6  # digits in a name


@dataclass(frozen=True)
class BodyOutline:
    """A body as its user states it."""

    shape: Shape  # about its centroid; a disk where both axes of an ellipse are equal
    radius: float  # circumscribed about the centroid [m]
    centre: Pair  # of the centroid in the user's frame of the body (x, y) [m]
    mended: tuple[str, ...] = ()  # what was changed in the user's outline, in words


# --- what users state -----------------------------------------------------------------------------


@dataclass(frozen=True)
class StatedBodies:
    """What a user's file states of bodies: their outlines by name, and the radius of the tool."""

    bodies: Mapping[str, BodyOutline]
    tip_radius: float | None = None


def read_stated(path: Path) -> StatedBodies:
    """Return the bodies of a JSON or YAML file: ``{"shapes": {name: [[x, y], ...]}}`` in metres.

    In place of an outline there may be ``{"semi_axes": [a, b]}``, of an ellipse; beside the shapes
    ``unit`` (only ``m``) and ``tip_radius`` [m]. Raises `DatasetError`, naming what is wrong.
    """
    content = _read(path)
    shapes = content.get(SHAPES) if isinstance(content, dict) else None
    if not isinstance(shapes, dict) or not 0 < len(shapes) <= MOST_SHAPES:
        raise DatasetError(
            f"{path} states no outlines; it needs {SHAPES}: a list of points [x, y] in metres, or"
            f" {SEMI_AXES}: [a, b], by the names of up to {MOST_SHAPES} bodies"
        )
    if content.get(UNIT, METRES) != METRES:
        raise DatasetError(f"{path} states outlines in {content[UNIT]!r}; give metres ({METRES!r})")
    radius = content.get(TIP_RADIUS)
    try:
        if radius is not None:
            radius = check_number(f"{path}: {TIP_RADIUS}", radius, *TIP_RADII, "m")
        named = {str(name): stated for name, stated in shapes.items()}
        bodies = {name: _stated(f"{path}: {name!r}", name, of) for name, of in named.items()}
    except ConfigError as error:
        raise DatasetError(str(error)) from error
    return StatedBodies(bodies, radius)


def _read(path: Path) -> Any:
    try:
        return read_json(path) if path.suffix == ".json" else read_yaml(path)
    except FileNotFoundError:
        raise DatasetError(f"{path} does not exist; it should state the outlines") from None
    except (OSError, UntrustedFileError) as error:
        raise DatasetError(f"{path} cannot be read: {error}") from error


def _stated(what: str, name: str, stated: object) -> BodyOutline:
    if isinstance(stated, dict):
        axes = np.array(check_numbers(f"{what}: {SEMI_AXES}", stated.get(SEMI_AXES), 2))
        if not (axes > 0.0).all():
            raise DatasetError(f"{what} needs {SEMI_AXES}: two positive numbers [m]")
        if axes[0] == axes[1]:
            _check_size(what, float(axes[0]))
            return BodyOutline(Disk(DISK), float(axes[0]), (0.0, 0.0))
        stretch = np.sqrt(2 * pi / (ELLIPSE * sin(2 * pi / ELLIPSE)))  # to the ellipse's area
        return trace(name, stretch * axes * unit(np.arange(ELLIPSE) * 2 * pi / ELLIPSE), what)
    if not isinstance(stated, list) or not 3 <= len(stated) <= MOST_POINTS:
        raise DatasetError(f"{what} is no outline: give 3 to {MOST_POINTS} points [x, y] in metres")
    points = [
        check_numbers(f"point {place} of {what}", point, 2)
        for place, point in enumerate(stated, start=1)
    ]
    return trace(name, np.array(points), what)


def trace(name: str, points: Points, what: str = "the outline") -> BodyOutline:
    """Return the body with an outline of points (M, 2) [m]; up to `FINEST` is left out.

    One that runs clockwise is turned round, and points that repeat the one before are left out.
    Raises `DatasetError`: it crosses itself, encloses nothing, or has a size that cannot be meant.
    """
    from shapely import Polygon

    if points.ndim != 2 or points.shape[1] != 2 or not 3 <= len(points) <= MOST_POINTS:
        raise DatasetError(
            f"{what} has points of shape {points.shape}; give 3 to {MOST_POINTS} points [x, y]"
        )
    _check_size(what, float(np.hypot(*(points - points.mean(axis=0)).T).max()))
    again = (points == np.roll(points, 1, axis=0)).all(axis=1)
    again[0] = False  # the last point may close the ring
    mended = [
        f"point {place + 1} repeats the one before: left out" for place in np.flatnonzero(again)
    ]
    points = points[~again]
    ring = Polygon(points) if len(points) > 2 else Polygon()
    if not ring.is_valid or ring.area < LEAST_RADIUS**2:
        raise DatasetError(f"{what} {_wrong_ring(points, ring)}")
    coarse = ring.simplify(FINEST)
    corners = np.array(coarse.exterior.coords)[:-1]
    if not coarse.exterior.is_ccw:
        corners = corners[::-1]
        mended.append("it runs clockwise: turned round")
    middle = centroid(corners)
    radius = float(np.hypot(*(corners - middle).T).max())
    _check_size(what, radius)
    scaled = tuple((x, y) for x, y in ((corners - middle) / radius).tolist())
    return BodyOutline(
        Prism(hashed_name(name, scaled), scaled),
        radius,
        (float(middle[0]), float(middle[1])),
        tuple(mended),
    )


def _wrong_ring(points: Points, ring: Any) -> str:
    """Return what is wrong with an outline: which sides cross, or that it encloses nothing."""
    from shapely import LineString, Point, is_valid_reason

    found = re.search(r"\[(\S+) (\S+)\]", is_valid_reason(ring))
    if ring.is_valid or not ring.convex_hull.area or found is None:
        return f"encloses nothing: its area is {1e6 * ring.area:.2g} mm^2, as of points in a line"
    place = Point(float(found[1]), float(found[2]))
    after = np.roll(points, -1, axis=0)
    sides = zip(points, after, strict=True)
    apart = [LineString([here, there]).distance(place) for here, there in sides]
    first, second = (
        f"{side + 1} to {(side + 1) % len(points) + 1}" for side in sorted(np.argsort(apart)[:2])
    )
    return (
        f"crosses itself at ({place.x:.4g}, {place.y:.4g}) m, where the sides from point {first}"
        f" and from {second} meet; give the points in order round the body"
    )


def _check_size(what: str, radius: float) -> None:
    if not LEAST_RADIUS <= radius <= MOST_RADIUS:
        in_metres = LEAST_RADIUS <= 1e-3 * radius <= MOST_RADIUS
        hint = ": it looks like millimetres" if radius > MOST_RADIUS and in_metres else ""
        raise DatasetError(
            f"{what} has a radius of {radius:.4g} m{hint}; allowed: {LEAST_RADIUS} to"
            f" {MOST_RADIUS} m"
        )


def hashed_name(name: str, corners: tuple[Pair, ...]) -> str:
    """Return the name of a shape: the user's, and a hash of its outline."""
    digest = hashlib.sha256(np.array(corners).tobytes()).hexdigest()[:HASH]
    plain = "".join(sign if sign.isalnum() or sign in "_." else "_" for sign in name)
    return f"{plain[: LONGEST_NAME - HASH - 1]}-{digest}"


# --- the file beside a data set -------------------------------------------------------------------


def write_outlines(folder: Path, shapes: Iterable[Shape]) -> None:
    """Write the outlines of traced shapes beside a data set; raises `OutputError`."""
    standing = (shape.on(FEET) for shape in shapes)
    prisms = [shape for shape in standing if isinstance(shape, Prism) and shape.is_traced]
    traced = {shape.name: shape.corners for shape in prisms}
    write_json(folder / OUTLINES_FILE, {UNIT: RADII, SHAPES: traced})


def stored_outlines(folder: Path) -> tuple[Prism, ...]:
    """Return the shapes of a data set, if it has any; raises `DatasetError`."""
    path = folder / OUTLINES_FILE
    if not path.exists():
        return ()
    try:
        return _stored(read_regular_text(path))
    except (OSError, ValueError, TypeError, KeyError, AttributeError, ConfigError) as error:
        raise DatasetError(f"{path} is damaged: {error}") from error


@lru_cache(maxsize=64)
def _stored(text: str) -> tuple[Prism, ...]:
    content = parse_json(text)
    return tuple(_checked(name, corners) for name, corners in content[SHAPES].items())


def _checked(name: str, corners: list[list[float]]) -> Prism:
    """Return a stored shape, if it is what `trace` makes."""
    from shapely import Polygon

    pairs = tuple((float(x), float(y)) for x, y in corners)
    outline = np.array(pairs)
    if len(pairs) > MOST_POINTS or name != hashed_name(name[: -HASH - 1], pairs):
        raise ValueError(f"the outline of {name!r} is not the one that its name was made from")
    reach, middle = np.hypot(*outline.T).max(), np.hypot(*centroid(outline))
    if not Polygon(outline).is_valid or abs(reach - 1.0) > TOLERANCE or middle > TOLERANCE:
        raise ValueError(f"the outline of {name!r} is not a simple one about its centroid")
    return Prism(name, pairs)
