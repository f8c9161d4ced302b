"""The schema of a data set: every column of a transition, its shape, type, unit and meaning.

A row is one push. Collector, converter, loader, cards, the export formats and the table in
docs/reference/formats.md are made from `Column`. No other module writes a column's name. Shards of
others are read here alone, and checked.

Data sets are npz shards of 1,000 rows, as in the paper (section III-B c). Episodes are never
divided between the parts of a split: pushes of one episode share friction, masses and radii.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.errors import DatasetError, InvalidInputError, OutOfRangeError
from sain_core.guarding.kinds import describe
from sain_core.guarding.untrusted import BODIES, LARGEST_NUMBER, LEAST_RADIUS, MOST_RADIUS
from sain_core.push import BODY, PUSH_SIZE, STROKE_SIZE, check_predictable, is_stroke
from sain_core.randomness import generator
from sain_core.scene import MASS, POSITION, RADIUS, STATE_NAMES, STATE_SIZE, TARGET, X, Y
from sain_core.shapes.bodies import BETWEEN, Bodies, as_names, bodies_named
from sain_core.shapes.library import register_outlines
from sain_core.shapes.outlines import MOST_MASS
from sain_core.shapes.solids import DISK
from sain_core.storage import read_arrays
from sain_core.types import Indices, Mask, Points, PushArray, Scene, Scenes

SHARD_SIZE: Final = 1000  # transitions, as in the paper
SHARD_PATTERN: Final = f"shard-{5 * '[0-9]'}.npz"
MOVED: Final = 0.002  # [m], the paper's threshold for a target that moved (section III-B b)

TRAIN, VALIDATION, TEST = PARTS = ("train", "validation", "test")
SEED: Final = 0  # default of the split
SHARES: Final = {VALIDATION: 0.1, TEST: 0.15}  # of the episodes, by default

FLAT: Final = "8 N"  # a scene (N, 8), row by row
WIDTHS: Final = f"{PUSH_SIZE} or {STROKE_SIZE}"  # numbers of a push, the same in all rows
DISKS: Final = "N"
ROUGH: Final = "rough_"  # prefix of the columns of a rough world; their shapes are the world's

Row = Mapping[str, Any]  # one transition: a value for each column
Columns = dict[str, ndarray]  # many: an array (M, ...) for each


class Presence(StrEnum):
    """Whether a kind of data set has a column."""

    ALWAYS = "always"
    SOMETIMES = "optional"
    NEVER = "no"


ALWAYS, SOMETIMES, NEVER = Presence


class Column(StrEnum):
    """A column; its value is its name on disk, and the order is that on disk.

    Attributes:
        shape: of one row; N disks.
        dtype: NumPy's name of the type; `str` for text.
        unit: empty for numbers without one.
        meaning: one phrase for the documentation.
        collected: whether `sain_sim collect` writes it.
        recorded: whether `sain_bags to_dataset` writes it.
        imported: whether `sain_model real_import` writes it: by default what both others do.
    """

    shape: tuple[int | str, ...]
    dtype: str
    unit: str
    meaning: str
    collected: Presence
    recorded: Presence
    imported: Presence

    def __new__(
        cls,
        name: str,
        shape: tuple[int | str, ...],
        dtype: str,
        unit: str,
        meaning: str,
        collected: Presence = ALWAYS,
        recorded: Presence = ALWAYS,
        imported: Presence | None = None,
    ) -> "Column":
        """Make a column that is equal to its name."""
        column = str.__new__(cls, name)
        column._value_ = name
        column.shape, column.dtype, column.unit = shape, dtype, unit
        column.meaning, column.collected, column.recorded = meaning, collected, recorded
        always = collected is ALWAYS and recorded is ALWAYS
        column.imported = imported or (ALWAYS if always else NEVER)
        return column

    # fmt: off
    STATE = ("state", (FLAT,), "float64", "m, rad, m/s, rad/s, kg",
             "scene before the push: x, y, theta, vx, vy, omega, mass, radius of each disk")
    ACTION = ("action", (WIDTHS,), "float64", "rad, m, m/s",
              "the push: body, location, angle, length, speed; of a stroke, location + angle is its"
              " heading, then the tool's start x, y, radius, x, y to its second disk, and bar")
    PHYSICS_NEXT = ("physics_next", (FLAT,), "float64", "as `state`",
                    "scene after the push as physics predicts it, f_p(s, a)")
    NEXT_STATE = "next_state", (FLAT,), "float64", "as `state`", "scene after the push"
    FLOOR_NEXT = ("floor_next", (FLAT,), "float64", "as `state`",
                  "the same push with the true parameters; NaN: not repeated", ALWAYS, NEVER)
    EPISODE = "episode", (), "int64", "", "episode, counted over the data set"
    STEP = "step", (), "int64", "", "place of the push in its episode"
    SEED = "seed", (), "int64", "", "seed of the collection", ALWAYS, NEVER
    MASSES = "masses", (DISKS,), "float64", "kg", "mass of each disk"
    RADII = "radii", (DISKS,), "float64", "m", "radius of each disk"
    SHAPES = ("shapes", (), "str", "", "shapes of the bodies, with commas between; without: disks",
              SOMETIMES, ALWAYS, ALWAYS)
    ROLES = ("roles", (), "str", "", "of each body: `pushable`, `movable` or `fixed`; without:"
             " body 0 is pushable, all others movable", SOMETIMES, ALWAYS, ALWAYS)
    FRICTION = ("friction", (), "float64", "",
                "friction coefficient of the table; NaN: not known", ALWAYS, ALWAYS, NEVER)
    RIM_FRICTION = ("rim_friction", (), "float64", "",
                    "friction coefficient between disks; NaN: not known", ALWAYS, ALWAYS, NEVER)
    TOOL_FRICTION = ("tool_friction", (), "float64", "",
                     "friction coefficient of the tool; NaN: not known", ALWAYS, ALWAYS, NEVER)
    MOVED = ("moved", (), "bool", "",
             "the target, body 1, moved by 2 mm or more; any body, unless body 1 is `movable`")
    DURATION = "duration", (), "float64", "s", "simulated time of the push"
    GOAL_POSES = ("goal_poses", ("3 N",), "float64", "m, rad",
                  "x, y and heading asked of each body; NaN: not asked", NEVER, ALWAYS)
    GOAL_TOLERANCES = ("goal_tolerances", ("2 N",), "float64", "m, rad",
                       "of place and heading of each body; NaN: not asked", NEVER, ALWAYS)
    GOAL_KEEP = "goal_keep", (DISKS,), "float64", "m", "largest move; NaN: any", NEVER, ALWAYS
    PUSH_ID = "push_id", (), "uint64", "", "id of the push in the recording", NEVER, ALWAYS
    BAG_EPISODE = "bag_episode", (), "uint64", "", "its episode's id there", NEVER, ALWAYS
    BAG_SCENE = "bag_scene", (), "uint64", "", "id there of the scene before it", NEVER, ALWAYS
    OUTCOME = "outcome", (), "int64", "", "error code of the result: 1", NEVER, ALWAYS
    STAMP = "stamp", (), "int64", "ns", "time of the scene before the push", NEVER, ALWAYS
    NEXT_STAMP = "next_stamp", (), "int64", "ns", "time of the scene after the push", NEVER, ALWAYS
    LOG_TIME = "log_time", (), "int64", "ns", "receipt of the result", NEVER, ALWAYS
    SOURCE = ("source", (), "str", "", "origin of the scenes: `push_result` or `scenes`",
              NEVER, ALWAYS)
    PHYSICS_SOURCE = ("physics_source", (), "str", "",
                      "model behind `physics_next`; `computed:`: run by the converter",
                      NEVER, ALWAYS)
    BAG_SHA256 = "bag_sha256", (), "str", "", "SHA-256 of the recording's files", NEVER, ALWAYS
    SURFACE = "surface", (), "str", "", "what the body stood on", NEVER, SOMETIMES, ALWAYS
    OBJECT = "object", (), "str", "", "the body, as its user calls it", NEVER, SOMETIMES, ALWAYS
    RUN = "run", (), "str", "", "the recording of the push", NEVER, SOMETIMES, ALWAYS
    # fmt: on

    def row_shape(self, disks: int, action: int = PUSH_SIZE) -> tuple[int, ...]:
        """Return the shape of a row with so many disks and pushes of so many numbers."""
        sizes = {FLAT: disks * STATE_SIZE, DISKS: disks, "3 N": 3 * disks, "2 N": 2 * disks}
        sizes[WIDTHS] = action
        return tuple(sizes[size] if isinstance(size, str) else size for size in self.shape)


COLLECTED: Final = tuple(c for c in Column if c.collected is ALWAYS)
RECORDED: Final = tuple(c for c in Column if c.recorded is ALWAYS)
IMPORTED: Final = tuple(c for c in Column if c.imported is ALWAYS)
NEEDED: Final = (  # for training; the order is that of a data set's SHA-256
    Column.STATE, Column.PHYSICS_NEXT, Column.NEXT_STATE, Column.ACTION, Column.EPISODE,
)  # fmt: skip
SHAPED: Final = (Column.SHAPES, Column.ROLES)  # where not all bodies are disks
POSED: Final = (Column.GOAL_POSES, Column.GOAL_TOLERANCES, Column.GOAL_KEEP)  # the goal
ORIGINS: Final = (Column.SURFACE, Column.OBJECT, Column.RUN)  # of a real robot's pushes
COLLECTION_FILE: Final = "collection.json"  # of a folder: seed and settings
FRICTIONS: Final = (Column.FRICTION, Column.RIM_FRICTION, Column.TOOL_FRICTION)


@dataclass(frozen=True, eq=False)
class Transitions:
    """M pushes as arrays, which have the names of the columns; the first axis counts pushes."""

    state: ndarray  # (M, N, 8), settled, before each push
    action: ndarray  # (M, 5), or strokes (M, 11), as executed
    next_state: ndarray  # (M, N, 8), settled, after each push

    def __len__(self) -> int:
        """Return the number of pushes M."""
        return len(self.action)

    @property
    def disks(self) -> int:
        """The number of disks N in every scene."""
        return int(self.state.shape[1])

    @property
    def arrays(self) -> Columns:
        """All arrays by name; each has one row a push."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if isinstance(value, ndarray)}

    def select(self, rows: Mask | Indices | slice) -> Self:
        """Return the pushes of a mask (M,), a slice or numbers, any of them as often as given."""
        return replace(self, **{name: array[rows] for name, array in self.arrays.items()})


