"""Pushes of which all that is said is said in one go, with nothing of another push in between.

Nearly all are. A `Pairing` hears of each once, instead of message by message, when the last of its
messages has come, as part of a `PushRun`; that makes no difference but to the time it takes.
"""

from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from sain_bags.transitions.episodes import GOAL, PREDICTION, PUSH_RESULT, SCENE
from sain_bags.transitions.heard import Heard
from sain_bags.transitions.pairing import OK, Pairing
from sain_bags.transitions.push_run import NONE, PushRun
from sain_bags.transitions.wanted_fields import PUSH


class WholePushes:
    """Those among the messages of a batch."""

    def __init__(self, heard: Sequence[Heard], count: int, pairing: Pairing) -> None:
        """Find them.

        Args:
            heard: the messages.
            count: how many there are.
            pairing: that has heard of all batches before.
        """
        self.covered = np.zeros(count, dtype=bool)  # messages that are told of together
        self.spots = np.empty(0, dtype=np.int64)  # of the last message of each push
        kinds = {messages.kind: messages for messages in heard}
        if PUSH_RESULT in kinds and SCENE not in kinds and len(kinds) == len(heard):
            self.goals = kinds.pop(GOAL, None)
            self._kinds, self._pairing = kinds, pairing
            self._find(count)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.spots)

    def run(self) -> PushRun:
        """Return all of them."""
        predictions = None
        if self._pairing.awaits_predictions:
            predictions = self._kinds[PREDICTION].table
        table = self._kinds[PUSH_RESULT].table
        rows = (self._results, predictions, self._predictions, self._times, self.spots)
        return PushRun(table, *rows)

    def _find(self, count: int) -> None:
        spots = np.sort(np.concatenate([messages.spots for messages in self._kinds.values()]))
        ids, times = np.zeros(count, dtype=np.uint64), np.zeros(count, dtype=np.int64)
        for messages in self._kinds.values():
            ids[messages.spots] = messages.table.columns["push_id"]
            times[messages.spots] = messages.times
        said = ids[spots]
        begins = np.flatnonzero(np.append(True, said[1:] != said[:-1]))  # (R,) runs of one push
        right = ~self._pairing.knows(said[begins]) & _is_single(said[begins])
        rows = {
            kind: self._rows(messages, spots[begins], right)
            for kind, messages in self._kinds.items()
        }
        right &= rows[PUSH_RESULT] != NONE
        if self._pairing.awaits_predictions:
            right &= rows.get(PREDICTION, np.array(NONE)) != NONE
        right &= self._executed(rows[PUSH_RESULT], said[begins], rows.get(PUSH))
        self._results = rows[PUSH_RESULT][right]
        self._predictions = rows.get(PREDICTION, rows[PUSH_RESULT])[right]
        self._times = times[spots[begins[right]]]
        ends = np.append(begins[1:], len(spots))
        self.spots = spots[ends[right] - 1]
        self.covered[spots] = np.repeat(right, ends - begins)

    def _rows(self, messages: Heard, firsts: ndarray, right: ndarray) -> ndarray:
        """Return the row of each run's message of one kind; where there are two, none is right."""
        run = np.searchsorted(firsts, messages.spots, side="right") - 1
        right &= np.bincount(run, minlength=len(firsts)) <= 1
        rows = np.full(len(firsts), NONE)
        rows[run] = np.arange(len(run))
        return rows

    def _executed(self, results: ndarray, ids: ndarray, pushes: ndarray | None) -> ndarray:
        """Tell which results are of an executed push, and repeat the push as it was sent."""
        told = {name: column[results] for name, column in self._results_columns().items()}
        right = (told["error_code"] == OK) & (told["push.push_id"] == ids)
        if pushes is not None:
            sent = self._kinds[PUSH].table.columns
            for name in ("episode_id", "scene_id"):
                right &= (sent[name][pushes] == told[f"push.{name}"]) | (pushes == NONE)
        return right

    def _results_columns(self) -> dict[str, ndarray]:
        names = ("error_code", "push.push_id", "push.episode_id", "push.scene_id")
        columns = self._kinds[PUSH_RESULT].table.columns
        return {name: columns[name] for name in names}


def _is_single(numbers: ndarray) -> ndarray:
    """Tell which numbers (M,) are there once."""
    _, places, counts = np.unique(numbers, return_inverse=True, return_counts=True)
    return counts[places] == 1
