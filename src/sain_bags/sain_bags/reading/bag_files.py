"""The MCAP files of a bag, read as one: messages by the thousand, in the order of their receipt.

Chunks, and files, may overlap in time. What was received later than the next chunk begins is held
back until that is read, so that nothing but the overlap has to be kept.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from mcap.records import Channel, ChunkIndex, Schema
from numpy import ndarray

from sain_bags.bag.message_types import MessageTypes, check_version, read_types
from sain_bags.mcap.mcap_file import CHANNELS, Batch, McapFile
from sain_core.errors import DatasetError

NEVER: Final = (1 << 63) - 1  # [ns], later than every message
BATCH_SIZE: Final = 8 << 20  # [bytes], messages are handed on from here
BATCH_CHUNKS: Final = 256  # or with so many read, where little is wanted of each


@dataclass(frozen=True)
class BagChannel:
    """Where messages of one topic come from: a channel of one of the bag's files."""

    file: int  # which of the bag's
    channel: Channel
    schema: Schema | None

    @property
    def topic(self) -> str:
        """Return its topic."""
        return self.channel.topic

    @property
    def type(self) -> str:
        """Return its messages' type; empty: nothing tells."""
        return self.schema.name if self.schema else ""

    @property
    def description(self) -> bytes:
        """Return the text that describes its messages, whatever it is."""
        return self.schema.data if self.schema else b""

    @property
    def has_definition(self) -> bool:
        """Return whether anything describes its messages."""
        return self.schema is not None and bool(self.schema.data)

    def types(self) -> MessageTypes:
        """Return the types that describe its messages (``ros2msg``)."""
        encoding, schema = self.channel.message_encoding, self.schema
        if schema is None or (encoding, schema.encoding) != ("cdr", "ros2msg"):
            described = schema.encoding if schema else "nothing"
            raise DatasetError(
                f"{self.topic} is {encoding!r} and described by {described!r};"
                " only CDR that a ros2msg text describes can be decoded"
            )
        try:
            text = schema.data.decode()
        except UnicodeDecodeError as error:
            raise DatasetError(f"the definition of {schema.name[:100]} is not UTF-8") from error
        types = read_types(schema.name, text)
        check_version(schema.name, text)
        return types


class Place(NamedTuple):
    """Where a message is."""

    log_time: int  # [ns since the epoch], received
    file: int  # which of the bag's
    channel: int  # in the file
    chunk: ChunkIndex


