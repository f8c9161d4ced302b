"""Messages in CDR: decoded one by one, or thousands at once by where in them each field is.

The place of a field depends on nothing but the lengths of the strings and sequences before
it. So one message is walked field by field, following the definition in the bag; and every other
of the same size that has the same lengths in the same places has its fields there too.

Encoding: CDR version 1 (OMG DDSI-RTPS 10.5), which ROS 2 writes: four bytes that name the byte
order, then the fields, each aligned to its own size as counted from there.
"""

import struct
from collections.abc import Collection
from dataclasses import dataclass, field
from itertools import groupby
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_bags.bag.message_types import SCALAR, SEQUENCE, Field, MessageTypes, full_name
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
FORMATS: Final = dict(zip(NUMBERS, "?BBbhiqBHIQfd", strict=True))  # the same, of `struct`
TEXT: Final = "string"
HEADER: Final = 4  # [bytes]
BYTE_ORDERS: Final = {b"\0\0": ">", b"\0\1": "<"}
PADDING: Final = 3  # [bytes], that a middleware may put at the end
MOST_NUMBERS: Final = 4096  # of a sequence that is read
LENGTH: Final = 4  # [bytes], of the length of a string or a sequence
Runs = list[tuple[tuple[str, ...], Field]]


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
    walk = _LayoutWalk(types, name, message, frozenset(wanted))
    walk.message(full_name(name), "")
    walk.end()
    return walk.layout


class Decoder:
    """Decodes messages of one type."""

    def __init__(self, types: MessageTypes, name: str) -> None:
        """Store the types that describe it, and its full name."""
        self.types, self.name = types, name
        self.runs = {kind: _runs(fields) for kind, fields in types.items()}

    def decode(self, message: bytes) -> SimpleNamespace:
        """Return a message with attributes named as its fields; arrays are lists, of bytes bytes.

        Raises:
            DatasetError, UnicodeDecodeError: it is not as its definition says.
        """
        walk = _DecodingWalk(self.types, self.name, message)
        walk.runs = self.runs
        found = walk.message(full_name(self.name))
        walk.end()
        return found


class _Walk:
    """A place in a message that goes on from field to field."""

    def __init__(self, types: MessageTypes, name: str, message: bytes) -> None:
        order = BYTE_ORDERS.get(message[:2])
        if order is None or len(message) < HEADER:
            raise DatasetError(
                f"a {name} begins with {message[:4].hex()!r}; CDR begins with 0000, 0001"
            )
        self.order, self.place = order, HEADER
        self._types, self._name, self._message = types, name, message

    def end(self) -> None:
        """Check that nothing is left of the message."""
        if not 0 <= len(self._message) - self.place <= PADDING:
            size = len(self._message)
            raise DatasetError(f"a {self._name} of {size} bytes has fields for {self.place}")

    def count(self, entry: Field) -> int:
        """Return how many elements a field has."""
        if entry.count == SEQUENCE:
            return self.length()
        return 1 if entry.count == SCALAR else entry.count

    def length(self) -> int:
        """Return the length of the string or the sequence that begins here."""
        (length,) = struct.unpack_from(f"{self.order}I", self._message, self.take(LENGTH, LENGTH))
        if length > len(self._message):
            raise DatasetError(
                f"something of {length} elements cannot be in {len(self._message)} bytes"
            )
        return int(length)

    def take(self, size: int, alignment: int = 1) -> int:
        """Go on behind so many bytes; return where they begin."""
        start = self.place + (HEADER - self.place) % alignment
        self.place = start + size
        if self.place > len(self._message):
            raise DatasetError(f"{len(self._message)} bytes end inside a field")
        return start


class _DecodingWalk(_Walk):
    runs: dict[str, Runs]

    def message(self, kind: str) -> SimpleNamespace:
        values: dict[str, Any] = {}
        for names, entry in self.runs[kind]:
            found = self._values(entry, len(names) or self.count(entry))
            values.update(zip(names, found, strict=True) if names else [(entry.name, found)])
        return SimpleNamespace(**values)

    def _values(self, entry: Field, count: int) -> Any:
        if sign := FORMATS.get(entry.type):
            size = struct.calcsize(sign)
            if not count:
                return b"" if sign == "B" else []
            start = self.take(count * size, size)
            if sign == "B" and entry.count != SCALAR:
                return self._message[start : self.place]
            return list(struct.unpack_from(f"{self.order}{count}{sign}", self._message, start))
        if entry.type == TEXT:
            return [self._text() for _ in range(count)]
        if entry.type not in self._types:
            raise DatasetError(f"{entry.name} is a {entry.type}, which cannot be read")
        return [self.message(entry.type) for _ in range(count)]

    def _text(self) -> str:
        size = self.length()
        start = self.take(size)
        return self._message[start : start + max(size - 1, 0)].decode()


def _runs(fields: tuple[Field, ...]) -> Runs:
    """Return fields in their order, scalars of one type behind each other with all their names."""
    groups = groupby(fields, key=lambda one: (one.count, one.count != SCALAR or one.type))
    found: Runs = []
    for (count, _), group in groups:
        members = list(group)
        if count == SCALAR:
            found.append((tuple(one.name for one in members), members[0]))
        else:
            found += [((), one) for one in members]
    return found


class _LayoutWalk(_Walk):
    def __init__(
        self, types: MessageTypes, name: str, message: bytes, wanted: frozenset[str]
    ) -> None:
        super().__init__(types, name, message)
        self.layout, self._wanted = Layout(self.order), wanted

    def message(self, kind: str, prefix: str) -> None:
        for entry in self._types[kind]:
            path = prefix + entry.name
            count = self.count(entry)
            if entry.count != SCALAR and (entry.type not in NUMBERS or path in self._wanted):
                self.layout.counts[path] = count
            if entry.type in NUMBERS:
                self._numbers(entry, path, count)
                continue
            if entry.type != TEXT and entry.type not in self._types:
                raise DatasetError(f"{path} is a {entry.type}, which cannot be read")
            for _ in range(count):
                self._text(path) if entry.type == TEXT else self.message(entry.type, f"{path}.")

    def length(self) -> int:
        length = super().length()
        self.layout.lengths[self.place - LENGTH] = length
        return length

    def _numbers(self, entry: Field, path: str, count: int) -> None:
        dtype = np.dtype(self.order + NUMBERS[entry.type])
        if path in self._wanted and entry.count != SCALAR and count > MOST_NUMBERS:
            raise DatasetError(f"{path} has {count:,} numbers; allowed: {MOST_NUMBERS:,}")
        if not count:
            return
        start = self.take(count * dtype.itemsize, dtype.itemsize)
        if path in self._wanted:
            places = range(start, self.place, dtype.itemsize)
            self.layout.numbers.setdefault(path, (dtype, []))[1].extend(places)

    def _text(self, path: str) -> None:
        size = self.length()
        start = self.take(size)
        if path in self._wanted:
            self.layout.texts[path] = (start, start + max(size - 1, 0))


def _view(messages: ndarray, places: list[int], dtype: np.dtype) -> ndarray:
    """Return what stands in some places of messages (M, size), (M, how many)."""
    size = dtype.itemsize
    first, last = places[0], places[-1] + size
    if last - first == len(places) * size:  # one after the other, as they mostly are
        part = messages[:, first:last]
    else:
        part = messages[:, (np.array(places)[:, None] + np.arange(size)).ravel()]
    return np.ascontiguousarray(part).view(dtype)
