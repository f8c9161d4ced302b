"""A chunk in the making: messages in the order of their log times, and what describes them."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from mcap.opcode import Opcode

MESSAGE: Final = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log, publish time
MESSAGE_SIZE: Final = 2 + 4 + 8 + 8  # [bytes], a message's content without its data

Places = dict[int, list[int]]  # by channel: log time, offset, log time, ...


@dataclass(frozen=True)
class Content:
    """What a chunk holds."""

    data: bytes
    start: int  # in data, of the messages
    places: Places  # offsets from there

    @property
    def span(self) -> tuple[int, int]:
        """The first and the last log time [ns since the epoch]."""
        times = [time for index in self.places.values() for time in index[::2]]
        return min(times), max(times)


class OpenChunk:
    """Collects messages, chunk after chunk."""

    def __init__(self, chunk_size: int) -> None:
        """Begin; a chunk is full at a size [bytes]."""
        self._chunk_size = self._room = chunk_size
        self._described = b""  # what this chunk describes
        self._fresh = b""  # what it is the first to describe: the next one does so again
        self._messages = bytearray()
        self._places: Places = {}
        self._latest, self._in_order = 0, True  # log times in this chunk

    @property
    def size(self) -> int:
        """What waits here [bytes]."""
        return len(self._described) + len(self._messages)

    def describe(self, record: bytes) -> None:
        """Add the description of a type or a channel, for this chunk and the next."""
        self._described += record
        self._fresh += record
        self._room -= len(record)

    def add(self, channel: int, sequence: int, received: int, published: int, data: bytes) -> bool:
        """Append one message, its times in [ns since the epoch]; return whether this is full."""
        messages = self._messages
        places = self._places.get(channel)
        if places is None:
            places = self._places[channel] = []
        places += (received, len(messages))
        if received < self._latest:
            self._in_order = False
        self._latest = received
        size = MESSAGE_SIZE + len(data)
        messages += MESSAGE.pack(Opcode.MESSAGE, size, channel, sequence, received, published)
        messages += data
        return len(messages) > self._room

    def take(self) -> Content | None:
        """Return what was collected, and begin the next chunk; None: no message."""
        if not self._places:
            return None
        messages, places = bytes(self._messages), self._places
        if not self._in_order:
            messages, places = in_log_order(messages, places)
        content = Content(self._described + messages, len(self._described), places)
        self._described, self._fresh = self._fresh, b""
        self._room = self._chunk_size - len(self._described)
        self._messages, self._places, self._latest, self._in_order = bytearray(), {}, 0, True
        return content


def in_log_order(messages: bytes, places: Mapping[int, list[int]]) -> tuple[bytes, Places]:
    """Return message records in the order of their log times, and their places.

    They are taken topic by topic.
    """
    found = [
        (time, offset, channel)
        for channel, index in places.items()
        for time, offset in zip(index[::2], index[1::2], strict=True)
    ]
    ends = dict(pairwise([*sorted(offset for _, offset, _ in found), len(messages)]))
    ordered: Places = {channel: [] for channel in places}
    parts, place = [], 0
    for time, offset, channel in sorted(found):  # messages of the same time stay as they are
        ordered[channel] += (time, place)
        parts.append(messages[offset : ends[offset]])
        place += ends[offset] - offset
    return b"".join(parts), ordered
