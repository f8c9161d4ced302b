"""Messages as columns: some fields of each, thousands at once.

Whatever else a type has, and in whatever order, does not matter: it is read as the bag describes
it.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_bags.bag.layouts import NUMBERS, TEXT, Layout, find_layout
from sain_bags.bag.message_types import SCALAR, MessageTypes, full_name
from sain_bags.mcap.mcap_file import Batch
from sain_bags.reading.bag_files import BagChannel
from sain_bags.reading.reader import Bag
from sain_core.errors import DatasetError
from sain_core.scene import STATE_NAMES

KEPT_LAYOUTS: Final = 100  # of messages of one size
POSE_NAMES: Final = (
    "body", "x", "y", "heading", "has_heading", "tolerance", "heading_tolerance",
)  # fmt: skip
SEQUENCES: Final[dict[str, tuple[str, ...]]] = {  # the numbers of an element, by a path's last part
    "disks": STATE_NAMES,
    "poses": POSE_NAMES,
    "keep": (),  # an element is a number
}
TEXTS: Final = frozenset(  # likewise
    {"error_message", "source", "model", "frame_id", "surface", "object", "run"}
)


@dataclass(frozen=True)
class Elements:
    """The elements of a sequence in each of M messages, as many as each has."""

    values: ndarray  # (elements of all messages, numbers of an element)
    firsts: ndarray  # (M,) where a message's begin
    counts: ndarray  # (M,)

    def take(self, messages: ndarray, count: int) -> ndarray:
        """Return those of messages that have so many, (len(messages), count, numbers)."""
        return self.values[self.firsts[messages][:, None] + np.arange(count)]

    def one(self, message: int) -> ndarray:
        """Return those of one message, (its count, numbers)."""
        first = self.firsts[message]
        return self.values[first : first + self.counts[message]]


@dataclass(frozen=True)
class MessageTable:
    """Messages of one type; entry i of each column is of the i-th."""

    columns: dict[str, ndarray]  # (M,) by path
    sequences: dict[str, Elements]

    def __getitem__(self, rows: slice) -> "MessageTable":
        """Return some of the messages."""
        return MessageTable(
            {name: column[rows] for name, column in self.columns.items()},
            {
                name: Elements(one.values, one.firsts[rows], one.counts[rows])
                for name, one in self.sequences.items()
            },
        )


class TableReader:
    """Decodes some fields of a bag's messages of one type."""

    def __init__(self, bag: Bag, topics: Iterable[str], kind: str, fields: Sequence[str]) -> None:
        """Read the definitions of the type's channels."""
        self._bag, self._fields, topics = bag, fields, frozenset(topics)
        self._wanted = [path for name in fields for path in number_paths(name)]
        self._types: dict[int, MessageTypes] = {}  # by number of a channel
        for number, channel in enumerate(bag.channels):
            if channel.type == kind and channel.topic in topics:
                self._types[number] = checked_types(bag, channel, self._wanted)
        self._layouts: defaultdict[tuple[bytes, int], list[Layout]] = defaultdict(list)

    def of(self, batch: Batch) -> Batch:
        """Return the messages that this reads."""
        return batch[np.isin(batch.channels, list(self._types))]

    def read(self, batch: Batch) -> MessageTable:
        """Return messages, which are all of this type, as columns."""
        builder = _Builder(self._fields, len(batch))
        kinds = np.stack([batch.channels, batch.sizes])
        for number, size in np.unique(kinds, axis=1).T.tolist():
            channel = self._bag.channels[number]
            if not size:
                raise _foreign(self._bag, f"{channel.topic}: a message is empty")
            rows = np.flatnonzero((kinds == [[number], [size]]).all(axis=0))
            messages = _copied(batch, rows, size)
            for layout in self._layouts[channel.description, size]:
                rows, messages = builder.fill(layout, rows, messages)
            while len(rows):
                with self._bag.decoding:
                    layout = self._find(number, messages[0].tobytes())
                    rows, messages = builder.fill(layout, rows, messages)
        return builder.table()

    def _find(self, number: int, message: bytes) -> Layout:
        channel = self._bag.channels[number]
        try:
            layout = find_layout(self._types[number], channel.type, message, self._wanted)
        except DatasetError as error:
            raise _foreign(self._bag, f"{channel.topic}: {error}") from error
        known = self._layouts[channel.description, len(message)]
        if len(known) >= KEPT_LAYOUTS:
            known.clear()
        known.append(layout)
        return layout


