"""What a recording says of pushes, told in the order in which it was said."""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from numpy import ndarray

from sain_bags.reading.bag_files import BagChannel
from sain_bags.reading.batches import Batch
from sain_bags.transitions.episodes import GOAL, PREDICTION, PUSH_RESULT, SCENE
from sain_bags.transitions.heard import Arguments, Heard
from sain_bags.transitions.pairing import Pairing
from sain_bags.transitions.push_run import GoalRun, PushRun
from sain_bags.transitions.tables import Table, TableReader
from sain_bags.transitions.wanted_fields import FIELDS, PUSH
from sain_bags.transitions.whole_pushes import WholePushes

NOTHING: Final = -1


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
        whole = WholePushes(heard, len(batch), pairing)
        turns = np.full(len(batch), NOTHING)  # which of `told` tells of a message
        told: list[tuple[Callable[..., None], Arguments]] = []
        for messages in heard:
            if len(whole) and messages is whole.goals:
                continue
            rows = np.flatnonzero(~whole.covered[messages.spots])
            turns[messages.spots[rows]] = len(told)
            told.append((tell[messages.kind], messages.arguments(rows)))
        runs = _runs(whole, np.flatnonzero(turns != NOTHING))
        for turn in [*turns[turns != NOTHING].tolist(), NOTHING]:
            if len(whole):
                pushes, goals = next(runs)
                pairing.run(pushes, goals)
            if turn != NOTHING:
                method, arguments = told[turn]
                method(*next(arguments))

    def _decode(self, number: int, batch: Batch) -> Heard:
        if number not in self._readers:
            self._readers[number] = TableReader(self._channels[number])
        spots = np.flatnonzero(batch.channels == number)
        table = self._readers[number].read(batch[spots])
        kind = self._channels[number].type
        if kind == SCENE:  # one is kept long after the others of its table: they are not kept
            rows = _first_settled(table)
            table, spots = table.take(rows), spots[rows]
        return Heard(kind, table, spots, batch.log_times[spots])


def _runs(whole: WholePushes, others: ndarray) -> Iterator[tuple[PushRun, GoalRun | None]]:
    """Yield what is before, between and after other messages, which are at these spots."""
    if not len(whole):
        return
    run, goals = whole.run(), whole.goals
    spots = goals.spots if goals else others[:0]
    ends = np.searchsorted(whole.spots, others), np.searchsorted(spots, others)
    pushes = pairwise([0, *ends[0].tolist(), len(whole)])
    given = pairwise([0, *ends[1].tolist(), len(spots)])
    for (first, last), (begin, end) in zip(pushes, given, strict=True):
        between = goals.run(slice(begin, end)) if goals else None
        yield run.part(slice(first, last)), between


def _first_settled(table: Table) -> ndarray:
    """Return the rows of the first settled scene of each place; others tell nothing new."""
    settled = np.flatnonzero(table.columns["settled"])
    places = np.stack([table.columns[name][settled] for name in ("episode_id", "scene_id")])
    _, first = np.unique(places, axis=1, return_index=True)
    return settled[np.sort(first)]
