"""Recordings of before, and those without results, become results of today: ids join messages."""

from collections.abc import Callable, Sequence
from itertools import permutations
from typing import Any

import numpy as np
import pytest

from sain_bags.reading.reader import Bag
from sain_bags.rows.old_recordings import AMBIGUOUS, NO_SCENES, REPEATED, as_today
from sain_bags.rows.recorded_push import RecordedPush
from sain_bags.rows.results import read_results
from tests.sain_bags.conftest import Messages, resting_scene

BEFORE, AFTER = resting_scene(0.45), resting_scene(0.60)
Step = Callable[[Any], None]


def push(number: int, scene: int = 1) -> Step:
    return lambda r: r.add("/sain/push", "Push", push_id=number, episode_id=1, scene_id=scene)


def result(number: int, code: int = 1, scene: int = 1) -> Step:
    def add(recording: Any) -> None:
        make, disks = recording.messages.make, recording.messages.disks
        ids = {"push_id": number, "episode_id": 1}
        sent = make("sain_interfaces/msg/Push", **ids, scene_id=scene)
        before, after = (
            make("sain_interfaces/msg/Scene", scene_id=one, settled=True, disks=disks(state))
            for one, state in ((scene, BEFORE), (scene + 1, AFTER))
        )
        scenes = {"push": sent, "before": before, "after": after}
        recording.add("/sain/push_result", "PushResult", **ids, error_code=code, **scenes)

    return add


def prediction(number: int) -> Step:
    def add(recording: Any) -> None:
        found = {"model": "bullet_nominal", "error_code": 1}
        disks = recording.messages.disks(AFTER + 0.003)
        topic = "/sain/physics_prediction"
        recording.add(topic, "PushPrediction", push_id=number, **found, disks=disks)

    return add


def scene(number: int) -> Step:
    return lambda recording: recording.scene(1, number, BEFORE if number == 1 else AFTER)


@pytest.fixture
def pushes(record: Callable[..., Any]) -> Callable[..., list[RecordedPush]]:
    """Record messages of before; return the pushes as all readers see them."""

    def run(steps: Sequence[Step], name: str = "bag") -> list[RecordedPush]:
        recording = record(name)
        recording.messages = Messages(old=True)
        for step in steps:
            step(recording)
        recording.writer.close()
        return read(Bag(recording.writer.folder))

    return run


def read(bag: Bag) -> list[RecordedPush]:
    return [push for found in read_results(as_today(bag), "/sain") for push in found.pushes()]


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_a_push_its_result_and_its_prediction_come_in_any_order(order: Any, pushes: Any) -> None:
    steps = [push(7), result(7), prediction(7)]
    (one,) = pushes([steps[place] for place in order])
    assert (one.push_id, one.executed, one.physics_model) == (7, True, "bullet_nominal")
    np.testing.assert_array_equal(one.physics, AFTER + 0.003)


@pytest.mark.parametrize("order", list(permutations(range(4))))
def test_a_push_and_the_scenes_around_it_come_in_any_order(order: Any, pushes: Any) -> None:
    steps = [push(7), scene(1), scene(2), scene(3)]
    (one,) = pushes([steps[place] for place in order])
    assert not one.answered and one.error_message == ""
    np.testing.assert_array_equal(one.before, BEFORE)
    np.testing.assert_array_equal(one.after, AFTER)


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ([push(1), result(9, scene=5), push(2), scene(1), scene(2)], [AMBIGUOUS, AMBIGUOUS]),
        ([push(1), push(2), result(1, code=9), scene(1), scene(2)], [""]),
        ([push(1), push(2), result(2), scene(1), scene(2)], [AMBIGUOUS]),
        ([push(1), result(9, scene=5), scene(1)], [NO_SCENES]),
        ([scene(1), push(5), scene(2), push(5, 2), scene(3)], ["", REPEATED]),
    ],
)
def test_what_came_of_a_push_without_a_result(steps: Any, said: list[str], pushes: Any) -> None:
    unanswered = [one for one in pushes(steps) if not one.answered]
    assert [one.error_message for one in unanswered] == said
