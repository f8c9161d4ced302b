"""Where in a message each field is, so that thousands of messages are decoded at once.

In CDR the place of a field depends on nothing but the lengths of the strings and sequences before
it. So one message is walked field by field, following the definition in the bag; and every other
of the same size that has the same lengths in the same places has its fields there too.

Encoding: CDR version 1 (OMG DDSI-RTPS 10.5), which ROS 2 writes: four bytes that name the byte
order, then the fields, each aligned to its own size as counted from there.
"""

import struct
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy import ndarray
from rosbags.interfaces import Nodetype
from rosbags.typesys import TypesysError, get_types_from_msg

from sain_core.errors import DatasetError

NUMBERS: Final = {  # as numpy has them; their size is also what CDR aligns them to
    "bool": "u1",
    "byte": "u1",
    "char": "u1",
    **{f"int{8 * size}": f"i{size}" for size in (1, 2, 4, 8)},
    **{f"uint{8 * size}": f"u{size}" for size in (1, 2, 4, 8)},
    "float32": "f4",
    "float64": "f8",
}
TEXT: Final = "string"
SCALAR: Final = -1  # in place of a count
SEQUENCE: Final = -2
HEADER: Final = 4  # [bytes]
BYTE_ORDERS: Final = {b"\0\0": ">", b"\0\1": "<"}
DEFINITIONS: Final = 16  # that are kept once they are parsed: readers of a bag share them
PADDING: Final = 3  # [bytes], that a middleware may put at the end
MOST_NUMBERS: Final = 4096  # of a sequence that is read
LENGTH: Final = 4  # [bytes], of the length of a string or a sequence


@dataclass(frozen=True)
class Field:
    """One field of a message."""

    name: str
    type: str  # a key of `NUMBERS`, `TEXT`, or a message's full name
    count: int  # of an array, or `SCALAR`, or `SEQUENCE`


NO_FIELD: Final = Field("structure_needs_at_least_one_member", "uint8", SCALAR)  # rosidl adds it
MessageTypes = dict[str, tuple[Field, ...]]  # by full name


@lru_cache(maxsize=DEFINITIONS)
def read_types(name: str, text: str) -> MessageTypes:
    """Return the fields of a message type and of all that it refers to.

    Args:
        name: full, for example ``std_msgs/msg/Header``.
        text: its definition, followed by those of what it refers to (``ros2msg``).
    """
    try:
        found = get_types_from_msg(text, name)
    except (TypesysError, LookupError, RecursionError, ValueError) as error:
        reason = " ".join(str(error).split())[:300]
        raise DatasetError(f"the definition of {name} cannot be read: {reason}") from error
    types = {
        full: tuple(_field(*entry) for entry in fields) or (NO_FIELD,)
        for full, (_, fields) in found.items()
    }
    for full, fields in types.items():
        for entry in fields:
            if entry.type not in NUMBERS and entry.type != TEXT and entry.type not in types:
                raise DatasetError(f"{entry.type}, of {entry.name} in {full}, is not described")
    return types


def _field(name: str, described: Any) -> Field:
    (node, about), count = described, SCALAR
    if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        (node, about), count = about
        count = count if described[0] == Nodetype.ARRAY else SEQUENCE
    return Field(name, about[0] if node == Nodetype.BASE else about, count)


@dataclass
class Layout:
    """Where the fields are in messages of one size."""

    byte_order: str
    lengths: dict[int, int] = field(default_factory=dict)  # by place in the message
    numbers: dict[str, tuple[np.dtype, list[int]]] = field(default_factory=dict)  # places
    texts: dict[str, tuple[int, int]] = field(default_factory=dict)  # where it begins and ends
    counts: dict[str, int] = field(default_factory=dict)  # elements of sequences

    def fits(self, messages: ndarray) -> ndarray:
        """Return which messages (M, size) have the same lengths in the same places."""
        fitting = messages[:, 1] == (self.byte_order == "<")
        word = np.dtype(f"{self.byte_order}u4")
        for place, length in self.lengths.items():
            fitting &= _view(messages, [place], word)[:, 0] == length
        return fitting

    def read(self, name: str, messages: ndarray) -> ndarray:
        """Return the numbers of one field, (M, how many it has)."""
        dtype, places = self.numbers[name]
        return _view(messages, places, dtype)

    def read_texts(self, name: str, messages: ndarray) -> list[str]:
        """Return the texts of one field; bytes that are no text become U+FFFD."""
        start, end = self.texts[name]
        part = np.ascontiguousarray(messages[:, start:end])
        if (part == part[0]).all():
            return [part[0].tobytes().decode(errors="replace")] * len(part)
        return [text.tobytes().decode(errors="replace") for text in part]


