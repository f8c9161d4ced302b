"""Shards of data sets, each read and checked once, for whoever reads one that others made."""

from collections.abc import Mapping
from math import isnan
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy import ndarray

from sain_core.errors import DatasetError, InvalidInputError, OutOfRangeError
from sain_core.guarding.untrusted import BODIES, LARGEST_NUMBER
from sain_core.push import BODY, PUSH_SIZE, STROKE_SIZE, check_predictable, is_stroke
from sain_core.scene import MASS, RADIUS, STATE_NAMES, STATE_SIZE
from sain_core.shapes.bodies import as_names
from sain_core.shapes.library import register_outlines
from sain_core.storage import read_arrays
from sain_core.transitions import (
    FLAT,
    LIMITS,
    NEEDED,
    ORIGINS,
    SAME_KIND,
    SHAPED,
    Column,
    Columns,
    as_scenes,
    changed_kinds,
    row_bodies,
)

# Columns with the values that they have where a shard lacks them; if that is NaN, NaN is allowed.
Values = Mapping[Column, float | str]

NO_STEP: Final = -1  # where a shard does not tell
UNKNOWN: Final[Values] = {
    Column.FRICTION: np.nan, Column.FLOOR_NEXT: np.nan, Column.STEP: NO_STEP,
    **dict.fromkeys(ORIGINS, ""),
}  # fmt: skip

KINDS: Final = {  # of NumPy, by the types of the schema
    "float64": ("fiu", "real numbers"),
    "int64": ("iu", "integers"),
    "uint64": ("iu", "integers"),
    "bool": ("b", "true or false"),
    "str": ("U", "text"),
}


def read_shard(path: Path, more: Values = MappingProxyType({})) -> Columns:
    """Read and check one shard; states come back as (M, N, 8), with shapes and roles of each row.

    Shapes may be those whose outlines stand beside the shard. Besides what is needed and `UNKNOWN`,
    the columns of `more` are read.

    Raises `DatasetError`: a damaged shard, a missing column, no rows, arrays that do not fit
    together, NaN or Inf, a number that cannot be, pushes that no model may be asked about, or
    against bodies that are not pushable.
    """
    arrays = read_arrays(path)
    try:
        columns = _checked_columns(arrays, {**UNKNOWN, **more})
        register_outlines(path.parent)
        return columns | _shaped(arrays, columns[Column.ACTION])
    except InvalidInputError as error:
        raise DatasetError(
            f"{path}: action cannot be: {error}; make files of another version again"
        ) from error
    except (OutOfRangeError, DatasetError) as error:
        raise DatasetError(f"{path}: {error}") from error


def _checked_columns(arrays: Columns, unknown: Values) -> Columns:
    if missing := [column for column in NEEDED if column not in arrays]:
        raise DatasetError(f"it lacks {', '.join(missing)}; it holds {sorted(arrays)}")
    if arrays[Column.ACTION].ndim == 0 or not len(arrays[Column.ACTION]):
        raise DatasetError("it holds no transitions")
    count = len(arrays[Column.ACTION])
    _check_types(arrays, count)
    disks = _disks(arrays[Column.STATE], count)
    width = STROKE_SIZE if is_stroke(arrays[Column.ACTION]) else PUSH_SIZE
    columns: Columns = {}
    for column in (*NEEDED, *unknown):
        shape = (count, *column.row_shape(disks, width))
        otherwise = unknown.get(column, "")
        values = arrays.get(column, np.full(shape, otherwise))
        may_be_nan = isinstance(otherwise, float) and isnan(otherwise)
        columns[column] = _checked(column, values, shape, may_be_nan)
    _check_positive(arrays, columns)
    _check_scenes(columns)
    check_predictable(columns[Column.ACTION])
    return columns


def _check_types(arrays: Columns, count: int) -> None:
    """Raise `DatasetError` where a column has values of another kind than the schema's."""
    for column in filter(arrays.__contains__, Column):
        values, (kinds, wanted) = arrays[column], KINDS[column.dtype]
        if values.dtype.kind not in kinds:
            kind = f"{values.dtype}; it should be {wanted}"
            raise DatasetError(f"{column} is {kind}")
        if values.ndim == 0 or len(values) != count:
            size = f"shape {values.shape}; it should have {count} rows, as action has"
            raise DatasetError(f"{column} has {size}")