def describe_bodies(bodies: Bodies) -> dict[str, str]:
    """Return shapes and roles as the columns of a row."""
    return dict(zip(SHAPED, as_names(bodies), strict=True))


def row_bodies(columns: Columns) -> list[Bodies]:
    """Return the bodies of each row; raises `DatasetError`: no such shapes or roles, or too few."""
    rows, count = len(columns[Column.STATE]), columns[Column.STATE][0].size // STATE_SIZE
    roles = columns[Column.ROLES].tolist() if Column.ROLES in columns else rows * [""]
    disks = BETWEEN.join(count * [DISK])
    shapes = columns[Column.SHAPES].tolist() if Column.SHAPES in columns else rows * [disks]
    named = zip(shapes, roles, strict=True)
    return [bodies_named(shapes, role, count) for shapes, role in named]


def shard_path(folder: Path, index: int) -> Path:
    """Return where the index-th shard is."""
    return folder / f"shard-{index:05d}.npz"


def describe_fields(columns: Columns) -> dict[str, list[int]]:
    """Return the shape of one row of each column, as cards state it."""
    return {str(name): list(values.shape[1:]) for name, values in columns.items()}


def as_scenes(states: ndarray) -> Scenes:
    """Return states (M, 8 N) as scenes (M, N, 8)."""
    return states.reshape(len(states), -1, STATE_SIZE)


