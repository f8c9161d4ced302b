"""Bodies by their outlines: what a user states of them, and the file beside a data set of them.

What users state is a file of one body or of many, by name: `read_outlines`.

A data set names shapes. Those that only it has stand in its `OUTLINES_FILE`, and whoever reads the
data set can find them. A name ends with a hash of the outline, so no two outlines have one name.
"""

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import pi, sin
from pathlib import Path
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import check_number, check_numbers, check_text
from sain_core.errors import ConfigError, DatasetError, UntrustedFileError
from sain_core.guarding.documents import parse_json, read_json, read_yaml
from sain_core.guarding.plugins import did_you_mean
from sain_core.guarding.untrusted import (
    LEAST_RADIUS,
    LONGEST_NAME,
    MOST_PARTS,
    MOST_RADIUS,
    TIP_RADII,
    listed,
    read_regular_text,
)
from sain_core.output import write_json
from sain_core.scene import unit
from sain_core.shapes.shape import FEET, Pair, Shape
from sain_core.shapes.solids import DISK, TOLERANCE, Disk, Prism, centroid, convex_parts
from sain_core.types import Points

OUTLINES_FILE: Final = "outlines.json"
SHAPES: Final = "shapes"  # key of the outlines by name, in the user's files and in this one
UNIT: Final = "unit"
RADII: Final = "circumscribed radius"  # unit of this file
METRES: Final = "m"  # unit of the user's
TIP_RADIUS: Final = "tip_radius"  # [m], key in the user's files
SEMI_AXES: Final = "semi_axes"  # [m], of an ellipse
OUTLINE, HEIGHT, MASS = "outline", "height", "mass"  # [m], [m], [kg]
MASS_CENTRE: Final = "centre_of_mass"  # [m], from the centroid of the outline
FAIR: Final = "fair_2d"  # whether a body of constant cross-section stands for it
HOLES: Final = "holes"  # [m^2], that the outline leaves out
SLICES: Final = "slices"  # areas by height, as shares of the outline's
BODY_KEYS: Final = (OUTLINE, SEMI_AXES, HEIGHT, MASS, MASS_CENTRE, FAIR, HOLES, SLICES)
OBJECTS: Final = "objects"  # key of a list of bodies in the format of Push Anything, and its keys:
OBJECT_KEYS: Final = {
    "height_m": HEIGHT,
    "mass_kg_sdf": MASS,
    "com_uniform_density_minus_centroid_m": MASS_CENTRE,
    "fair_2d": FAIR,
    "holes_dropped_m2": HOLES,
    "slice_area_over_projection": SLICES,
}
OBJECT_OUTLINES: Final = ("outline_fine_m", "outline_m")  # the first that it has
YES, ROUGHLY, NO = FAIRNESS = ("yes", "roughly", "no")
FAIR_SHARES: Final = (0.9, 0.8)  # of the outline's area, of the least slice: yes; roughly
LEAST_MASS: Final = 0.001  # [kg]
MOST_MASS: Final = 100.0  # [kg]
MOST_HEIGHT: Final = 0.5  # [m]
MOST_OUTLINE: Final = 64  # corners of a shape
TOLERANCES: Final = (0.0005, 0.001, 0.0015, 0.002, 0.003, 0.005)  # [m], of corners left out
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
    height: float | None = None  # [m]; None: not stated
    mass: float | None = None  # [kg]
    mass_centre: Pair | None = None  # from the centroid [m]
    fair: str = ""  # whether a body of constant cross-section stands for it; "": not stated


# --- what users state -----------------------------------------------------------------------------


@dataclass(frozen=True)
class StatedBodies:
    """What a user's file states of bodies: their outlines by name, and the radius of the tool."""

    bodies: Mapping[str, BodyOutline]
    tip_radius: float | None = None


