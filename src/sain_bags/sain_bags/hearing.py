"""What a recording says of pushes, told in the order in which it was said."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy import ndarray

from sain_bags.bag_files import BagChannel
from sain_bags.batches import Batch
from sain_bags.episodes import GOAL, PREDICTION, PUSH_RESULT, SCENE
from sain_bags.heard import Arguments, Heard
from sain_bags.pairing import Pairing
from sain_bags.tables import FIELDS, PUSH, Table, TableReader
from sain_bags.whole_pushes import WholePushes


class Hearing:
    """Decodes the messages of a graph and lets a `Pairing` hear them."""

    def __init__(self, channels: Sequence[BagChannel], pairing: Pairing) -> None:
        """Hear those of a bag's channels that have the graph's types."""
        self._channels, self._pairing = channels, pairing
        self._readers: dict[int, TableReader] = {}

    def hear(self, batch: Batch) -> None:
        """Take the next messages.

        Raises:
            DatasetError: one lacks what is needed, or is not as its definition says.
        """
        pairing = self._pairing
        tell: dict[str, Callable[..., None]] = {
            PUSH: pairing.push,
            PUSH_RESULT: pairing.result,
            PREDICTION: pairing.prediction,
            SCENE: pairing.settled_scene,
            GOAL: pairing.goal,
        }
        heard = [
            self._decode(number, batch)
            for number in np.unique(batch.channels).tolist()
            if self._channels[number].type in FIELDS
        ]
        turns = np.full(len(batch), -1)  # which of `told` tells of a message, -1: none
        told: list[tuple[Callable[..., None], Arguments]] = []
        together = WholePushes(heard, len(batch), pairing)
        if len(together.spots):
            turns[together.spots] = len(told)
            told.append((pairing.whole, together.arguments()))
        for messages in heard:
            rows = np.flatnonzero(~together.covered[messages.spots])
            if messages.kind == SCENE:
                rows = _first_settled(messages.table)
            turns[messages.spots[rows]] = len(told)
            told.append((tell[messages.kind], messages.arguments(rows)))
        for turn in turns[turns >= 0].tolist():
            method, arguments = told[turn]
            method(*next(arguments))

    def _decode(self, number: int, batch: Batch) -> Heard:
        if number not in self._readers:
            self._readers[number] = TableReader(self._channels[number])
        spots = np.flatnonzero(batch.channels == number)
        table = self._readers[number].read(batch[spots])
        return Heard(self._channels[number].type, table, spots, batch.log_times[spots])


def _first_settled(table: Table) -> ndarray:
    """Return the rows of the first settled scene of each place; others tell nothing new."""
    settled = np.flatnonzero(table.columns["settled"])
    places = np.stack([table.columns[name][settled] for name in ("episode_id", "scene_id")])
    _, first = np.unique(places, axis=1, return_index=True)
    return settled[np.sort(first)]
