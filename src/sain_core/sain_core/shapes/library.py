"""Shapes by name: disk and cube, the library of straight-sided bodies, and those of other packages.

`docs/explanation/shapes.md` has the library in one picture; each has a circumscribed radius of 1.
Other packages offer shapes through entry points, which lead to instances of their name::

    entry_points={"sain.shapes": ["my_hexagon = my_package:HEXAGON"]}

Users state outlines in files, as `read_outlines` reads them. A file of one is given by its path, in
a file of many ``FILE:NAME`` is one; those in `outline_folder` are given by name.
"""

import logging
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache, lru_cache
from itertools import pairwise
from math import cos, pi, sin
from pathlib import Path
from typing import Final

import numpy as np

from sain_core.errors import ConfigError, DatasetError, InvalidInputError
from sain_core.guarding.plugins import Plugins, did_you_mean
from sain_core.guarding.untrusted import reason_of
from sain_core.shapes.outlines import (
    HASH,
    BodyOutline,
    named_outlines,
    read_outlines,
    stored_outlines,
)
from sain_core.shapes.shape import FLAT, FLAT_MARK, Pair, Shape
from sain_core.shapes.solids import CUBE, DISK, Disk, Prism

RANDOM_CORNERS: Final = (5, 6, 7, 8, 9, 10)  # of the random polygons, by seed
LEAST_GAP: Final = 0.35  # [rad], between two corners of a random polygon


def _box(width: float, depth: float, x: float = 0.0, y: float = 0.0) -> tuple[Pair, ...]:
    """Return a box whose lower left corner is at (x, y)."""
    return (x, y), (x + width, y), (x + width, y + depth), (x, y + depth)


def _arc(start: float, end: float, sides: int, radius: float = 1.0) -> tuple[Pair, ...]:
    """Return points on a circle from one bearing [rad] to another."""
    bearings = np.linspace(start, end, sides + 1)
    return tuple((radius * cos(b), radius * sin(b)) for b in bearings.tolist())


def _clipped_box(width: float, depth: float, cut: float) -> tuple[Pair, ...]:
    """Return a box without its four corners."""
    low, high = depth - cut, width - cut
    return (
        (cut, 0), (high, 0), (width, cut), (width, low),
        (high, depth), (cut, depth), (0, low), (0, cut),
    )  # fmt: skip


def _ellipse(width: float, depth: float) -> tuple[Pair, ...]:
    return tuple((width * x, depth * y) for x, y in _arc(0.0, 2 * pi, 24)[:-1])


def _ring_segment(start: float, end: float, inner: float, sides: int) -> list[tuple[Pair, ...]]:
    """Return the parts of a ring between two bearings [rad]; its outer radius is 1."""
    outside, inside = _arc(start, end, sides), _arc(start, end, sides, inner)
    pieces = zip(pairwise(outside), pairwise(inside), strict=True)
    return [(far, after, before, near) for (far, after), (near, before) in pieces]


def _star(points: int, inner: float) -> list[tuple[Pair, ...]]:
    """Return a regular polygon of a radius `inner`, and a spike to radius 1 on each side."""
    middle = _arc(0.0, 2 * pi, points, inner)
    tips = _arc(pi / points, 2 * pi + pi / points, points)
    spikes = [
        (here, tip, after) for (here, after), tip in zip(pairwise(middle), tips, strict=False)
    ]
    return [middle[:-1], *spikes]


def _random_polygon(seed: int, count: int) -> tuple[Pair, ...]:
    """Return a polygon with corners on a circle at random, so that it is convex."""
    gaps = np.random.default_rng(seed).dirichlet(np.ones(count))
    bearings = np.cumsum(LEAST_GAP + (2 * pi - count * LEAST_GAP) * gaps)
    return tuple((cos(b), sin(b)) for b in bearings.tolist())