def find_layout(types: MessageTypes, name: str, message: bytes, wanted: Collection[str]) -> Layout:
    """Walk one message and return where its fields are.

    Args:
        types: that describe it.
        name: of its type.
        message: in CDR, with its encapsulation header.
        wanted: the paths of the fields to find, as in ``before.header.stamp.sec``; those inside a
            sequence of messages stand for all of its elements.
    """
    order = BYTE_ORDERS.get(message[:2])
    if order is None or len(message) < HEADER:
        raise DatasetError(
            f"a {name} begins with {message[:4].hex()!r}; CDR begins with 0000, 0001"
        )
    walk = _Walk(types, message, Layout(order), frozenset(wanted))
    walk.message(name, "")
    if not 0 <= len(message) - walk.place <= PADDING:
        raise DatasetError(f"a {name} of {len(message)} bytes has fields for {walk.place}")
    return walk.layout


class _Walk:
    def __init__(
        self, types: MessageTypes, message: bytes, layout: Layout, wanted: frozenset[str]
    ) -> None:
        self.layout, self.place = layout, HEADER
        self._types, self._message, self._wanted = types, message, wanted

    def message(self, name: str, prefix: str) -> None:
        for entry in self._types[name]:
            path = prefix + entry.name
            if entry.type in NUMBERS:
                self._numbers(entry, path)
            elif entry.type == TEXT:
                for _ in range(self._count(entry)):
                    self._text(path)
            else:
                self._messages(entry, path)

    def _numbers(self, entry: Field, path: str) -> None:
        dtype = np.dtype(self.layout.byte_order + NUMBERS[entry.type])
        count = self._count(entry)
        if path in self._wanted and entry.count != SCALAR:
            if count > MOST_NUMBERS:
                raise DatasetError(f"{path} has {count:,} numbers; allowed: {MOST_NUMBERS:,}")
            self.layout.counts[path] = count
        if not count:
            return
        self._align(dtype.itemsize)
        start = self.place
        self._skip(count * dtype.itemsize)
        if path in self._wanted:
            places = range(start, self.place, dtype.itemsize)
            self.layout.numbers.setdefault(path, (dtype, []))[1].extend(places)

    def _text(self, path: str) -> None:
        length = self._length()
        if path in self._wanted:
            self.layout.texts[path] = (self.place, self.place + max(length - 1, 0))
        self._skip(length)

    def _messages(self, entry: Field, path: str) -> None:
        if entry.type not in self._types:
            raise DatasetError(f"{path} is a {entry.type}, which cannot be read")
        count = self._count(entry)
        if entry.count != SCALAR:
            self.layout.counts[path] = count
        for _ in range(count):
            self.message(entry.type, f"{path}.")

    def _count(self, entry: Field) -> int:
        if entry.count == SEQUENCE:
            return self._length()
        return 1 if entry.count == SCALAR else entry.count

    def _length(self) -> int:
        """Return the length of the string or the sequence that begins here."""
        self._align(LENGTH)
        start = self.place
        self._skip(LENGTH)
        (length,) = struct.unpack_from(f"{self.layout.byte_order}I", self._message, start)
        if length > len(self._message):
            raise DatasetError(
                f"something of {length} elements cannot be in {len(self._message)} bytes"
            )
        self.layout.lengths[start] = length
        return length

    def _align(self, size: int) -> None:
        self.place += (HEADER - self.place) % size

    def _skip(self, size: int) -> None:
        self.place += size
        if self.place > len(self._message):
            raise DatasetError(f"{len(self._message)} bytes end inside a field")


def _view(messages: ndarray, places: list[int], dtype: np.dtype) -> ndarray:
    """Return what stands in some places of messages (M, size), (M, how many)."""
    size = dtype.itemsize
    first, last = places[0], places[-1] + size
    if last - first == len(places) * size:  # one after the other, as they mostly are
        part = messages[:, first:last]
    else:
        part = messages[:, (np.array(places)[:, None] + np.arange(size)).ravel()]
    return np.ascontiguousarray(part).view(dtype)