def _check_positive(arrays: Columns, columns: Columns) -> None:
    """Raise `DatasetError` where a mass or a radius is not positive."""
    scenes = (Column.STATE, Column.NEXT_STATE, Column.PHYSICS_NEXT)
    found = {column: columns[column][..., [MASS, RADIUS]] for column in scenes}
    found |= {
        column: arrays[column] for column in (Column.MASSES, Column.RADII) if column in arrays
    }
    for column, values in found.items():
        if not (wrong := ~(values > 0.0)).any():
            continue
        row, *_ = place = tuple(np.argwhere(wrong)[0])
        what = "a mass or radius of" if column in scenes else "the value"
        raise DatasetError(
            f"row {row} of {column} has {what} {values[place]:g}; it must be positive"
        )


def _check_scenes(columns: Columns) -> None:
    """Raise `DatasetError` where a scene is in other units, or a push changes mass or radius."""
    for column in (Column.STATE, Column.NEXT_STATE):
        for place, (least, most) in LIMITS.items():
            values = columns[column][..., place]
            for row, body in np.argwhere((values < least) | (values > most)):
                raise DatasetError(
                    f"row {row} of {column}: {STATE_NAMES[place]} of body {body} is"
                    f" {values[row, body]:g}; allowed: {least:g} to {most:g}; lengths are in m,"
                    " masses in kg"
                )
    changed = changed_kinds(columns[Column.STATE], columns[Column.NEXT_STATE])
    for row, body, place in np.argwhere(changed > SAME_KIND):
        raise DatasetError(
            f"row {row}: {('mass', 'radius')[place]} of body {body} differs by"
            f" {100 * changed[row, body, place]:.1f} % between state and next_state; allowed:"
            f" {100 * SAME_KIND:g} %"
        )


def _shaped(arrays: Columns, action: ndarray) -> Columns:
    """Return shapes and roles of each row as text; each push is against a pushable body."""
    bodies = row_bodies(arrays)
    if Column.SHAPES in arrays and Column.ROLES in arrays:
        names: Columns = {column: arrays[column] for column in SHAPED}
    else:
        texts = np.array([as_names(some) for some in bodies])
        names = dict(zip(SHAPED, texts.T, strict=True))
    for row, (body, some) in enumerate(zip(action[:, BODY].tolist(), bodies, strict=True)):
        if body not in some.pushable:
            raise DatasetError(
                f"row {row} pushes body {body:g}; pushable are"
                f" {', '.join(map(str, some.pushable))} of {len(some)} bodies"
            )
    return names


def _disks(states: ndarray, count: int) -> int:
    """Return the number of disks N of states (M, 8 N) or (M, N, 8)."""
    disks, rest = divmod(states.size, STATE_SIZE * count)
    if states.ndim not in (2, 3) or rest:
        raise DatasetError(f"state has shape {states.shape}; it should be ({count}, N * 8)")
    if disks > BODIES:
        raise DatasetError(f"state has {disks} disks; it may have {BODIES}")
    if not disks:
        raise DatasetError("state has no bodies; it needs one or more")
    return disks


def _checked(column: Column, values: ndarray, shape: tuple[int, ...], may_be_nan: bool) -> ndarray:
    """Return a column when its shape, type and numbers are as the schema has them."""
    if FLAT in column.shape and values.ndim == 3:
        values = values.reshape(len(values), -1)
    if values.shape != shape:
        raise DatasetError(f"{column} has shape {values.shape}; it should be {shape}")
    if column.dtype != "float64":
        return values.astype(column.dtype)
    numbers = np.asarray(values, dtype=np.float64)
    allowed = np.isfinite(numbers)
    if (np.abs(numbers[allowed]) > LARGEST_NUMBER).any():
        most = np.abs(numbers[allowed]).max()
        raise DatasetError(f"{column} holds {most:g}; it may hold {LARGEST_NUMBER:g}")
    if may_be_nan:
        allowed |= np.isnan(numbers)
    if not allowed.all():
        row = int(np.argwhere(~allowed)[0][0])
        found = "Inf" if may_be_nan else "NaN or Inf"
        raise DatasetError(f"row {row} of {column} holds {found}")
    if column is Column.FRICTION and (numbers <= 0.0).any():
        row = int(np.argmax(numbers <= 0.0))
        raise DatasetError(
            f"row {row} of {column} is {numbers[row]}; positive, or NaN where not known"
        )
    return as_scenes(numbers) if FLAT in column.shape else numbers
