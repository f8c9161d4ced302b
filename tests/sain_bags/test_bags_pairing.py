"""Ids pair what belongs together, whatever came first, and little has to be kept for it."""

from itertools import permutations
from types import SimpleNamespace as Message
from typing import Any

import pytest

from sain_bags.episodes import PREDICTION, PUSH_RESULT, SCENE
from sain_bags.pairing import PUSH, Paired, Pairing
from sain_bags.reader import Received


def push(number: int, scene: int = 0) -> Received:
    return received(PUSH, push_id=number, episode_id=1, scene_id=scene or number)


def result(number: int, code: int = 1) -> Received:
    body = push(number).message
    return received(PUSH_RESULT, push_id=number, episode_id=1, error_code=code, push=body)


def prediction(number: int) -> Received:
    return received(PREDICTION, push_id=number)


def scene(number: int, settled: bool = True) -> Received:
    return received(SCENE, episode_id=1, scene_id=number, settled=settled)


def received(kind: str, **fields: Any) -> Received:
    return Received("/sain/topic", kind, Message(**fields), 5, 5)


def pair(pairing: Pairing, *messages: Received) -> list[Paired]:
    found = [paired for message in messages for paired in pairing.add(message)]
    return [*found, *pairing.rest()]


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_any_order_of_push_result_and_prediction(order: tuple[int, ...]) -> None:
    messages = [push(7), result(7), prediction(7)]
    (paired,) = pair(Pairing(True, True), *(messages[place] for place in order))
    assert (paired.push_id, paired.refused) == (7, False)
    assert paired.result is messages[1].message
    assert paired.prediction is messages[2].message


@pytest.mark.parametrize("order", list(permutations(range(5))))
def test_any_order_of_push_and_scenes(order: tuple[int, ...]) -> None:
    messages = [push(7, 3), scene(3), scene(4, settled=False), scene(4), scene(5)]
    (paired,) = pair(Pairing(False, False), *(messages[place] for place in order))
    assert paired.before is messages[1].message
    assert paired.after is messages[3].message
    assert not paired.ambiguous


def test_pushes_come_in_their_order_when_predictions_do_not() -> None:
    messages = [result(1), result(2), prediction(2), result(3), prediction(1), prediction(3)]
    assert [paired.push_id for paired in pair(Pairing(True, True), *messages)] == [1, 2, 3]


def test_no_more_than_the_window_waits() -> None:
    pairing = Pairing(True, True, window=4)
    for number in range(1, 101):
        done = list(pairing.add(result(number)))
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
    refusal = result(1, code=9)
    refusal.message.push.scene_id = 9
    left = pair(Pairing(True, False), *messages[:2], refusal, *messages[2:])
    assert [(paired.push_id, paired.ambiguous) for paired in left] == [
        (1, False), (2, False), (3, False),
    ]  # fmt: skip
