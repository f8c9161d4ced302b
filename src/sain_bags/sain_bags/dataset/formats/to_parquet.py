"""Parquet, through `pyarrow`: files for `datasets`, pandas and polars.

A row is a push, with the columns of the npz shards; what has several numbers is a list of fixed
size, stamps are integers [ns], and nothing is rounded. Two columns are added, ``split`` and
``disks``. Files are named for the part of the split that they hold, by which `datasets` knows it;
the data set's card stands in each file's schema metadata, under ``sain``.
"""

import json
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow
from numpy import ndarray
from pyarrow.parquet import ParquetWriter

from sain_bags.dataset.formats.stored_rows import StoredRows
from sain_core.transitions import PARTS, Column, Columns

CHUNKS: Final = 100  # in a file, each of a shard's rows of one part; about 50 MB
CARD: Final = "sain"
SPLIT: Final = "split"
DISKS: Final = "disks"


def write(rows: StoredRows, folder: Path) -> None:
    """Write the files of each part of the split."""
    folder.mkdir()
    for part in PARTS:
        numbered = enumerate(rows.chunks(part))
        for number, group in groupby(numbered, lambda chunk: chunk[0] // CHUNKS):
            tables = (_table(rows, part, columns) for _, columns in group)
            _write_file(folder / f"{part}-{number:05d}.parquet", tables)


def _write_file(path: Path, tables: Iterator[pyarrow.Table]) -> None:
    first = next(tables)
    with ParquetWriter(path, first.schema, compression="zstd") as writer:
        writer.write_table(first)
        for table in tables:
            writer.write_table(table)


def _table(rows: StoredRows, part: str, columns: Columns) -> pyarrow.Table:
    count = len(columns[Column.EPISODE])
    added = {SPLIT: np.full(count, part), DISKS: np.full(count, rows.disks)}
    arrays = {key: _array(values) for key, values in {**columns, **added}.items()}
    return pyarrow.table(arrays, metadata={CARD: json.dumps(rows.card, allow_nan=False)})


def _array(values: ndarray) -> pyarrow.Array:
    if values.ndim == 1:
        return pyarrow.array(values)
    return pyarrow.FixedSizeListArray.from_arrays(values.ravel(), values.shape[1])
