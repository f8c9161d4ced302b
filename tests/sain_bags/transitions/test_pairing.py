"""Ids pair what belongs together, whatever came first, and little has to be kept for it."""

from itertools import count, permutations
from typing import Any

import numpy as np
import pytest

from sain_bags.transitions.contiguous import PushStretch
from sain_bags.transitions.message_fields import GOAL
from sain_bags.transitions.messages import ChannelMessages
from sain_bags.transitions.paired_pushes import FROM_RESULT, IDS, PairedPushes
from sain_bags.transitions.pairing import Pairing, PendingPush
from sain_bags.transitions.tables import MessageTable

NUMBERS = count()
Said = tuple[str, tuple[Any, ...]]  # a method of `Pairing`, its arguments


def somewhere() -> tuple[MessageTable, int]:
    return MessageTable({}, {}), next(NUMBERS)


def push(number: int, scene: int = 0) -> Said:
    return "push", (number, (1, scene or number), 5, somewhere())


def result(number: int, code: int = 1, scene: int = 0) -> Said:
    return "result", (number, 1, code, number, (1, scene or number), 5, somewhere())


def prediction(number: int) -> Said:
    return "prediction", (number, somewhere())


def scene(number: int) -> Said:
    return "settled_scene", ((1, number), somewhere())


def tell(pairing: Pairing, said: Said) -> list[PendingPush]:
    getattr(pairing, said[0])(*said[1])
    return released(pairing.ready())


def pair(pairing: Pairing, *messages: Said) -> list[PendingPush]:
    found = [paired for message in messages for paired in tell(pairing, message)]
    return [*found, *released(pairing.rest())]


def released(segments: list[Any]) -> list[PendingPush]:
    return [paired for segment in segments for paired in segment]


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_any_order_of_push_result_and_prediction(order: tuple[int, ...]) -> None:
    messages = [push(7), result(7), prediction(7)]
    (paired,) = pair(Pairing(True, True), *(messages[place] for place in order))
    assert (paired.push_id, paired.refused) == (7, False)
    assert paired.result is messages[1][1][-1]
    assert paired.prediction is messages[2][1][-1]


@pytest.mark.parametrize("order", list(permutations(range(4))))
def test_any_order_of_push_and_scenes(order: tuple[int, ...]) -> None:
    messages = [push(7, 3), scene(3), scene(4), scene(5)]
    (paired,) = pair(Pairing(False, False), *(messages[place] for place in order))
    assert paired.before is messages[1][1][-1]
    assert paired.after is messages[2][1][-1]
    assert not paired.ambiguous


def test_pushes_come_in_their_order_when_predictions_do_not() -> None:
    messages = [result(1), result(2), prediction(2), result(3), prediction(1), prediction(3)]
    assert [paired.push_id for paired in pair(Pairing(True, True), *messages)] == [1, 2, 3]


def test_no_more_than_the_window_waits() -> None:
    pairing = Pairing(True, True, window=4)
    for number in range(1, 101):
        done = tell(pairing, result(number))
        assert [paired.push_id for paired in done] == ([number - 4] if number > 4 else [])
    assert pair(pairing, prediction(1), prediction(100))[-1].prediction is not None
    assert pairing.late_predictions == 1


def test_a_push_that_is_refused_while_its_namesake_is_executed() -> None:
    found = pair(Pairing(True, False), push(1), push(1), result(1, code=7), result(1))
    assert [paired.refused for paired in found] == [True, False]
    assert not any(paired.repeated for paired in found)


def test_a_second_execution_is_told_apart_from_the_first() -> None:
    found = pair(Pairing(True, False), result(1), result(1))
    assert [paired.repeated for paired in found] == [False, True]


def test_a_used_id_is_noticed_without_results() -> None:
    messages = [scene(1), push(5, 1), scene(2), push(5, 2), scene(3)]
    found = pair(Pairing(False, False), *messages)
    assert sorted(paired.repeated for paired in found) == [False, True]


def test_two_pushes_from_one_scene_are_rivals_unless_one_is_refused() -> None:
    both = pair(Pairing(True, False), push(1, 9), push(2, 9), scene(9), scene(10))
    assert [paired.ambiguous for paired in both] == [True, True]
    messages = [push(1, 9), push(2, 9), result(3), scene(9), scene(10)]
    refusal = result(1, code=9, scene=9)
    left = pair(Pairing(True, False), *messages[:2], refusal, *messages[2:])
    assert [(paired.push_id, paired.ambiguous) for paired in left] == [
        (1, False), (2, False), (3, False),
    ]  # fmt: skip


def contiguous_pushes(numbers: range, goals: tuple[tuple[int, int], ...] = ()) -> PushStretch:
    """Executed pushes, of episode 1 and 2 by turns, at spots 10, 20, ..; goals (episode, spot)."""
    ids = np.array(numbers, dtype=np.uint64)
    rows, episodes = np.arange(len(ids)), 1 + ids % 2
    codes = np.ones(len(ids), dtype=np.int64)
    results = (MessageTable({"push_id": ids}, {}), rows)
    ids_of = np.rec.fromarrays([ids, episodes, ids, episodes, codes, rows], dtype=IDS)
    pushes = PairedPushes(rows, ids_of, None, FROM_RESULT, (results, results, results))
    given = MessageTable(
        {"episode_id": np.array([episode for episode, _ in goals], dtype=np.uint64)}, {}
    )
    spots = np.array([spot for _, spot in goals], dtype=np.int64)
    return PushStretch(pushes, 10 * (rows + 1), ChannelMessages(GOAL, given, spots, spots))


@pytest.mark.parametrize("pushes", [3, 40])  # paired one by one, or as columns
@pytest.mark.parametrize("waits", [False, True])
def test_contiguous_pushes_are_paired_as_if_one_by_one(pushes: int, waits: bool) -> None:
    pairing = Pairing(True, False)
    general, early = somewhere(), somewhere()
    pairing.goal(0, general)
    pairing.goal(1, early)
    if waits:
        pairing.push(500, (1, 500), 0, somewhere())
    pairing.contiguous(contiguous_pushes(range(1, 1 + pushes), ((2, 15), (1, 25), (0, 26))))
    if waits:
        pairing.result(500, 1, 1, 500, (1, 500), 0, somewhere())
    found = [*pairing.ready(), *pairing.rest()]
    given: list[Any] = []
    for segment in found:
        if isinstance(segment, PairedPushes):
            given += [segment.goals[goal] for goal in segment.goal_of]
        else:
            given += [paired.goal for paired in segment]
    if waits:
        given.pop(0)
    told = [goal if goal in (general, early) else goal[1] for goal in given]
    # Push 1 is of episode 2: no goal was given for it before spot 10. Pushes that wait come last.
    expected = [0, 1, 0] if waits else [general, early, 0]
    assert told == [*expected, *([1, 0] * pushes)][:pushes]
    assert pairing.knows(np.array([1, pushes, pushes + 1], dtype=np.uint64)).tolist() == [
        True, True, False,
    ]  # fmt: skip


def test_a_push_from_the_scene_of_a_contiguous_push_is_ambiguous() -> None:
    pairing = Pairing(True, False)
    pairing.contiguous(contiguous_pushes(range(1, 41)))
    pairing.push(77, (1, 2), 5, somewhere())  # planned from the scene that push 2 was executed in
    pairing.push(78, (1, 99), 5, somewhere())
    first, last = [*pairing.ready(), *pairing.rest()]
    assert isinstance(first, PairedPushes) and len(first) == 40
    assert [paired.ambiguous for paired in last] == [True, False]
