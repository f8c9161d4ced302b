"""What a page is made of, without a browser: what is gathered from a bag, and how it is written."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sain_bags.reading.reader import Bag, Raw
from sain_bags.reading.timing import BINS, TopicTiming, read_timings
from sain_bags.report.frames import Frame, Frames, frame_times
from sain_core.scene import STATE_NAMES
from tests.sain_bags.conftest import resting_scene
from tests.sain_bags.report.contents import content
from tests.sain_bags.shown import STEPS, Show, recorded, shown_scenes


def scene_message(scene_id=1, settled=False, x=0.3, stamp=0, disks=2):
    states = [dict.fromkeys(STATE_NAMES, 0.1) | {"x": x + disk} for disk in range(disks)]
    time = SimpleNamespace(sec=stamp // 10**9, nanosec=stamp % 10**9)
    return SimpleNamespace(
        header=SimpleNamespace(stamp=time), scene_id=scene_id, settled=settled,
        disks=[SimpleNamespace(**state) for state in states],
    )  # fmt: skip


def test_frames_are_the_recorded_scenes(bag):
    for episode in content(bag)["episodes"]:
        scenes = shown_scenes(bag, episode["number"])
        expected = [[[d.x, d.y, d.theta] for d in scene.disks] for scene in scenes]
        assert np.allclose(episode["frames"]["poses"], expected, atol=1e-5, rtol=0)
        stamps = [s.header.stamp.sec + 1e-9 * s.header.stamp.nanosec for s in scenes]
        assert np.allclose(episode["frames"]["time"], np.array(stamps) - stamps[0], atol=1e-4)
        radii = [disk["radius"] for disk in episode["disks"]]
        assert np.allclose(radii, [disk.radius for disk in scenes[0].disks], atol=1e-5)


def test_the_page_gets_the_outline_of_every_shape_that_is_not_round(record, tmp_path, hexagon):
    recording = record()
    shapes = ["flat", "six_sided", "a shape of another machine"]
    recording.add("/sain/world_parameters", "WorldParameters", episode_id=1, shapes=shapes)
    Show(recording).episode(1, 3, [0.05])
    recording.writer.close()
    (episode,) = content(tmp_path / "bag")["episodes"]
    flat, six, other = episode["disks"]
    assert flat["outline"] is other["outline"] is None
    assert np.allclose(six["outline"], hexagon.outline(six["radius"]), atol=1e-4)


def test_a_push_lies_between_its_scenes(bag):
    second = content(bag)["episodes"][1]
    assert [push["outcome"] for push in second["pushes"]] == ["executed", "refused", "executed"]
    for push in second["pushes"]:
        if push["outcome"] == "executed":
            assert push["to"] - push["from"] == STEPS + 1
    refused = second["pushes"][1]
    assert refused["to"] == refused["from"]
    assert [thing["kind"] for thing in refused["things"]] == ["push"]
    assert (refused["reason"], refused["message"]) == ("blocked", "disk 2 is in the way")
    assert second["counts"] == {"executed": 2, "refused": 1, "unanswered": 0}


def test_errors_are_those_of_the_recording(bag):
    found = recorded(bag)
    plans = {plan.push_id: plan for plan in found["plan"]}
    results = {result.push_id: result for result in found["push_result"]}
    seen = 0
    for episode in content(bag)["episodes"]:
        for push in episode["pushes"]:
            number = int(push["id"])
            if push["outcome"] == "refused":
                assert push["expectedError"] is None and push["physicsError"] is None
                continue
            target, seen = results[number].after.disks[1], seen + 1
            expected = plans[number].predicted.reshape(2, -1, 8)[0, 1]
            error = np.hypot(expected[0] - target.x, expected[1] - target.y)
            assert push["expectedError"] == pytest.approx(error, abs=1e-5)
            disk = results[number].prediction.disks[1]
            error = np.hypot(disk.x - target.x, disk.y - target.y)
            assert push["physicsError"] == pytest.approx(error, abs=1e-5)
            assert push["planning"] == pytest.approx(plans[number].planning_time, abs=1e-5)
    assert seen == 4


def test_totals_and_curves(bag):
    data = content(bag)
    totals = {"episodes": 2, "withGoal": 2, "reached": 2, "executed": 4, "refused": 1}
    assert data["totals"] == totals | {"unanswered": 0, "fallbacks": 0}
    titles = [episode["title"] for episode in data["episodes"]]
    assert titles == ["Episode 1 · anywhere 4", "Episode 2 · clutter 5"]
    assert sum(data["planning"]["counts"]) == data["planning"]["plans"] == 5
    assert data["planning"]["edges"][0] == 0.0 and data["planning"]["median"] == 0.03
    off = np.hypot(1.0, 0.5) * 1e-3 * np.array([1, 2, 3, 5])  # as `Show` predicts them
    assert np.allclose(data["errors"]["expected"]["sorted"], off, atol=1e-5)
    assert data["errors"]["expected"]["shares"] == [0.25, 0.5, 0.75, 1.0]
    assert np.allclose(data["errors"]["physics"]["sorted"], 3 * off, atol=1e-5)


def test_topics_are_shown_as_they_were_recorded(record, tmp_path, messages):
    recording = record()
    Show(recording).episode(1, 2, [0.05])
    topic, data = "/tick", bytes(messages.store.serialize_cdr(
        messages.make("std_msgs/msg/Bool"), "std_msgs/msg/Bool"
    ))  # fmt: skip
    recording.writer.add_topic(messages.topic(topic, "std_msgs/msg/Bool"))
    for place, sequence in enumerate((3, 4, 9, 10, 12)):
        recording.writer.write(topic, data, recording.now + place * 10**9, sequence=sequence)
    recording.writer.close()
    bag = Bag(tmp_path / "bag")
    timings, shown = read_timings(bag), content(tmp_path / "bag")["topics"]
    for one, recorded_topic in zip(shown, bag.topics, strict=True):
        timing = timings[one["name"]]
        assert one["messages"] == recorded_topic.messages == sum(one["counts"])
        assert len(one["counts"]) == BINS
        assert (one["rate"], one["gap"]) == (timing.rate, timing.longest_gap)
        assert one["missing"] == timing.missing
    assert (shown[-1]["rate"], shown[-1]["gap"], shown[-1]["missing"]) == (1.0, 1.0, 5)
    places = shown[-1]["places"]
    seconds = 1e-9 * (recording.now - bag.start)
    assert places == [[pytest.approx(seconds + 2), 4], [pytest.approx(seconds + 4), 1]]


@given(st.integers(1, 20), st.lists(st.integers(1, 60), min_size=1, max_size=6))
def test_thinning_keeps_every_rest_and_no_more_than_asked(most, lengths):
    frames, stamp = Frames(most), 0
    for scene_id, length in enumerate(lengths):
        for settled in (True, True, *([False] * length)):
            stamp += 1
            frames.add(scene_message(scene_id, settled, stamp=stamp), stamp)
    kept = frames.frames
    assert [frame.scene_id for frame in kept if frame.settled] == list(range(len(lengths)))
    moving = [frame.stamp for frame in kept if not frame.settled]
    assert len(moving) <= most and (len(moving) > most // 2 or len(moving) == sum(lengths))
    assert frames.recorded == stamp
    assert list(frame_times(kept)) == sorted(frame_times(kept))


def test_scenes_that_make_no_sense_are_counted_and_left_out():
    frames = Frames(10)
    for message in (scene_message(), scene_message(x=float("nan")), scene_message(disks=3)):
        frames.add(message, 1)
    assert len(frames.frames) == 1 and frames.unusable == 2


@pytest.mark.parametrize(
    ("stamps", "received", "times"),
    [
        ((10, 20, 40), (1, 2, 3), (0, 10, 30)),
        ((10, 20, 15), (1, 2, 4), (0, 1, 3)),  # goes back
        ((7, 7, 7), (1, 2, 4), (0, 1, 3)),  # stands still
        ((7, 7, 7), (1, 1, 1), (0e9, 1e9, 2e9)),  # nothing moves: one second each
    ],
)
def test_times_are_stamps_where_these_make_sense(stamps, received, times):
    scene = np.zeros((2, 8))
    frames = [Frame(s, r, 1, False, scene) for s, r in zip(stamps, received, strict=True)]
    assert frame_times(frames) == pytest.approx(1e-9 * np.array(times))


def test_a_long_episode_is_thinned_and_the_page_says_so(bag):
    first = content(bag, frames=5)["episodes"][0]
    assert len(first["frames"]["time"]) <= 5 + 3
    assert first["frames"]["recorded"] > len(first["frames"]["time"])
    assert first["frames"]["thinned"] > 1
    assert all(first["frames"]["settled"][push["to"]] for push in first["pushes"])


def test_later_episodes_are_only_counted(bag):
    data = content(bag, episodes=1)
    assert len(data["episodes"]) == 1 and data["totals"]["episodes"] == 2
    assert data["totals"]["executed"] == 4


def test_without_scenes_those_of_the_pushes_are_shown(record, tmp_path):
    recording = record()
    Show(recording, scenes=False).episode(1, 2, [0.05, 0.03])
    recording.writer.close()
    (episode,) = content(tmp_path / "bag")["episodes"]
    assert episode["frames"]["fromPushes"] and len(episode["frames"]["poses"]) == 3
    assert [(push["from"], push["to"]) for push in episode["pushes"]] == [(0, 1), (1, 2)]


def test_without_results_the_scenes_tell(record, tmp_path):
    recording = record()
    Show(recording, results=False).episode(1, 2, [0.05, 0.03])
    recording.writer.close()
    data = content(tmp_path / "bag")
    pushes = data["episodes"][0]["pushes"]
    assert [push["outcome"] for push in pushes] == ["unanswered"] * 2
    assert [push["moved"] for push in pushes] == pytest.approx(
        np.hypot(1, 0.5) * np.array([0.05, 0.03]), abs=1e-5
    )
    assert data["totals"]["unanswered"] == 2


def test_what_another_push_did_is_not_ascribed_to_one_without_a_result(record, tmp_path):
    recording = record()
    show = Show(recording)
    show.episode(1, 2, [0.05])
    recording.add("/sain/push", "Push", push_id=77, episode_id=1, scene_id=1, length=0.1)
    recording.writer.close()
    pushes = content(tmp_path / "bag")["episodes"][0]["pushes"]
    assert [(push["outcome"], push["moved"] is None) for push in pushes] == [
        ("executed", False), ("unanswered", True)
    ]  # fmt: skip


def test_a_simulator_that_was_started_anew_gives_episodes_of_its_own(record, tmp_path):
    recording = record()
    for _ in range(2):
        show = Show(recording)
        show.episode(1, 2, [0.05])
        show.episode(2, 2, [0.03])
    recording.writer.close()
    data = content(tmp_path / "bag")
    assert [episode["number"] for episode in data["episodes"]] == [1, 2, 1, 2]
    assert data["totals"]["executed"] == 4


def test_a_bag_without_episodes_has_topics(record, tmp_path):
    recording = record()
    recording.add("/flag", "std_msgs/msg/Bool", data=True)
    recording.writer.close()
    data = content(tmp_path / "bag")
    assert not data["episodes"] and data["planning"] is None
    assert data["notice"].startswith("This recording has no scenes and no pushes.")
    assert [topic["messages"] for topic in data["topics"]] == [1]


def test_an_empty_bag_has_a_page(record, tmp_path):
    record().writer.close()
    data = content(tmp_path / "bag")
    assert data["bag"]["messages"] == 0 and data["notice"] == "This recording has no messages."


def test_an_episode_in_which_nothing_happened_is_left_out_and_named(record, tmp_path):
    recording = record()
    recording.scene(1, 1, resting_scene(0.5))
    show = Show(recording)
    show.scene_id = 1
    show.episode(2, 2, [0.05])
    recording.writer.close()
    data = content(tmp_path / "bag")
    assert [episode["number"] for episode in data["episodes"]] == [2]
    assert data["idle"] == "Not shown: Episode 1, which has no goal, no push and no motion."
    assert data["totals"]["episodes"] == 1 and data["notice"] == ""


def test_a_bag_without_pushes_says_so(record, tmp_path):
    recording = record()
    recording.scene(1, 1, resting_scene(0.5))
    recording.writer.close()
    data = content(tmp_path / "bag")
    assert data["notice"].startswith("This recording has no pushes.")
    assert [episode["number"] for episode in data["episodes"]] == [1]
    only_refused = record("refused")
    scene = resting_scene(0.5)
    only_refused.push(1, 1, scene, scene, error_code=9)
    only_refused.writer.close()
    notice = content(tmp_path / "refused")["notice"]
    assert notice == "No push was executed in this recording: 1 refused."


def test_what_a_split_repeats_is_counted_once():
    timing = TopicTiming()
    for log_time, sequence, published in ((10, 1, 9), (20, 1, 9), (30, 2, 29), (40, 2, 29)):
        timing.saw(Raw("/a", "", b"", log_time, published, sequence), 0)
    assert (timing.messages, timing.missing, timing.longest_gap) == (2, 0, pytest.approx(2e-8))
