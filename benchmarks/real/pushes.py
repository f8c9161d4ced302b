"""The pushes of a data set of single bodies as flat arrays: what rows of the tables learn from."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial import cKDTree

from sain_core.errors import DatasetError
from sain_core.output import claim_folder
from sain_core.push import LENGTH, SPAN_X, SPEED, START, TIP_RADIUS, is_stroke, push_direction
from sain_core.scene import POSE, RADIUS, THETA, turned, unit, wrap_angle
from sain_core.storage import read_arrays
from sain_core.types import Angles, Indices, Mask, Points, Scalars
from sain_model.data.dataset import Dataset, Part, load_dataset
from sain_model.importing.data_set import WRITTEN, import_pushes, write_imported
from sain_model.importing.files import read_recordings
from sain_model.inference.population import Pair
from sain_model.network.feature_kernels import MASS_MIDDLE
from sain_model.physics.planar import first_touch

Poses = Float[ndarray, "M 3"]  # x, y [m] and heading [rad] in the world
Names = ndarray  # of texts, (M,)

PUBLISHED: Final = "sim_"  # names of arrays of predicted poses begin so
TIP_START, BEFORE = "tip_init", "init_pose"  # arrays beside them
ALIKE: Final = 1e-6  # [m], within which starts of the tool are the same


@dataclass(frozen=True, eq=False)
class PushTable:
    """M pushes of single bodies, in the order of the parts of a data set.

    Attributes:
        before: poses before the pushes.
        after: poses after them.
        start: where the tool's axis begins (M, 2) [m].
        heading: of its travel in the world (M,) [rad].
        length: of its travel (M,) [m].
        speed: of its travel (M,) [m/s].
        tip: radius of the tool (M,) [m].
        second: the way to the axis of its second disk [m], and 1 for a bar (M, 3).
        distance: of travel until the tool touches the body (M,) [m]; infinite: it misses.
        normal: heading of the body's inward normal there, in the world (M,) [rad].
        radius: of the body's circumscribed circle (M,) [m].
        shape: name of the outline (M,).
        object: name of the body, as its user calls it (M,).
        surface: name of the surface (M,).
        group: number of the group of near repeats (M,).
        row: place in the data set (M,).
        data: the data set that the rows are of.
        published: predictions of others by name, poses; NaN where there is none.
    """

    before: Poses
    after: Poses
    start: Points
    heading: Angles
    length: Scalars
    speed: Scalars
    tip: Scalars
    second: Float[ndarray, "M 3"]
    distance: Scalars
    normal: Angles
    radius: Scalars
    shape: Names
    object: Names
    surface: Names
    group: Int[ndarray, "M"]
    row: Indices
    data: Dataset = field(repr=False)
    published: Mapping[str, Poses] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return the number of pushes M."""
        return len(self.row)

    def select(self, rows: Mask | Indices) -> Self:
        """Return the pushes that a mask (M,) or rising numbers pick."""
        flat: dict[str, Any] = {name: getattr(self, name)[rows] for name in self._flat}
        published = {name: poses[rows] for name, poses in self.published.items()}
        return replace(self, **flat, published=published)

    def and_also(self, other: Self) -> Self:
        """Return these pushes and others of the same data, in its order."""
        order = np.argsort(np.concatenate([self.row, other.row]), kind="stable")
        flat: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), getattr(other, name)])[order]
            for name in self._flat
        }
        published = {
            name: np.concatenate([poses, other.published[name]])[order]
            for name, poses in self.published.items()
        }
        return replace(self, **flat, published=published)

    @property
    def _flat(self) -> list[str]:
        """The names of the arrays."""
        return [item.name for item in fields(self) if item.name not in ("data", "published")]

    @cached_property
    def body(self) -> Names:
        """The name of each body on its surface: what has parameters of its own."""
        return np.array(
            [str(Pair(*names)) for names in zip(self.object, self.surface, strict=True)]
        )

    @cached_property
    def dataset(self) -> Dataset:
        """The same pushes as a data set; its order is that of the parts."""
        chosen = np.zeros(len(self.data), dtype=bool)
        chosen[self.row] = True
        return self.data.select(chosen)

    @cached_property
    def touches(self) -> Mask:
        """Which pushes touch the body on the tool's travel."""
        return np.asarray(self.distance <= self.length)

    @cached_property
    def contact(self) -> Points:
        """Where the tool first touches the body (M, 2) [m]; of a miss the end of its travel.

        That is at its disk which is farther along the normal.
        """
        gone = np.where(self.touches, self.distance, self.length)
        span = self.second[:, :2]
        ahead = (span * unit(self.normal)).sum(axis=1) > 0.0
        middle = self.start + ahead[:, None] * span + gone[:, None] * unit(self.heading)
        return np.asarray(middle + self.tip[:, None] * unit(self.normal))

    def in_body(self, vectors: Points) -> Points:
        """Turn vectors (M, 2) of the world into the frames of the bodies before the pushes."""
        return turned(vectors, -self.before[:, 2])

    @cached_property
    def moves(self) -> Float[ndarray, "M 3"]:
        """How bodies moved, in their frames before the pushes: [m, m, rad]."""
        return self.moves_to(self.after)

    def moves_to(self, poses: Poses) -> Float[ndarray, "M 3"]:
        """Return the moves (M, 3) that lead to poses (M, 3)."""
        turn = wrap_angle(poses[:, 2] - self.before[:, 2])
        return np.column_stack([self.in_body(poses[:, :2] - self.before[:, :2]), turn])

    def placed(self, moves: Float[ndarray, "M 3"]) -> Poses:
        """Return the poses that moves (M, 3) in the frames of the bodies lead to."""
        place = self.before[:, :2] + turned(moves[:, :2], self.before[:, 2])
        return np.column_stack([place, wrap_angle(self.before[:, 2] + moves[:, 2])])


