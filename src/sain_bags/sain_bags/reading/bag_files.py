"""The MCAP files of a bag, read as one."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from mcap.records import Channel, Schema, Statistics
from numpy import ndarray

from sain_bags.mcap.mcap_file import CHANNELS, McapFile, Stretch
from sain_bags.reading.batches import Batch, in_order, make_batch
from sain_core.errors import DatasetError

NEVER: Final = (1 << 63) - 1  # [ns], later than every message


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

    def definition(self) -> str:
        """Return the text that describes its messages (``ros2msg``).

        Raises:
            DatasetError: they are not CDR, or described in another way.
        """
        encoding, schema = self.channel.message_encoding, self.schema
        if schema is None or (encoding, schema.encoding) != ("cdr", "ros2msg"):
            described = schema.encoding if schema else "nothing"
            raise DatasetError(
                f"{self.topic} is {encoding!r} and described by {described!r};"
                " only CDR that a ros2msg text describes can be decoded"
            )
        return schema.data.decode(errors="replace")


class BagFiles:
    """Files that are read as one."""

    def __init__(self, paths: Sequence[Path]) -> None:
        """Read their summaries; raises `DatasetError`."""
        self.paths = tuple(paths)
        self._files = [McapFile(path) for path in paths]
        self.channels = tuple(
            BagChannel(number, channel, file.schemas.get(channel.schema_id))
            for number, file in enumerate(self._files)
            for channel in file.channels.values()
        )

    @property
    def statistics(self) -> tuple[Statistics, ...]:
        """What each file says about itself."""
        return tuple(file.statistics for file in self._files)

    def batches(self, topics: Collection[str] | None, start: int | None) -> Iterator[Batch]:
        """Yield messages as `Bag.batches` does, but not the stretches that end before the start."""
        wanted = [self._wanted(number, topics) for number in range(len(self._files))]
        counts = [np.zeros(CHANNELS, dtype=np.int64) for _ in self._files]
        yield from in_order(self._stretches(wanted, start, counts))
        if start is None:
            for file, numbers, found in zip(self._files, wanted, counts, strict=True):
                file.compare({number: int(found[number]) for number in numbers})

    def _stretches(
        self, wanted: list[dict[int, int]], start: int | None, counts: list[ndarray]
    ) -> Iterator[tuple[int, Batch]]:
        """Yield stretches by their beginning, each with when the next begins; count messages."""
        places: list[tuple[Stretch, int, int]] = []  # with its file and its rank
        for number, file in enumerate(self._files):
            for stretch in file.stretches(wanted[number].keys()):
                if start is None or stretch.last >= start:
                    places.append((stretch, number, len(places)))
        places.sort(key=lambda place: (place[0].first, place[2]))
        limits = [*(stretch.first for stretch, _, _ in places), NEVER][1:]
        tables = [_table(numbers) for numbers in wanted]
        for (stretch, number, rank), limit in zip(places, limits, strict=True):
            messages = self._files[number].read(stretch, wanted[number].keys())
            found = np.bincount(messages.heads["channel"])
            counts[number][: len(found)] += found
            yield limit, make_batch(messages, tables[number], rank)

    def _wanted(self, file: int, topics: Collection[str] | None) -> dict[int, int]:
        """Return the numbers in the bag of a file's channels, by their numbers in the file."""
        return {
            found.channel.id: number
            for number, found in enumerate(self.channels)
            if found.file == file and (topics is None or found.topic in topics)
        }


def _table(numbers: dict[int, int]) -> ndarray:
    table = np.zeros(CHANNELS, dtype=np.int64)
    table[list(numbers)] = list(numbers.values())
    return table
