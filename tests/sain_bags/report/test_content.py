"""What a page is made of, without a browser: what is gathered from a bag, and how it is written."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from sain_bags.report.gathering import Frames
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
    assert second["counts"] == {"executed": 2, "refused": 1}


def test_the_figures_are_those_of_the_bag(bag):
    found, pushes = recorded(bag), [p for one in content(bag)["episodes"] for p in one["pushes"]]
    assert [push["outcome"] for push in pushes].count("refused") == 1
    for push, result, plan in zip(pushes, found["push_result"], found["plan"], strict=True):
        goal = found["goal"][result.episode_id - 1].poses[0]
        before, after = (scene.disks[1] for scene in (result.before, result.after))
        expected = plan.predicted.reshape(2, -1, 8)[0, 1]
        errors = [
            math.hypot(one.x - after.x, one.y - after.y)
            for one in (SimpleNamespace(x=expected[0], y=expected[1]), result.prediction.disks[1])
        ]
        wanted = [*errors, math.dist((before.x, before.y), (after.x, after.y))]
        done = push["outcome"] == "executed"
        names = ("expectedError", "physicsError", "moved")
        assert [push[name] for name in names] == (
            pytest.approx(wanted, abs=1e-8) if done else [None] * 3
        )
        end = math.hypot(after.x - goal.x, after.y - goal.y)
        assert push["distance"][1] == (pytest.approx(end, abs=1e-8) if done else None)
        assert push["planning"] == pytest.approx(plan.planning_time, abs=1e-8)
        assert push["location"] == pytest.approx(result.push.location, abs=1e-8)


def test_numbers_that_are_none_never_reach_the_page(record, tmp_path):
    recording = record()
    scene, good = resting_scene(0.5), resting_scene(0.5)
    scene[0, 7], scene[1, :2] = -0.08, 1e6
    recording.scene(1, 1, scene)
    recording.push(1, 1, good, resting_scene(0.6), location=1e9)
    recording.push(2, 1, good, good, error_code=9, location=np.nan)
    recording.writer.close()
    json.dumps(content(tmp_path / "bag"), allow_nan=False)


def test_scenes_that_make_no_sense_are_counted_and_left_out():
    frames = Frames(10)
    for message in (scene_message(), scene_message(x=float("nan")), scene_message(disks=3)):
        frames.add(message, 1)
    assert len(frames.frames) == 1 and frames.unusable == 2


def test_a_long_episode_is_thinned_and_the_page_says_so(bag):
    first = content(bag, frames=5)["episodes"][0]
    assert len(first["frames"]["time"]) <= 5 + 3
    assert first["frames"]["recorded"] > len(first["frames"]["time"])
    assert first["frames"]["thinned"] > 1
    assert all(first["frames"]["settled"][push["to"]] for push in first["pushes"])


def test_without_scenes_those_of_the_pushes_are_shown(record, tmp_path):
    recording = record()
    Show(recording, scenes=False).episode(1, 2, [0.05, 0.03])
    recording.writer.close()
    (episode,) = content(tmp_path / "bag")["episodes"]
    assert episode["frames"]["fromPushes"] and len(episode["frames"]["poses"]) == 3
    assert [(push["from"], push["to"]) for push in episode["pushes"]] == [(0, 1), (1, 2)]


def test_pushes_without_results_are_counted(record, tmp_path):
    recording = record()
    Show(recording, results=False).episode(1, 2, [0.05, 0.03])
    recording.writer.close()
    data = content(tmp_path / "bag")
    assert not data["episodes"][0]["pushes"]
    assert data["totals"]["unanswered"] == 2


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