def read_stated(path: Path) -> StatedBodies:
    """Return the bodies of a JSON or YAML file: ``{"shapes": {name: [[x, y], ...]}}`` in metres.

    In place of an outline there may be a mapping with `BODY_KEYS`, of which it needs ``outline`` or
    ``semi_axes``, of an ellipse; beside the shapes ``unit`` (only ``m``) and ``tip_radius`` [m]. In
    place of shapes there may be ``objects`` in the format of Push Anything.

    Raises `DatasetError`, naming what is wrong.
    """
    content = _read(path)
    shapes = content.get(SHAPES) if isinstance(content, dict) else None
    if isinstance(content, dict) and OBJECTS in content:
        shapes = _objects(path, content[OBJECTS])
    if not isinstance(shapes, dict) or not 0 < len(shapes) <= MOST_SHAPES:
        raise DatasetError(
            f"{path} states no outlines; it needs {SHAPES}: a list of points [x, y] in metres, or"
            f" {SEMI_AXES}: [a, b], by the names of up to {MOST_SHAPES} bodies; or a list {OBJECTS}"
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


def read_outlines(path: Path) -> dict[str, BodyOutline]:
    """Return the bodies that `read_stated` finds in a file, by names such as ``letter_r``.

    None has more corners or convex parts than a shape may have: others are left out, within as
    little as does, and `mended` says so. Raises `DatasetError`.
    """
    bodies = read_stated(path).bodies
    names = _slugs(path, list(bodies))
    return {
        name: _few(f"{path}: {name!r}", name, body)
        for name, body in zip(names, bodies.values(), strict=True)
    }


def named_outlines(
    outlines: Mapping[str, BodyOutline], names: Iterable[str]
) -> tuple[BodyOutline, ...]:
    """Return the bodies of these names; raises `ConfigError`: there is none of a name."""
    names = tuple(names)
    for name in names:
        if name not in outlines:
            near = did_you_mean(name, outlines)
            raise ConfigError(f"body {name!r} is unknown{near}; known: {', '.join(outlines)}")
    return tuple(outlines[name] for name in names)


def fair_model(shares: Iterable[float]) -> str:
    """Return whether slices, as shares of the outline's area, are one cross-section."""
    least = min(shares)
    return next(
        (how for how, share in zip(FAIRNESS, FAIR_SHARES, strict=False) if least >= share), NO
    )


def _objects(path: Path, rows: object) -> dict[str, object]:
    """Return objects of Push Anything as the mappings of a user's file, by name."""
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise DatasetError(f"{path}: {OBJECTS} must be a list, of objects with name and outline")
    try:
        names = [
            check_text(f"{path}: name of object {number}", row.get("name"), most=MOST_POINTS)
            for number, row in enumerate(rows, start=1)
        ]
    except ConfigError as error:
        raise DatasetError(str(error)) from error
    stated: list[object] = []
    for row in rows:
        body = {ours: row[key] for key, ours in OBJECT_KEYS.items() if row.get(key) is not None}
        outline = next((row[key] for key in OBJECT_OUTLINES if row.get(key) is not None), None)
        stated.append(body | {OUTLINE: outline})
    return dict(zip(_slugs(path, names), stated, strict=True))


def _slugs(path: Path, names: list[str]) -> list[str]:
    """Return the names that bodies are given by; raises `DatasetError` for two of one name."""
    slugs = [slug_of(name) for name in names]
    for number, slug in enumerate(slugs):
        if not slug:
            raise DatasetError(f"{path}: a body is called {names[number]!r}; a name needs a letter")
        if slug in slugs[:number]:
            both = f"{names[slugs.index(slug)]!r} and {names[number]!r}"
            raise DatasetError(f"{path}: two bodies are called {slug}: {both}; rename one")
    return slugs


def slug_of(name: str) -> str:
    """Return a name of small letters, digits and '_'; what stands in brackets is left out."""
    return re.sub(r"\W+", "_", re.sub(r"\(.*?\)", "", name).lower()).strip("_")


def _few(what: str, name: str, body: BodyOutline) -> BodyOutline:
    if not isinstance(body.shape, Prism):
        return body
    outline = body.shape.outline(body.radius)
    if _is_shape(outline):
        return body
    corners, tolerance = few_corners(outline, what)
    left = trace(name, corners, what)
    note = f"corners within {1e3 * tolerance:g} mm are left out"
    return replace(body, shape=left.shape, radius=left.radius, mended=(*body.mended, note))


def few_corners(outline: Float[ndarray, "M 2"], what: str = "the outline") -> tuple[Points, float]:
    """Return an outline (M, 2) [m] with as few corners as a shape may have, counter-clockwise.

    Returns:
        It, and how far [m] the corners that were left out are off, at most.

    Raises:
        DatasetError: too many are left where it would not be the same any more.
    """
    from shapely import Polygon, get_parts

    ring = max(get_parts(Polygon(outline).buffer(0.0)), key=lambda part: part.area)
    for tolerance in TOLERANCES:
        coarse = ring.simplify(tolerance)
        corners = np.array(coarse.exterior.coords)[:-1]
        corners = corners if coarse.exterior.is_ccw else corners[::-1]
        if _is_shape(corners):
            return corners, tolerance
    raise DatasetError(
        f"{what} has {len(corners)} corners and {len(convex_parts(corners))} convex parts even"
        f" where {1e3 * tolerance:g} mm are left out; allowed: {MOST_OUTLINE} and {MOST_PARTS}. Is"
        " it one body, without much noise?"
    )


def _is_shape(corners: Points) -> bool:
    return len(corners) <= MOST_OUTLINE and len(convex_parts(corners)) <= MOST_PARTS


def _stated(what: str, name: str, stated: object) -> BodyOutline:
    if not isinstance(stated, dict):
        return _traced(what, name, stated)
    for key in stated:
        if key not in BODY_KEYS:
            near = did_you_mean(str(key), BODY_KEYS)
            raise DatasetError(f"{what} has {key!r}{near}; allowed: {', '.join(BODY_KEYS)}")
    about: dict[str, Any] = {}
    for key, low, high, unit_of in (
        (HEIGHT, LEAST_RADIUS, MOST_HEIGHT, "m"),
        (MASS, LEAST_MASS, MOST_MASS, "kg"),
    ):
        if stated.get(key) is not None:
            about[key] = check_number(f"{what}: {key}", stated[key], low, high, unit_of)
    if (centre := stated.get(MASS_CENTRE)) is not None:
        x, y = check_numbers(f"{what}: {MASS_CENTRE}", centre, 2, MOST_RADIUS, "m")
        about["mass_centre"] = (x, y)
    body = replace(
        _traced(what, name, stated.get(OUTLINE, stated)),
        fair=_fairness(what, stated),
        **about,
    )
    holes = check_numbers(f"{what}: {HOLES}", stated.get(HOLES, []), None)
    if holes:
        areas = listed(f"{1e4 * hole:.1f}" for hole in holes)
        body = replace(body, mended=(*body.mended, f"holes of {areas} cm^2 are filled"))
    return body


def _fairness(what: str, stated: dict[str, Any]) -> str:
    """Return whether a body is a fair one, as it is stated or by its slices."""
    fair = stated.get(FAIR, "")
    fair = {True: YES, False: NO}.get(fair, fair) if isinstance(fair, bool) else fair  # of YAML
    if fair not in ("", *FAIRNESS):
        raise DatasetError(f"{what}: {FAIR} is {fair!r}; allowed: {', '.join(FAIRNESS)}")
    slices = stated.get(SLICES)
    if fair or not slices:
        return str(fair)
    if not isinstance(slices, dict):
        raise DatasetError(f"{what}: {SLICES} is {slices!r}; give shares by height in percent")
    return fair_model(check_numbers(f"{what}: {SLICES}", list(slices.values()), None))


def _traced(what: str, name: str, stated: object) -> BodyOutline:
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
    try:
        return read_stored(read_regular_text(path), path) if path.exists() else ()
    except (OSError, UntrustedFileError) as error:
        raise DatasetError(f"{path} is damaged: {error}") from error


def read_stored(text: str, where: object) -> tuple[Prism, ...]:
    """Return the shapes that the text of an `OUTLINES_FILE` states; raises `DatasetError`."""
    try:
        return _stored(text)
    except (ValueError, TypeError, KeyError, AttributeError, ConfigError) as error:
        raise DatasetError(f"{where} is damaged: {error}") from error


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
