"""The messages of a graph, batch by batch, as columns."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy import ndarray

from sain_bags.reading.bag_files import BagChannel, Batch
from sain_bags.transitions.message_fields import FIELDS, SCENE
from sain_bags.transitions.tables import Message, MessageTable, TableReader
from sain_core.guarding.untrusted import TimeAllowance


@dataclass(frozen=True)
class ChannelMessages:
    """The messages of one channel in a batch."""

    kind: str
    table: MessageTable
    spots: ndarray  # (M,) their places in the batch
    times: ndarray  # (M,) [ns since the epoch], received

    def lists(self, rows: ndarray, *names: str) -> list[list[int]]:
        """Return columns of some messages as Python's own numbers."""
        return [self.table.columns[name][rows].tolist() for name in names]

    def part(self, chosen: slice) -> "ChannelMessages":
        """Return some of the messages, one after the other."""
        table = self.table.take(np.arange(len(self.spots))[chosen])
        return ChannelMessages(self.kind, table, self.spots[chosen], self.times[chosen])

    def places(self, rows: ndarray) -> list[Message]:
        """Return where some messages are."""
        return list(zip(repeat(self.table), rows.tolist(), strict=False))


class MessageReader:
    """Decodes the messages of those channels that have the types of the graph."""

    def __init__(self, channels: Sequence[BagChannel], decoding: TimeAllowance) -> None:
        """Read from these channels of a bag, in the processor time that there is for it."""
        self._channels, self._decoding = channels, decoding
        self._readers: dict[int, TableReader] = {}

    def read(self, batch: Batch) -> list[ChannelMessages]:
        """Return the messages of each channel.

        Raises:
            DatasetError: one lacks what is needed, or is not as its definition says.
        """
        numbers = np.unique(batch.channels).tolist()
        return [self._read(n, batch) for n in numbers if self._channels[n].type in FIELDS]

    def _read(self, number: int, batch: Batch) -> ChannelMessages:
        if number not in self._readers:
            self._readers[number] = TableReader(self._channels[number], self._decoding)
        spots = np.flatnonzero(batch.channels == number)
        table = self._readers[number].read(batch[spots])
        kind = self._channels[number].type
        if kind == SCENE:  # one is kept long after the others of its table: they are not kept
            rows = _first_settled(table)
            table, spots = table.take(rows), spots[rows]
        return ChannelMessages(kind, table, spots, batch.log_times[spots])


def _first_settled(table: MessageTable) -> ndarray:
    """Return the rows of the first settled scene of each id; the others repeat it."""
    settled = np.flatnonzero(table.columns["settled"])
    ids = np.stack([table.columns[name][settled] for name in ("episode_id", "scene_id")])
    _, first = np.unique(ids, axis=1, return_index=True)
    return settled[np.sort(first)]
