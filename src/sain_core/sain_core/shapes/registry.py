"""Shapes by name.

A new shape is a line in `sain_core.shapes.library`. Another package
offers shapes through entry points in the group ``sain.shapes``, which lead to instances of their
name::

    entry_points={"sain.shapes": ["my_hexagon = my_package:HEXAGON"]}
"""

from collections import ChainMap
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import import_module
from typing import Final

from sain_core.errors import ConfigError, InvalidInputError, SainError
from sain_core.extensions.offers import Offers, did_you_mean
from sain_core.shapes import cube, disk
from sain_core.shapes.disk import DISK
from sain_core.shapes.shape import Shape

GROUP: Final = "sain.shapes"
ALIKE: Final = 0.7  # of the letters: `disk` is no slip of `half_disk`
OFFERS: Final = Offers(GROUP, "shape")
_BUILT_IN: Final = (*disk.SHAPES, *cube.SHAPES)
_shapes: dict[str, Shape] = {}
_footprints: dict[str, Shape] = {}  # the usual shape of each
_failed: dict[str, str] = {}  # offered shapes that cannot be used, and why
_all: Final = ChainMap(_shapes, _footprints)


def register(shape: Shape) -> None:
    """Let a shape be found by its name in this process.

    Raises:
        ConfigError: another shape or footprint has its name.
    """
    if _all.get(shape.name, shape) != shape:
        raise ConfigError(f"two shapes have the name {shape.name!r}; rename one of them")
    _shapes[shape.name] = shape
    _footprints.setdefault(shape.footprint, shape)


def shape_names() -> list[str]:
    """Return the names of all shapes, as a world is made of them."""
    _load_library()
    return list(_shapes)


def footprint_names() -> list[str]:
    """Return the names of all footprints, as requests and scenarios ask for them."""
    _load_library()
    return list(_footprints)


def get_shape(name: str, body: int | None = None) -> Shape:
    """Return the shape of this name, or the usual one with this footprint.

    Raises:
        ConfigError: there is neither; it names the body, if there is one.
    """
    return _find(name, _all, what=_shape_of(body))


def check_shape(name: str, body: int | None = None) -> None:
    """Check that a world can be made of a shape: a footprint does not say how it stands.

    Raises:
        ConfigError: no shape has this name; it names the body, if there is one.
    """
    _find(name, _shapes, what=_shape_of(body))


def check_footprint(name: str) -> None:
    """Check that a footprint exists.

    Raises:
        InvalidInputError: no shape has it.
    """
    _find(name, _footprints, InvalidInputError)


def built_shapes(footprints: Iterable[str], disk_shape: str) -> tuple[str, ...]:
    """Return the names of the shapes for some footprints; `disk_shape` is the one for disks.

    Raises:
        InvalidInputError: a footprint that does not exist, and of which body.
    """
    shapes = [
        _find(footprint, _footprints, InvalidInputError, _shape_of(body))
        for body, footprint in enumerate(footprints)
    ]
    return tuple(disk_shape if shape.footprint == DISK else shape.name for shape in shapes)


def _shape_of(body: int | None) -> str:
    return "shape" if body is None else f"shape of body {body}"


def _find(
    name: str,
    known: Mapping[str, Shape],
    error: type[SainError] = ConfigError,
    what: str = "shape",
) -> Shape:
    if name not in known:
        _load_library()
    if name not in known:
        _load_offered()
    if name not in known:
        if name in _failed:
            raise error(_failed[name])
        near = did_you_mean(name, known, ALIKE)
        raise error(f"{what} is {name!r}{near}; allowed: {', '.join(known)}")
    return known[name]


@cache
def _load_library() -> None:
    """Register the library; only when it is needed, since its outlines take 0.3 s."""
    for shape in import_module("sain_core.shapes.library").SHAPES:
        register(shape)


@cache
def _load_offered() -> None:
    """Register what installed packages offer; once, since it takes a tenth of a second.

    A package that fails does not disturb the others: only who asks for its shape hears of it.
    """
    for name, entries in OFFERS.entries().items():
        try:
            entry = OFFERS.only(name, entries)
            shape = OFFERS.load(entry)
            if not isinstance(shape, Shape):
                kind = type(shape).__name__
                raise OFFERS.wrong(entry, f"{entry.value} is a {kind}; it must be a Shape")
            if shape.name != name:
                called = f"{entry.value} has the name {shape.name!r}"
                raise OFFERS.wrong(entry, f"{called}; entry point and shape must have one name")
            register(shape)
        except ConfigError as error:
            _failed[name] = str(error)


for _shape in _BUILT_IN:
    register(_shape)
