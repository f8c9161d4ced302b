"""Messages as columns: some fields of each.

Whatever else a type has, and in whatever order, does not matter: it is read as the bag describes
it.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_bags.bag.layouts import Layout, find_layout, read_types
from sain_bags.reading.bag_files import BagChannel, Batch
from sain_bags.rows.message_fields import COUNT, DISKS, all_paths, check_path
from sain_core.errors import DatasetError
from sain_core.guarding.untrusted import TimeAllowance
from sain_core.scene import STATE_NAMES, STATE_SIZE

KEPT_LAYOUTS: Final = 100  # of messages of one size


@dataclass(frozen=True)
class Disks:
    """The disks of M scenes, of any number each."""

    values: ndarray  # (disks of all scenes, 8)
    firsts: ndarray  # (M,) where a scene's begin
    counts: ndarray  # (M,)

    def scenes(self, places: ndarray, count: int) -> ndarray:
        """Return those of some scenes that have so many disks, (len(places), count, 8)."""
        return self.values[self.firsts[places][:, None] + np.arange(count)]


@dataclass(frozen=True)
class MessageTable:
    """Messages of one type; entry i of each column is of the i-th."""

    columns: dict[str, ndarray]  # (M,) by path
    disks: dict[str, Disks]

    def __len__(self) -> int:
        """Return how many messages there are."""
        return len(next(iter(self.columns.values())))


class TableReader:
    """Decodes some fields of the messages of one channel."""

    def __init__(self, channel: BagChannel, decoding: TimeAllowance, fields: Sequence[str]) -> None:
        """Read the channel's definitions.

        Raises:
            DatasetError: they cannot be read, or lack a field that is needed.
        """
        self._channel, self._decoding = channel, decoding
        self._types = read_types(channel.type, channel.definition())
        self._layouts: defaultdict[int, list[Layout]] = defaultdict(list)
        self._fields, self._wanted = fields, all_paths(fields)
        for path in self._wanted:
            check_path(self._types, channel.type, path)

    def read(self, batch: Batch) -> MessageTable:
        """Return messages, which are all of this channel, as columns.

        Raises:
            DatasetError: one is not as its definition says, or they differ too much in their
                lengths.
        """
        builder = _Builder(self._fields, len(batch))
        for size in np.unique(batch.sizes).tolist():
            if not size:
                raise DatasetError(f"{self._channel.topic}: a message is empty")
            rows = np.flatnonzero(batch.sizes == size)
            windows = np.lib.stride_tricks.sliding_window_view(batch.data, size)
            whole = windows.view(f"V{size}")[:, 0][batch.starts[rows]]  # copied a message at once
            messages = whole.view(np.uint8).reshape(-1, size)
            for layout in self._layouts[size]:
                rows, messages = builder.fill(layout, rows, messages)
            while len(rows):
                with self._decoding:
                    layout = self._find(messages[0].tobytes())
                    rows, messages = builder.fill(layout, rows, messages)
        return builder.table()

    def _find(self, message: bytes) -> Layout:
        try:
            layout = find_layout(self._types, self._channel.type, message, self._wanted)
        except DatasetError as error:
            raise DatasetError(f"{self._channel.topic}: {error}") from error
        known = self._layouts[len(message)]
        if len(known) >= KEPT_LAYOUTS:
            known.clear()
        known.append(layout)
        return layout


class _Builder:
    """Collects messages layout by layout, and returns them in their order."""

    def __init__(self, fields: Sequence[str], count: int) -> None:
        self._count = count
        self._names = [name for name in fields if not name.endswith(DISKS)]
        self._columns: dict[str, ndarray] = {}
        self._parts: dict[str, list[ndarray]] = {
            name: [] for name in fields if name.endswith(DISKS)
        }
        self._firsts = {name: np.zeros(count, dtype=np.int64) for name in self._parts}
        self._counts = {name: np.zeros(count, dtype=np.int64) for name in self._parts}

    def fill(self, layout: Layout, rows: ndarray, messages: ndarray) -> tuple[ndarray, ndarray]:
        """Read the messages that a layout fits; return the others."""
        fitting = layout.fits(messages)
        if fitting.all():
            self._take(layout, rows, messages)
            return rows[:0], messages[:0]
        if fitting.any():
            self._take(layout, rows[fitting], messages[fitting])
        return rows[~fitting], messages[~fitting]

    def table(self) -> MessageTable:
        """Return all messages that were read."""
        disks = {
            name: Disks(
                np.concatenate(parts) if parts else np.empty((0, STATE_SIZE)),
                self._firsts[name],
                self._counts[name],
            )
            for name, parts in self._parts.items()
        }
        return MessageTable(self._columns, disks)

    def _take(self, layout: Layout, rows: ndarray, messages: ndarray) -> None:
        for name in self._names:
            if name.endswith(COUNT):
                length = layout.counts.get(name.removesuffix(COUNT), 0)
                values: ndarray | list[str] = np.full(len(rows), length)
                kind: np.dtype[Any] = np.dtype(np.int64)
            elif name in layout.texts:
                values = layout.read_texts(name, messages)
                kind = np.dtype(object)
            else:
                values = layout.read(name, messages)[:, 0]
                kind = np.dtype(f"{values.dtype.kind}8")
            if name not in self._columns:
                self._columns[name] = np.empty(self._count, dtype=kind)
            self._columns[name][rows] = values
        for name, parts in self._parts.items():
            count = layout.counts[name]
            self._firsts[name][rows] = sum(map(len, parts)) + count * np.arange(len(rows))
            self._counts[name][rows] = count
            if count:
                parts.append(_disks(layout, name, count, messages))


def _disks(layout: Layout, name: str, count: int, messages: ndarray) -> ndarray:
    """Return the disks of messages (M, size) as (M * count, 8)."""
    numbers = [layout.numbers[f"{name}.{column}"] for column in STATE_NAMES]
    (dtype, _), *others = numbers
    if any(other[0] != dtype for other in others):
        columns = [layout.read(f"{name}.{column}", messages) for column in STATE_NAMES]
        return np.stack(columns, axis=-1).reshape(-1, STATE_SIZE)  # (M, count, 8) before
    places = np.array([found for _, found in numbers]).T.ravel().tolist()
    whole = Layout(layout.byte_order, numbers={name: (dtype, places)})
    return whole.read(name, messages).astype(np.float64).reshape(-1, STATE_SIZE)
