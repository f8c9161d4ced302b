"""Pushes whose messages are contiguous: nothing about another push lies between them.

Nearly all pushes of a recording are. They are paired as columns, which is several times faster
than message by message and gives the same rows (docs/notebook/speed.md).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.transitions.message_fields import GOAL, PREDICTION, PUSH, PUSH_RESULT, SCENE
from sain_bags.transitions.messages import ChannelMessages
from sain_bags.transitions.paired_pushes import FROM_RESULT, IDS, NONE, OK, PairedPushes
from sain_bags.transitions.tables import Message

ANY_EPISODE = 0  # in a goal: it holds for all


class PushStretch(NamedTuple):
    """Contiguous pushes and the goals between them, without any other message."""

    pushes: PairedPushes  # without goals
    spots: ndarray  # (R,) of the last message of each push
    goals: ChannelMessages | None

    def given(self) -> list[tuple[int, Message]]:
        """Return the episode of each goal and the goal, in their order."""
        if self.goals is None:
            return []
        rows = np.arange(len(self.goals.spots))
        (episodes,) = self.goals.lists(rows, "episode_id")
        return list(zip(episodes, self.goals.places(rows), strict=True))

    def with_goals(self, earlier: Mapping[int, Message]) -> PairedPushes:
        """Return the pushes, each with the latest goal of its episode, else the latest for any."""
        found = [goal for _, goal in self.given()]
        episodes = self.pushes.ids["episode"]
        chosen = self._latest(episodes)
        general = self._latest(np.full_like(episodes, ANY_EPISODE))
        for episode in np.unique(episodes[chosen == NONE]).tolist():
            if episode in earlier:
                chosen[(episodes == episode) & (chosen == NONE)] = len(found)
                found.append(earlier[episode])
        chosen = np.where(chosen == NONE, general, chosen)
        if ANY_EPISODE in earlier:
            chosen[chosen == NONE] = len(found)
            found.append(earlier[ANY_EPISODE])
        return replace(self.pushes, goals=found, goal_of=chosen)

    def _latest(self, episodes: ndarray) -> ndarray:
        """Return which goal was the latest for an episode (R,) before each push."""
        goals, spots = self.goals, self.spots
        if goals is None or not len(goals.spots):
            return np.full(len(episodes), NONE)
        named = goals.table.columns["episode_id"]
        _, codes = np.unique(np.concatenate([named, episodes]), return_inverse=True)
        goal_codes, push_codes = codes[: len(named)], codes[len(named) :]
        most = int(max(goals.spots[-1], spots[-1])) + 1
        keys = goal_codes * most + goals.spots  # by episode, then by time
        order = np.argsort(keys)
        place = np.searchsorted(keys[order], push_codes * most + spots) - 1
        found = order[place]  # place -1 is no goal's: the comparison below finds it out
        return np.where((place >= 0) & (goal_codes[found] == push_codes), found, NONE)


@dataclass(frozen=True)
class Contiguous:
    """The executed pushes of a batch whose messages are contiguous."""

    covered: ndarray  # (messages,) which belong to these pushes or are goals
    spots: ndarray  # (R,) of the last message of each push
    pushes: PairedPushes
    goals: ChannelMessages | None

    def stretches(self, others: ndarray) -> list[PushStretch]:
        """Divide pushes and goals at the spots of other messages; one stretch more than others."""
        goal_spots = self.goals.spots if self.goals else others[:0]
        push_ends = [0, *np.searchsorted(self.spots, others).tolist(), len(self.spots)]
        goal_ends = [0, *np.searchsorted(goal_spots, others).tolist(), len(goal_spots)]
        ends = zip(pairwise(push_ends), pairwise(goal_ends), strict=True)
        return [
            PushStretch(
                self.pushes.part(slice(first, last)),
                self.spots[first:last],
                self.goals and self.goals.part(slice(begin, end)),
            )
            for (first, last), (begin, end) in ends
        ]


def find_contiguous(
    messages: Sequence[ChannelMessages],
    count: int,
    known: Callable[[ndarray], ndarray],
    with_predictions: bool,
) -> Contiguous | None:
    """Return the contiguous pushes of a batch of so many messages; None: there are none.

    `known` tells which push ids (R,) occurred in an earlier batch.
    """
    kinds = {one.kind: one for one in messages}
    if PUSH_RESULT not in kinds or SCENE in kinds or len(kinds) < len(messages):
        return None
    goals = kinds.pop(GOAL, None)
    spots = np.sort(np.concatenate([one.spots for one in kinds.values()]))
    ids, times = np.zeros(count, dtype=np.uint64), np.zeros(count, dtype=np.int64)
    for one in kinds.values():
        ids[one.spots] = one.table.columns["push_id"]
        times[one.spots] = one.times
    begins = np.flatnonzero(np.append(True, ids[spots][1:] != ids[spots][:-1]))  # (R,)
    named = ids[spots[begins]]
    right = ~known(named) & _is_single(named)
    rows = {kind: _rows(one, spots[begins], right) for kind, one in kinds.items()}
    right &= _executed(kinds, rows, named)
    if with_predictions:
        right &= rows.get(PREDICTION, np.array(NONE)) != NONE
    ends = np.append(begins[1:], len(spots))
    covered = np.zeros(count, dtype=bool)
    covered[spots] = np.repeat(right, ends - begins)
    if goals is not None and right.any():
        covered[goals.spots] = True
    if not right.any():
        return None
    found = rows[PUSH_RESULT][right]
    results = (kinds[PUSH_RESULT].table, found)
    columns = kinds[PUSH_RESULT].table.columns
    named_by_result = (
        columns[name][found]
        for name in ("push.episode_id", "push.scene_id", "episode_id", "error_code")
    )
    began = times[spots[begins[right]]]
    ids_of_pushes = np.rec.fromarrays([named[right], *named_by_result, began], dtype=IDS)
    pushes = PairedPushes(
        np.arange(len(found)),
        ids_of_pushes,
        (kinds[PREDICTION].table, rows[PREDICTION][right]) if with_predictions else None,
        FROM_RESULT,
        (results, results, results),
    )
    return Contiguous(covered, spots[ends[right] - 1], pushes, goals)


def _rows(messages: ChannelMessages, firsts: ndarray, right: ndarray) -> ndarray:
    """Return the row of each run's message of one kind; where there are two, none is right."""
    run = np.searchsorted(firsts, messages.spots, side="right") - 1
    right &= np.bincount(run, minlength=len(firsts)) <= 1
    rows = np.full(len(firsts), NONE)
    rows[run] = np.arange(len(run))
    return rows


def _executed(
    kinds: Mapping[str, ChannelMessages], rows: Mapping[str, ndarray], ids: ndarray
) -> ndarray:
    """Return which runs have the result of an executed push that repeats the push as sent."""
    results, columns = rows[PUSH_RESULT], kinds[PUSH_RESULT].table.columns
    right = (results != NONE) & (columns["error_code"][results] == OK)
    right &= columns["push.push_id"][results] == ids
    if PUSH in kinds:
        sent, pushes = kinds[PUSH].table.columns, rows[PUSH]
        for name in ("episode_id", "scene_id"):
            same = sent[name][pushes] == columns[f"push.{name}"][results]
            right &= same | (pushes == NONE)
    return right


def _is_single(numbers: ndarray) -> ndarray:
    """Return which numbers (M,) occur once."""
    _, places, counts = np.unique(numbers, return_inverse=True, return_counts=True)
    return counts[places] == 1