class BagFiles:
    """Files that are read as one."""

    def __init__(self, files: Sequence[McapFile]) -> None:
        """Begin with files that have indexes."""
        self._files = files
        self.statistics = tuple(file.statistics for file in self._files)
        self.channels = tuple(
            BagChannel(number, channel, file.schemas.get(channel.schema_id))
            for number, file in enumerate(self._files)
            for channel in file.channels.values()
        )

    def batches(
        self,
        topics: Collection[str] | None = None,
        start: int | None = None,
        types: Collection[str] | None = None,
    ) -> Iterator[Batch]:
        """Yield messages by the thousand, in the order in which they were received.

        Args:
            topics: only these; None: all.
            start: only those received then or later [ns since the epoch]; None: all.
            types: only of these types, where a topic has several; None: all.
        """
        wanted = [self._wanted(number, topics, types) for number in range(len(self._files))]
        counts = [np.zeros(CHANNELS, dtype=np.int64) for _ in self._files]
        for batch in in_order(self._chunks(wanted, start, counts)):
            chosen = batch if start is None else batch[batch.log_times >= start]
            if len(chosen):
                yield chosen
        if start is None:
            for file, numbers, found in zip(self._files, wanted, counts, strict=True):
                file.compare({number: int(found[number]) for number in numbers})

    def places(self, topic: str) -> list[Place]:
        """Return the messages of a topic in the order of their receipt; none is unpacked."""
        found: list[Place] = []
        for number, file in enumerate(self._files):
            for channel in self._wanted(number, (topic,), None):
                chunks = [(file.log_times(one, channel), one) for one in file.chunks((channel,))]
                file.compare({channel: sum(len(times) for times, _ in chunks)})
                found += [
                    Place(time, number, channel, chunk)
                    for times, chunk in chunks
                    for time in times.tolist()
                ]
        return sorted(found, key=lambda place: place.log_time)

    def message_at(self, place: Place) -> bytes:
        """Return a message, with its encapsulation header."""
        batch = self._files[place.file].read(place.chunk, (place.channel,), 0)
        return batch.message(int(np.flatnonzero(batch.log_times == place.log_time)[0]))

    def _chunks(
        self, wanted: list[dict[int, int]], start: int | None, counts: list[ndarray]
    ) -> Iterator[tuple[int, Batch]]:
        """Yield chunks by their beginning, each with when the next begins; count messages."""
        places: list[tuple[ChunkIndex, int, int]] = []  # with its file and its rank
        for number, file in enumerate(self._files):
            for chunk in file.chunks(wanted[number].keys()):
                if start is None or chunk.message_end_time >= start:
                    places.append((chunk, number, len(places)))
        places.sort(key=lambda place: (place[0].message_start_time, place[2]))
        limits = [*(chunk.message_start_time for chunk, _, _ in places), NEVER][1:]
        tables = [_table(numbers) for numbers in wanted]
        totals = [0] * len(wanted)
        for (chunk, number, rank), limit in zip(places, limits, strict=True):
            file = self._files[number]
            batch = file.read(chunk, wanted[number].keys(), rank)
            found = np.bincount(batch.channels)
            counts[number][: len(found)] += found
            totals[number] += len(batch)
            file.limit_messages(totals[number])
            yield limit, replace(batch, channels=tables[number][batch.channels])

    def _wanted(
        self, file: int, topics: Collection[str] | None, types: Collection[str] | None
    ) -> dict[int, int]:
        """Return the numbers in the bag of a file's channels, by their numbers in the file."""
        return {
            found.channel.id: number
            for number, found in enumerate(self.channels)
            if found.file == file
            and (topics is None or found.topic in topics)
            and (types is None or found.type in types)
        }


def _table(numbers: dict[int, int]) -> ndarray:
    table = np.zeros(CHANNELS, dtype=np.int64)
    table[list(numbers)] = list(numbers.values())
    return table


def in_order(chunks: Iterable[tuple[int, Batch]]) -> Iterator[Batch]:
    """Sort what comes chunk by chunk.

    Args:
        chunks: the time before which nothing more will come once the batch is read, and the
            batch; batches in the order in which they begin.
    """
    held: list[Batch] = []
    size = 0
    for limit, batch in chunks:
        held.append(batch)
        size += len(batch.data)
        if size < BATCH_SIZE and len(held) < BATCH_CHUNKS:
            continue
        joined = _sorted(_join(held))
        early = joined.log_times < limit
        if early.all():
            held = []
            yield joined
        else:
            held = [joined[~early].compact()]
            yield joined[early]
        size = sum(len(part.data) for part in held)
    if held:
        yield _sorted(_join(held))


def _join(parts: Sequence[Batch]) -> Batch:
    if len(parts) == 1:
        return parts[0]
    sizes = np.array([len(part.data) for part in parts])
    counts = [len(part) for part in parts]
    shifts = np.repeat(np.cumsum(sizes) - sizes, counts)
    columns = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in Batch.__dataclass_fields__
    }
    columns["starts"] = columns["starts"] + shifts
    return Batch(**columns)


def _sorted(batch: Batch) -> Batch:
    if (np.diff(batch.log_times) > 0).all():
        return batch
    # Within a chunk messages stand in the order of the file, which a stable sort keeps.
    return batch[np.lexsort((batch.ranks, batch.log_times))]
