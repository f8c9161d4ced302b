"""Recordings as results: bags, MCAP files and data sets, the same way as live results."""

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sain_bags.dataset.conversion import convert
from sain_bags.dataset.rows import ConversionConfig
from sain_core.errors import DatasetError
from sain_core.scratch import scratch_folder
from sain_core.shapes.bodies import bodies_named
from sain_core.transitions import NO_STEP, SHAPED, Column, Columns, read_shard, shard_paths
from sain_lab.storage.results import Result


def read_recording(path: Path) -> Iterator[Result]:
    """Yield the results of a data set, a bag or a folder of bags, in the order of time.

    Raises `DatasetError`: it is none, or damaged.
    """
    if not path.exists():
        raise DatasetError(f"{path} does not exist; give a bag, or a folder of shards *.npz")
    if path.suffix == ".npz" or (path.is_dir() and any(path.glob("*.npz"))):
        yield from read_data_set(path)
        return
    with scratch_folder("laboratory") as scratch:
        convert([path], Path(scratch) / "rows", ConversionConfig(keep_unsettled=False))
        yield from read_data_set(Path(scratch) / "rows")


def read_data_set(path: Path) -> Iterator[Result]:
    """Yield the results of a folder of shards, or of one shard, episode by episode.

    Raises `DatasetError`: a shard is damaged.
    """
    for shard in shard_paths(path):
        columns = read_shard(shard)
        order = _order(columns)
        source = hashlib.sha256(columns[Column.STATE].tobytes()).hexdigest()[:12]
        for row in order:
            yield _result(columns, int(row), source)


def _order(columns: Columns) -> np.ndarray:
    steps = columns[Column.STEP]
    if (steps == NO_STEP).any() or (columns[Column.OBJECT] != "").all():
        return np.arange(len(steps))
    return np.lexsort((steps, columns[Column.EPISODE]))


def _result(columns: Columns, row: int, source: str) -> Result:
    shapes, roles = (str(columns[name][row]) for name in SHAPED)
    before = columns[Column.STATE][row]
    about: dict[str, Any] = {
        "object": str(columns[Column.OBJECT][row]),
        "surface": str(columns[Column.SURFACE][row]),
    }
    episode = f"{source}/{columns[Column.EPISODE][row]}"
    return Result(
        columns[Column.ACTION][row],
        before,
        columns[Column.NEXT_STATE][row],
        bodies=bodies_named(shapes, roles, len(before)),
        # a robot's pushes of named bodies stand alone
        episode="" if about["object"] else episode,
        **about,
    )