@cache
def library() -> tuple[Shape, ...]:
    """Return the library; only when it is needed, since its outlines take 0.3 s."""
    return (
        Prism.of("square", _box(1, 1)),
        Prism.of("box_3x2", _box(3, 2)),
        Prism.of("box_2x1", _box(2, 1)),
        Prism.of("box_3x1", _box(3, 1)),
        Prism.of("bar", _box(5, 1)),
        Prism.of("butter", _clipped_box(2.4, 1, 0.1)),
        Prism.of("triangle", _arc(0, 2 * pi, 3)[:-1]),
        Prism.of("right_triangle", ((0, 0), (4, 0), (0, 3))),
        Prism.of("wedge", ((0, 0), (4, 0), (2, 1.3))),
        Prism.of("spire", ((0, 0), (2, 0), (1, 3))),
        Prism.of("pentagon", _arc(0, 2 * pi, 5)[:-1]),
        Prism.of("hexagon", _arc(0, 2 * pi, 6)[:-1]),
        Prism.of("octagon", _arc(0, 2 * pi, 8)[:-1]),
        Prism.of("ellipse", _ellipse(1, 0.5)),
        Prism.of("oval", _ellipse(1, 0.7)),
        Prism.of("half_disk", _arc(0, pi, 12)),
        Prism.of("quarter_disk", ((0, 0), *_arc(0, pi / 2, 9))),
        Prism.of("trapezoid", ((0, 0), (4, 0), (3, 2), (1, 2))),
        Prism.of("parallelogram", ((0, 0), (3, 0), (4, 2), (1, 2))),
        Prism.of("rhombus", ((2, 0), (0, 1.2), (-2, 0), (0, -1.2))),
        Prism.of("kite", ((0, 0), (1.2, 1), (0, 3), (-1.2, 1))),
        Prism.of("t", _box(4, 1, y=3), _box(1, 3, x=1.5)),  # the proportions of Push-T
        Prism.of("l", _box(1, 4), _box(2, 1, x=1)),
        Prism.of("corner", _box(1, 3), _box(2, 1, x=1)),
        Prism.of("u", _box(4, 1), _box(1, 2, y=1), _box(1, 2, x=3, y=1)),
        Prism.of("z", _box(2, 1, x=1), _box(2, 1, y=1)),
        Prism.of("h", _box(1, 3), _box(1, 1, x=1, y=1), _box(1, 3, x=2)),
        Prism.of("plus", _box(1, 1, x=1), _box(3, 1, y=1), _box(1, 1, x=1, y=2)),
        Prism.of("star", *_star(5, 0.5)),
        Prism.of("star_6", *_star(6, 0.6)),
        Prism.of("arrow", _box(2, 1, y=0.5), ((2, 0), (3.5, 1), (2, 2))),
        Prism.of("ring_segment", *_ring_segment(-pi / 3, pi / 3, 0.6, 5)),
        Prism.of("half_ring", *_ring_segment(-pi / 2, pi / 2, 0.55, 7)),
        *(
            Prism.of(f"random_{seed}", _random_polygon(seed, count))
            for seed, count in enumerate(RANDOM_CORNERS)
        ),
    )


log = logging.getLogger(__name__)
GROUP: Final = "sain.shapes"
OUTLINES: Final = (".yaml", ".json")
PLAIN: Final = re.compile(r"\w[\w.-]{0,63}(?<!\.yaml)(?<!\.json)")  # name of an outline file
IN_FILE: Final = re.compile(r"(.*?\.(?:yaml|json))(?::(\w+))?")  # file and body
ALIKE: Final = 0.7  # of the letters: `disk` is no slip of `half_disk`
OFFERED: Final = Plugins(GROUP, "shape")
_shapes: dict[str, Shape] = {shape.name: shape for shape in (Disk(DISK), CUBE)}
_flat: dict[str, Shape] = {}  # those that were asked for, by their names
_failed: dict[str, str] = {}  # offered shapes that cannot be used, and why


def register(shape: Shape) -> None:
    """Let a shape be found by its name in this process; raises `ConfigError`: it is taken."""
    if shape.lies_flat:
        raise ConfigError(
            f"a shape has the name {shape.name!r}; offer it without {FLAT_MARK!r}: both bottoms are"
            " made of it"
        )
    if _shapes.setdefault(shape.name, shape) != shape:
        raise ConfigError(f"two shapes have the name {shape.name!r}; rename one of them")


def shape_names() -> list[str]:
    """Return the names of all shapes."""
    _load_library()
    own = (path.stem for path in outline_folder().glob(f"*{OUTLINES[0]}"))
    return list(dict.fromkeys((*_shapes, *sorted(own))))


def get_shape(name: str, body: int | None = None) -> Shape:
    """Return the shape of this name; raises `ConfigError`: there is none.

    With ``:flat`` at the end, it is the shape of the name before, on a flat bottom.
    """
    if name.endswith(FLAT_MARK) and name.count(FLAT_MARK) == 1:
        if name not in _flat:
            _flat[name] = get_shape(name.removesuffix(FLAT_MARK), body).on(FLAT)
        return _flat[name]
    for load in (_load_library, _load_offered):
        if name not in _shapes:
            load()
    if name in _shapes:
        return _shapes[name]
    if (own := own_body(name)) is not None:
        return own.shape
    if name in _failed:
        raise ConfigError(_failed[name])
    what = "shape" if body is None else f"shape of body {body}"
    near = did_you_mean(name, [*_shapes, *(one + FLAT_MARK for one in _shapes)], ALIKE)
    raise ConfigError(f"{what} is {name!r}{near}; allowed: {', '.join(_shapes)}")


