"""Recordings of before, and those without results, become results of today: ids join messages."""

from collections.abc import Callable, Sequence
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sain_bags.reading.reader import Bag
from sain_bags.recovery.recovery import recover
from sain_bags.rows import old_recordings
from sain_bags.rows.episodes import read_episodes
from sain_bags.rows.old_recordings import AMBIGUOUS, NO_SCENES, REPEATED, as_today
from sain_bags.rows.recorded_push import RecordedPush
from sain_bags.rows.results import read_results
from tests.old_files.reading import FOLDER, KINDS
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


def test_no_more_than_the_window_waits(pushes: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(old_recordings, "WINDOW", 4)
    steps = [result(number, scene=number) for number in range(1, 21)]
    found = pushes([*steps, prediction(1), prediction(20)])
    assert [one.push_id for one in found] == list(range(1, 21))
    assert [one.push_id for one in found if one.physics is not None] == [20]


def test_what_is_as_today_stays_as_it_is(episode_bag: Path) -> None:
    bag = Bag(episode_bag)
    assert as_today(bag) is bag


@pytest.mark.parametrize("kind", KINDS)
def test_a_recovered_recording_of_before_means_the_same(kind: str, tmp_path: Path) -> None:
    source = FOLDER / f"{kind}_bag"
    recover(source, tmp_path / "saved")
    for one, other in zip(read(Bag(source)), read(Bag(tmp_path / "saved")), strict=True):
        for name, value in vars(one).items():
            np.testing.assert_array_equal(value, vars(other)[name], name)
    wanted, found = (read_episodes(Bag(path)) for path in (source, tmp_path / "saved"))
    assert [len(one.pushes) for one in wanted] == [len(one.pushes) for one in found]