def centres(states: ndarray) -> Points:
    """Return the centres of the disks (M, N, 2) [m] of states (M, 8 N)."""
    return as_scenes(states)[..., POSITION]


def travels(before: Scenes, after: Scenes, has_target: Mask | bool) -> Float[ndarray, "*M"]:
    """Return how far each push moved the target, body 1; where there is none, any body [m]."""
    ways = np.linalg.norm((after - before)[..., POSITION], axis=-1)
    target = ways[..., min(TARGET, ways.shape[-1] - 1)]
    return np.where(has_target, target, ways.max(axis=-1))


def draw_parts(
    labels: Int[ndarray, "M"], seed: int, validation: float, test: float
) -> tuple[Mask, Mask, Mask]:
    """Return which rows (M,) are to train, validate and test on, by the episode of each row (M,).

    `validation` and `test` are shares of the episodes; 0 to test: none. Raises `DatasetError`: too
    few episodes.
    """
    episodes = np.unique(labels)
    held = [max(round(share * len(episodes)), 1) if share else 0 for share in (validation, test)]
    if len(episodes) <= sum(held):
        wanted = "train, validate and test" if test else "train and validate"
        raise DatasetError(
            f"{len(episodes)} episodes are too few to {wanted}: at least {sum(held) + 1} are"
            " needed; collect or convert more"
        )
    shuffled = generator(seed, "split").permutation(episodes)
    in_test = np.isin(labels, shuffled[: held[1]])
    in_validation = np.isin(labels, shuffled[held[1] : sum(held)])
    return ~(in_test | in_validation), in_validation, in_test


LIMITS: Final = {  # of columns of a scene; beyond them it is in other units
    X: (-10.0, 10.0),  # [m]
    Y: (-10.0, 10.0),
    MASS: (1e-4, MOST_MASS),  # [kg]
    RADIUS: (LEAST_RADIUS, MOST_RADIUS),
}
SAME_KIND: Final = 0.05  # share by which one mass or radius may be measured differently