def check_shapes(names: Iterable[str]) -> tuple[str, ...]:
    """Return names of shapes as they are today; raise `InvalidInputError` where one is unknown.

    Names come from others: a path is none.
    """
    given = tuple(names)
    for body, name in enumerate(given):
        if "/" in name:
            raise InvalidInputError(f"shape of body {body} is a path, {name!r}; give a name")
    try:
        return tuple(get_shape(name, body).name for body, name in enumerate(given))
    except ConfigError as error:
        raise InvalidInputError(str(error)) from error


def outline_folder() -> Path:
    """Return the folder with this user's outlines, by their names."""
    home = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(home) / "sain" / "shapes"


def register_outlines(folder: Path) -> None:
    """Let the shapes of a data set be found by their names; raises `DatasetError`."""
    register_all(stored_outlines(folder), folder)


def register_all(shapes: Iterable[Shape], where: object) -> None:
    """Let shapes that a place states be found by their names; raises `DatasetError`."""
    for shape in shapes:
        try:
            register(shape)
        except ConfigError as error:
            raise DatasetError(f"the outlines in {where} cannot be used: {error}") from error


def own_body(name: str) -> BodyOutline | None:
    """Return a body of a user's outline file; None: there is none of this name."""
    stated = IN_FILE.fullmatch(name)
    if stated or "/" in name:
        file, body = (stated[1], stated[2] or "") if stated else (name, "")
        return _read(name, Path(file).expanduser(), body)
    for stem in (name, name[: -HASH - 1]):  # as it is called, or as messages and files have it
        path = outline_folder() / f"{stem}{OUTLINES[0]}"
        if PLAIN.fullmatch(stem) and path.is_file():
            own = _read(name, path)
            return own if name in (stem, own.shape.name) else None  # another one since
    return None


def own_bodies(path: Path | None = None) -> Mapping[str, BodyOutline]:
    """Return the bodies of a file of outlines by their names; without one, all of this user.

    Raises `DatasetError`: it cannot be read; `ConfigError`: one of the user's own cannot.
    """
    if path is None:
        names = sorted(one.stem for one in outline_folder().glob(f"*{OUTLINES[0]}"))
        return {name: body for name in names if (body := own_body(name)) is not None}
    try:
        return _read_bodies(path, path.stat().st_mtime_ns)
    except OSError as error:
        raise DatasetError(f"{path} cannot be read: {reason_of(error)}") from error


def _read(name: str, path: Path, body: str = "") -> BodyOutline:
    try:
        return _read_body(path, body, path.stat().st_mtime_ns)
    except (OSError, DatasetError, ConfigError) as error:
        raise ConfigError(f"shape {name!r} is not read: {error}") from error


@lru_cache(maxsize=8)
def _read_bodies(path: Path, _changed: int) -> Mapping[str, BodyOutline]:
    return read_outlines(path)


@lru_cache(maxsize=64)
def _read_body(path: Path, name: str, _changed: int) -> BodyOutline:
    """Return a body of a file, by its name or as the only one; raises `DatasetError`."""
    bodies = own_bodies(path)
    if not name and len(bodies) != 1:
        first = next(iter(bodies))
        raise DatasetError(
            f"{path} states {len(bodies)} shapes; it must state one, or name one as"
            f" '{path}:{first}'"
        )
    (body,) = named_outlines(bodies, [name]) if name else bodies.values()
    for note in body.mended:
        log.warning("%s: %r: %s", path, name or next(iter(bodies)), note)
    return replace(body, shape=_shapes.setdefault(body.shape.name, body.shape))


@cache
def _load_library() -> None:
    for shape in library():
        register(shape)


@cache
def _load_offered() -> None:
    """Register what installed packages offer; once, since it takes a tenth of a second.

    A package that fails does not disturb the others: only who asks for its shape hears of it.
    """
    for name, entries in OFFERED.entries().items():
        try:
            entry = OFFERED.only(name, entries)
            shape = OFFERED.load(entry)
            if not isinstance(shape, Shape):
                kind = type(shape).__name__
                raise OFFERED.wrong(entry, f"{entry.value} is a {kind}; it must be a Shape")
            if shape.name != name:
                called = f"{entry.value} has the name {shape.name!r}"
                raise OFFERED.wrong(entry, f"{called}; entry point and shape must have one name")
            register(shape)
        except ConfigError as error:
            _failed[name] = str(error)
