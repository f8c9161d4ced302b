"""Bodies as the text of a data set: names of shapes and roles, with commas between."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Final

import numpy as np
from numpy import ndarray

from sain_core.errors import ConfigError, DatasetError
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.disk import DISK
from sain_core.shapes.registry import footprint_names

BETWEEN: Final = ","
MARKS: Final = "s"  # ends a column (N,) of older data sets that states which bodies are ``cubes``


def as_names(bodies: Bodies) -> tuple[str, str]:
    """Return the shapes and the roles of bodies."""
    return BETWEEN.join(shape.footprint for shape in bodies.shapes), BETWEEN.join(bodies.roles)


@lru_cache(maxsize=1024)
def bodies_named(shapes: str, roles: str, count: int) -> Bodies:
    """Return so many bodies by the names of shapes and roles; no roles are the paper's.

    Raises:
        DatasetError: shapes or roles that do not exist, or not one for each body.
    """
    try:
        bodies = Bodies.named(shapes.split(BETWEEN), roles.split(BETWEEN) if roles else ())
    except ConfigError as error:
        raise DatasetError(f"the bodies {shapes!r} cannot be: {error}") from error
    if len(bodies) != count:
        raise DatasetError(f"{shapes!r} are {len(bodies)} shapes; the scenes have {count} bodies")
    return bodies


def marked_bodies(columns: Mapping[str, ndarray], roles: list[str], count: int) -> list[Bodies]:
    """Return the bodies of rows of which columns mark those that are no disks."""
    names = np.full((len(roles), count), DISK, dtype=object)
    for name in footprint_names() if any(key.endswith(MARKS) for key in columns) else ():
        if f"{name}{MARKS}" in columns:
            names[np.asarray(columns[f"{name}{MARKS}"], dtype=bool)] = name
    named = zip(names, roles, strict=True)
    return [bodies_named(BETWEEN.join(row), role, count) for row, role in named]