def number_paths(name: str) -> list[str]:
    """Return the paths of a field; of a sequence, one for each number of its elements."""
    names = SEQUENCES.get(name.rpartition(".")[2])
    return [f"{name}.{one}" for one in names] if names else [name]


def checked_types(bag: Bag, channel: BagChannel, paths: Iterable[str]) -> MessageTypes:
    """Return the types that describe a channel's messages, which have all of these fields."""
    try:
        types = channel.types()
        for path in paths:
            _check_path(types, channel.type, path)
    except DatasetError as error:
        raise _foreign(bag, error) from error
    return types


def _check_path(types: MessageTypes, name: str, path: str) -> None:
    kind = full_name(name)
    for step in path.split("."):
        found = {entry.name: entry for entry in types.get(kind, ())}
        if step not in found:
            raise DatasetError(f"{name} has no {path}")
        if found[step].count != SCALAR and step not in SEQUENCES:
            raise DatasetError(f"{path} of {name} is an array")
        kind = found[step].type
    if kind not in {*NUMBERS, TEXT} or (kind == TEXT) != (step in TEXTS):
        raise DatasetError(f"{path} of {name} is a {kind}")


def _foreign(bag: Bag, why: object) -> DatasetError:
    return DatasetError(f"{bag.path} holds messages of another definition than this graph's: {why}")


def _copied(batch: Batch, rows: ndarray, size: int) -> ndarray:
    """Return messages of one size as (M, size)."""
    windows = np.lib.stride_tricks.sliding_window_view(batch.data, size)
    whole = windows.view(f"V{size}")[:, 0][batch.starts[rows]]  # copied a message at once
    return whole.view(np.uint8).reshape(-1, size)


@dataclass
class _Parts:
    """The elements of a sequence while they are collected."""

    firsts: ndarray
    counts: ndarray
    values: list[ndarray] = field(default_factory=list)
    size: int = 0

    def add(self, rows: ndarray, count: int, values: ndarray) -> None:
        self.firsts[rows] = self.size + count * np.arange(len(rows))
        self.counts[rows] = count
        self.values.append(values)
        self.size += len(values)


class _Builder:
    """Collects messages layout by layout, and returns them in their order."""

    def __init__(self, fields: Sequence[str], count: int) -> None:
        self._count, self._columns = count, dict[str, ndarray]()
        parts = {name: name.rpartition(".")[2] for name in fields}
        self._names = [name for name, part in parts.items() if part not in SEQUENCES]
        self._sequences = {
            name: _Parts(*np.zeros((2, count), dtype=np.int64))
            for name, part in parts.items()
            if part in SEQUENCES
        }

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
        sequences = {}
        for name, parts in self._sequences.items():
            width = len(number_paths(name))
            values = np.concatenate([np.empty((0, width)), *parts.values])
            sequences[name] = Elements(values, parts.firsts, parts.counts)
        return MessageTable(self._columns, sequences)

    def _take(self, layout: Layout, rows: ndarray, messages: ndarray) -> None:
        for name in self._names:
            if name in layout.texts:
                values: ndarray | list[str] = layout.read_texts(name, messages)
                kind: np.dtype[Any] = np.dtype(object)
            else:
                values = layout.read(name, messages)[:, 0]
                kind = np.dtype(f"{values.dtype.kind}8")
            if name not in self._columns:
                self._columns[name] = np.empty(self._count, dtype=kind)
            self._columns[name][rows] = values
        for name, parts in self._sequences.items():
            if count := layout.counts[name]:
                parts.add(rows, count, _elements(layout, name, messages))


def _elements(layout: Layout, name: str, messages: ndarray) -> ndarray:
    """Return the elements of a sequence in messages (M, size) as (M * count, numbers)."""
    paths = number_paths(name)
    (dtype, _), *others = (layout.numbers[path] for path in paths)
    if any(other[0] != dtype for other in others):
        columns = [layout.read(path, messages) for path in paths]
        return np.stack(columns, axis=-1).reshape(-1, len(paths))  # (M, count, numbers) before
    places = np.array([layout.numbers[path][1] for path in paths]).T.ravel().tolist()
    whole = Layout(layout.byte_order, numbers={name: (dtype, places)})
    return whole.read(name, messages).astype(np.float64).reshape(-1, len(paths))
