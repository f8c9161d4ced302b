"""Reads recordings of real pushes, and the predictions that others published with them."""

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.real.pushes import Poses, PushTable, push_table, turned
from sain_core.errors import DatasetError
from sain_core.scene import wrap_angle
from sain_core.storage import read_arrays
from sain_core.types import Points
from sain_model.data.dataset import load_dataset
from sain_model.importing.data_set import import_pushes, write_imported
from sain_model.importing.sources import read_recordings
from sain_model.network.inputs import MASS_MIDDLE

PUBLISHED: Final = "sim_"  # names of arrays of predicted poses begin so
START, BEFORE = "tip_init", "init_pose"  # arrays beside them
ALIKE: Final = 1e-6  # [m], within which starts of the tool are the same


def read_pushes(path: Path, work: Path) -> PushTable:
    """Return the pushes at a path; the data set that they become is kept in a folder of work.

    Raises:
        DatasetError: nothing there, or nothing that can be read; the message says where such data
            come from.
    """
    folder = work / "data"
    imported = import_pushes(read_recordings([path]), MASS_MIDDLE, skip_bad=True)
    shutil.rmtree(folder, ignore_errors=True)
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
        if not names or not {START, BEFORE} <= set(arrays):
            continue
        row = _rows(file, arrays[START], pushes.start)
        tracked = arrays[BEFORE][row]
        offset = turned(pushes.before[:, :2] - tracked[:, :2], -tracked[:, 2])
        for name in names:
            poses = arrays[name][row]
            place = poses[:, :2] + turned(offset, poses[:, 2])
            yield name, np.column_stack([place, wrap_angle(poses[:, 2])])


def _rows(file: Path, starts: Points, wanted: Points) -> np.ndarray:
    """Return which row of a file each push is, by where its tool starts."""
    from scipy.spatial import cKDTree

    apart, row = cKDTree(starts).query(wanted)
    if apart.max() > ALIKE or len(np.unique(row)) != len(row):
        raise DatasetError(f"{file} has predictions of other pushes than the data set")
    return np.asarray(row)