def changed_kinds(before: Scenes, after: Scenes) -> Float[ndarray, "*M N 2"]:
    """Return by which share masses and radii differ between two scenes (..., N, 8)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.abs(after[..., [MASS, RADIUS]] / before[..., [MASS, RADIUS]] - 1.0)


@dataclass(frozen=True, eq=False)
class PushHistory(Transitions):
    """P earlier pushes of one episode, the oldest first.

    `noise` (P, N) [m] is the standard deviation of each coordinate of the way that a body was seen
    to move; None: the scenes are exact.
    """

    noise: Float[ndarray, "P N"] | None = None

    def __post_init__(self) -> None:
        """Check that the arrays can be what they should be."""
        shape = self.state.shape
        if len(shape) != 3 or shape[1] < 1 or shape[2] != STATE_SIZE:
            raise InvalidInputError(f"past state has shape (P, N, 8) with N >= 1, not {shape}")
        width = STROKE_SIZE if is_stroke(self.action) else PUSH_SIZE
        right: dict[str, tuple[int, ...]] = dict.fromkeys((Column.STATE, Column.NEXT_STATE), shape)
        right[Column.ACTION] = (shape[0], width)
        for name, array in self.arrays.items():
            if array.shape != (wanted := right.get(name, shape[:2])):
                raise InvalidInputError(f"past {name} has shape {wanted}, not {array.shape}")
            if not np.isfinite(array).all():
                where = np.argwhere(~np.isfinite(array))[0].tolist()
                raise InvalidInputError(f"past {name}{where} is NaN or Inf; it must be finite")
        if (self.state[..., [MASS, RADIUS]] <= 0.0).any():
            raise InvalidInputError("past state has a mass or radius that is not positive")
        share = changed_kinds(self.state, self.next_state).max(initial=0.0)
        if share > SAME_KIND:
            raise InvalidInputError(
                f"a past push changed a mass or radius by {100 * share:.1f} %; at most"
                f" {100 * SAME_KIND:g} % may be measured differently"
            )
        if self.noise is not None and (self.noise < 0.0).any():
            raise InvalidInputError(f"past noise is {self.noise.min()} m; it must be 0 or more")

    @classmethod
    def empty(cls, disks: int = 2) -> Self:
        """Return the history of an episode of this many disks that has just begun."""
        states = np.empty((0, disks, STATE_SIZE))
        return cls(states, np.empty((0, PUSH_SIZE)), states)

    def then(
        self,
        scene: Scene,
        push: PushArray,
        next_scene: Scene,
        noise: Float[ndarray, "N"] | None = None,
    ) -> Self:
        """Return the history after one more push, from a scene (N, 8) to the next one.

        A history is of pushes (5,) or of strokes (11,).

        Masses and radii are those of the scene before. `noise` (N,) [m]: see `PushHistory`.

        Raises:
            InvalidInputError: see `PushHistory`, or scenes of another number of disks.
        """
        for name, array in (("scene", scene), ("next scene", next_scene)):
            if array.shape != self.state.shape[1:]:
                right = self.state.shape[1:]
                raise InvalidInputError(f"{name} has shape {array.shape}; its past has {right}")
        both = None
        if noise is not None or self.noise is not None:
            new = np.zeros(self.disks) if noise is None else noise
            both = np.concatenate([self.noise_or_zero, new[None]])
        return type(self)(
            np.concatenate([self.state, scene[None]]),
            np.concatenate([self.action, push[None]]),
            np.concatenate([self.next_state, next_scene[None]]),
            both,
        )

    @property
    def noise_or_zero(self) -> Float[ndarray, "P N"]:
        """The noise; 0 where the scenes are exact."""
        return np.zeros(self.state.shape[:2]) if self.noise is None else self.noise

    def equals(self, other: "PushHistory") -> bool:
        """Return whether another history holds the same pushes, to the bit."""
        mine, others = self.arrays, other.arrays
        same = mine.keys() == others.keys()
        return same and all(np.array_equal(array, others[name]) for name, array in mine.items())

    def latest(self, most: int) -> Self:
        """Return the history of the latest pushes, at most so many."""
        return self.select(slice(max(len(self) - most, 0), None))


# --- reading, which checks ------------------------------------------------------------------------

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
        columns[column] = _checked(column, values, shape, str(otherwise) == "nan")
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


def shard_paths(path: Path) -> list[Path]:
    """Return the paths of a folder's shards, in the order of names; a shard's own is alone.

    Raises `DatasetError`: the folder has none.
    """
    shards = sorted(path.glob("*.npz")) if path.is_dir() else [path]
    if not shards:
        what = describe(path)
        made = f"; it {what}" if what else "; `collect`, `real_import` and `to_dataset` write them"
        raise DatasetError(f"{path} holds no shards *.npz{made}")
    return shards
