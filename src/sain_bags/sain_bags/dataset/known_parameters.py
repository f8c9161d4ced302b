"""Friction, which scenes do not show: the simulator records it in ``world_parameters``."""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy import ndarray

from sain_bags.transitions.message_fields import WORLD, parent_of
from sain_bags.transitions.messages import MessageReader
from sain_bags.transitions.sources import Source
from sain_core.transitions import FRICTIONS, Column, Columns

UNKNOWN: Final = np.full(len(FRICTIONS), np.nan)


class KnownParameters:
    """The parameters of the episodes of recordings."""

    def __init__(self, sources: Sequence[Source]) -> None:
        """Read them; values that contradict each other are not known.

        Raises:
            DatasetError: a recording is damaged, or its messages are of another definition.
        """
        self._known: dict[tuple[str, int], ndarray] = {}  # by bag and its number of the episode
        for source in sources:
            for episode, values in _worlds(source):
                known = self._known.setdefault((source.sha256, episode), values)
                if not np.array_equal(known, values):
                    self._known[source.sha256, episode] = UNKNOWN

    def added_to(self, columns: Columns) -> Columns:
        """Return columns with those of each row; unchanged where no recording has any."""
        if not self._known:
            return columns
        bags, episodes = columns[Column.BAG_SHA256], columns[Column.BAG_EPISODE]
        places = zip(bags.tolist(), episodes.tolist(), strict=True)
        values = np.stack([self._known.get(place, UNKNOWN) for place in places])
        return columns | {str(name): values[:, index] for index, name in enumerate(FRICTIONS)}


def _worlds(source: Source) -> Iterator[tuple[int, ndarray]]:
    """Yield the id of each episode and its parameters."""
    topics = {
        channel.topic
        for channel in source.bag.channels
        if channel.type == WORLD and parent_of(channel.topic) == source.namespace
    }
    if not topics:
        return
    reader = MessageReader(source.bag.channels, source.bag.decoding)
    for batch in source.bag.batches(topics):
        for messages in reader.read(batch):
            columns = messages.table.columns
            values = np.stack([columns[name] for name in FRICTIONS], axis=-1)
            yield from zip(columns["episode_id"].tolist(), values, strict=True)