def push_table(data: Dataset) -> PushTable:
    """Return the pushes of a data set.

    Raises:
        DatasetError: scenes with more than one body, or pushes that are no strokes.
    """
    pieces = [_arrays(part) for part in data.parts]
    joined: dict[str, Any] = {
        name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]
    }
    return PushTable(**joined, row=np.arange(len(data)), data=data)


def _arrays(part: Part) -> dict[str, ndarray]:
    if part.disks != 1 or not is_stroke(part.action):
        raise DatasetError(
            f"a scene has {part.disks} bodies and a push {part.action.shape[1]} numbers; real"
            " pushes have one body and are strokes of eleven numbers: read them with"
            " ros2 run sain_model real_import"
        )
    touch = first_touch(part.state, part.action, part.bodies)
    return {
        "before": _poses(part.state),
        "after": _poses(part.next_state),
        "start": part.action[:, START],
        "heading": push_direction(part.action),
        "length": part.action[:, LENGTH],
        "speed": part.action[:, SPEED],
        "tip": part.action[:, TIP_RADIUS],
        "second": part.action[:, SPAN_X:],
        "distance": touch.distance,
        "normal": touch.normal,
        "radius": part.state[:, 0, RADIUS],
        "shape": np.full(len(part), part.bodies.shapes[0].name, dtype=object),
        "object": _stated(part.object, len(part)),
        "surface": _stated(part.surface, len(part)),
        "group": part.episode,
    }


def _stated(names: Names | None, count: int) -> Names:
    """Return names that a data set may leave out."""
    return np.full(count, "", dtype=object) if names is None else names.astype(object)


def _poses(scenes: Float[ndarray, "M 1 8"]) -> Poses:
    poses = scenes[:, 0, POSE].copy()
    poses[:, 2] = wrap_angle(scenes[:, 0, THETA])
    return poses


# --- recordings -----------------------------------------------------------------------------------


def read_pushes(path: Path, work: Path) -> PushTable:
    """Return the pushes at a path; the data set that they become is kept in a folder of work.

    Raises:
        DatasetError: nothing there, or nothing that can be read; the message says where such data
            come from.
    """
    folder = work / "data"
    imported = import_pushes(read_recordings([path]), MASS_MIDDLE, skip_bad=True)
    claim_folder(folder, WRITTEN)
    write_imported(folder, imported, {"sources": [str(path)]})
    pushes = push_table(load_dataset(folder))
    return replace(pushes, published=dict(published(path, pushes)))


def published(path: Path, pushes: PushTable) -> Iterator[tuple[str, Poses]]:
    """Yield what npz files at a path predict of pushes, by name.

    Files state poses of the frame that was tracked, data sets those of the centroid: the offset is
    fixed in each body.
    """
    for file in sorted(path.glob("*.npz")) if path.is_dir() else [path]:
        if file.suffix != ".npz":
            continue
        arrays = read_arrays(file)
        names = [name for name in arrays if name.startswith(PUBLISHED)]
        if not names or not {TIP_START, BEFORE} <= set(arrays):
            continue
        row = _rows(file, arrays[TIP_START], pushes.start)
        tracked = arrays[BEFORE][row]
        offset = turned(pushes.before[:, :2] - tracked[:, :2], -tracked[:, 2])
        for name in names:
            poses = arrays[name][row]
            place = poses[:, :2] + turned(offset, poses[:, 2])
            yield name, np.column_stack([place, wrap_angle(poses[:, 2])])


def _rows(file: Path, starts: Points, wanted: Points) -> np.ndarray:
    """Return which row of a file each push is, by where its tool starts."""
    apart, row = cKDTree(starts).query(wanted)
    if apart.max() > ALIKE or len(np.unique(row)) != len(row):
        raise DatasetError(f"{file} has predictions of other pushes than the data set")
    return np.asarray(row)
