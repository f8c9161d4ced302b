"""From poses to scenes: ids, rest, jumps, and poses that are old."""

import re
from dataclasses import replace
from math import pi

import numpy as np
import pytest

from sain_arm.planning.push_planner import SLOW
from sain_core.errors import ErrorCode
from sain_core.scene import VELOCITY, VX
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.body_file import BodyFile
from sain_vision.scene.body_track import Observed, TrackingConfig
from sain_vision.scene.scene_tracker import SceneTracker
from tests.sain_vision.pictures import file_of

PERIOD = 1 / 30
START = np.array([[0.40, 0.0, 0.0], [0.60, 0.05, 0.0]])


def body_file(*shapes: str) -> BodyFile:
    names = ("mug", "target")[: len(shapes)]
    return replace(file_of(*((),) * len(shapes)), bodies=Bodies.named(shapes), names=names)


def everything(poses: np.ndarray) -> dict[int, Observed]:
    return {body: Observed(pose) for body, pose in enumerate(poses)}


class Laboratory:
    """A tracker, and a camera whose frames arrive at once."""

    def __init__(self, *shapes: str, noise: str = "0,0", **config: float) -> None:
        self.tracker = SceneTracker(
            body_file(*(shapes or ("disk", "disk"))), TrackingConfig(noise=noise, **config)
        )
        self.time, self.poses = 100.0, START.copy()
        self.noise = self.tracker._config.noise_std
        self.random = np.random.default_rng(0)

    def look(self, frames: int = 1, hidden: tuple[int, ...] = ()) -> None:
        for _ in range(frames):
            self.time += PERIOD
            seen = self.poses.copy()
            seen[:, :2] += self.noise[0] * self.random.standard_normal((len(seen), 2))
            seen[:, 2] += self.noise[1] * self.random.standard_normal(len(seen))
            shown = {n: one for n, one in everything(seen).items() if n not in hidden}
            self.tracker.observe(shown, self.time, self.time)

    def move(self, body: int, way: tuple[float, float], frames: int) -> None:
        for _ in range(frames):
            self.poses[body, :2] += np.array(way) / frames
            self.look()

    @property
    def ids(self) -> tuple[int, int]:
        return self.tracker.episode_id, self.tracker.scene_id


@pytest.fixture
def lab():
    """Two bodies that rest."""
    made = Laboratory()
    made.look(10)
    return made


def test_bodies_are_a_scene_once_they_rest():
    lab = Laboratory()
    lab.look()
    assert not lab.tracker.settled and not lab.tracker.ready
    lab.look(9)
    assert lab.tracker.settled
    assert lab.ids == (1, 1)
    scene = lab.tracker.scene()
    np.testing.assert_array_equal(scene[:, :3], START)
    assert not scene[:, VELOCITY].any()


def test_ids_go_on_after_those_of_another_process():
    lab = Laboratory()
    lab.tracker = SceneTracker(body_file("disk", "disk"), TrackingConfig(), (3, 9))
    lab.look(10)
    assert lab.ids == (4, 10)


def test_each_executed_push_counts_and_no_refused_one(lab):
    lab.tracker.sent(5, 1, 1, lab.time)
    lab.look()
    assert not lab.tracker.settled and lab.tracker.busy_with == 5
    lab.tracker.answered(5, ErrorCode.BLOCKED, lab.time)
    lab.look()
    assert lab.tracker.settled and lab.ids == (1, 1)
    for push_id in (6, 7):
        lab.tracker.sent(push_id, *lab.ids, lab.time)
        lab.move(0, (0.05, 0.0), 10)
        end = lab.time
        lab.look(12)
        assert lab.tracker.answered(push_id, ErrorCode.OK, end)  # the bodies were seen at rest
        assert not lab.tracker.answered(push_id, ErrorCode.OK, end)  # it came twice
        assert lab.tracker.settled and lab.ids == (1, push_id - 4)
    lab.look(30)
    assert lab.ids == (1, 3)


def test_frames_from_before_the_end_of_a_push_show_no_scene_after_it(lab):
    """A camera may be late: what rests in its frames has not been pushed yet."""
    lab.tracker.sent(5, 1, 1, lab.time)
    assert not lab.tracker.answered(5, ErrorCode.OK, lab.time + 0.2)
    lab.look(6)
    assert not lab.tracker.settled
    lab.look(10)
    assert lab.tracker.settled and lab.ids == (1, 2)


def test_a_push_without_a_result_is_lost_after_a_while():
    lab = Laboratory(push_timeout=2.0)
    lab.look(10)
    lab.tracker.sent(5, 1, 1, lab.time)
    lab.look(70)
    assert lab.tracker.lost == "push 5 has no result after 2 s"
    assert lab.tracker.settled


def test_a_body_that_somebody_moves_has_a_velocity_and_makes_another_scene(lab):
    lab.move(1, (0.03, 0.0), 9)
    assert not lab.tracker.settled
    assert lab.tracker.scene()[1, VX] == pytest.approx(0.1, rel=1e-6)
    lab.look(10)
    assert lab.tracker.settled and lab.ids == (1, 2)


def test_a_jump_ends_the_episode(lab):
    lab.poses[1, 0] += 0.2
    lab.look()
    assert lab.tracker.problem == (
        "body 1 (target) jumped by 0.200 m in 0.033 s; at most 1 m/s is taken for motion:"
        " nothing is pushed until all rest"
    )
    assert not lab.tracker.settled and lab.ids == (1, 1)
    lab.look(11)
    assert lab.tracker.settled and lab.ids == (2, 2) and not lab.tracker.problem


def test_noise_is_no_motion():
    lab = Laboratory("t", "t", noise="0.002,0.02")
    lab.look(1500)
    assert lab.tracker.settled and lab.ids == (1, 1)


def test_a_symmetric_body_that_is_seen_turned_has_not_moved():
    lab = Laboratory("square", "disk")
    lab.look(10)
    lab.poses[0, 2] += pi / 2
    lab.poses[1, 2] += 2.0
    lab.look()
    assert lab.tracker.settled and lab.ids == (1, 1)
    np.testing.assert_allclose(lab.tracker.scene()[:, 2], 0.0, atol=1e-9)


def test_poses_that_stop_coming_are_told(lab):
    lab.tracker.note_time(lab.time + 0.3)
    assert lab.tracker.settled
    lab.tracker.note_time(lab.time + 0.9)
    assert lab.tracker.problem == "the poses are 0.9 s old; at most 0.5 s is allowed"
    assert not lab.tracker.settled
    lab.time += 5.0
    lab.look(5)
    assert not lab.tracker.settled  # whether they rest is unknown
    lab.look(6)
    assert lab.tracker.settled and lab.ids == (1, 1)


def test_a_hidden_body_is_held_and_settles_nothing(lab):
    lab.look(10, hidden=(1,))
    assert lab.tracker.settled
    lab.look(10, hidden=(1,))
    assert not lab.tracker.settled
    assert re.match(r"body 1 \(target\) was last seen 0\.\d s ago; it is", lab.tracker.problem)
    np.testing.assert_array_equal(lab.tracker.scene()[1, :3], START[1])
    lab.poses[1, 0] += 0.1
    lab.look(11)
    assert lab.tracker.settled and lab.ids == (1, 2)


def test_where_an_arm_hides_a_body_in_a_push_nothing_is_at_rest(lab):
    lab.tracker.sent(1, *lab.ids, lab.time)
    lab.look(20, hidden=(0,))
    assert not lab.tracker.settled
    assert lab.tracker.scene()[:, VELOCITY].any()  # or else it would be the result of the push
    np.testing.assert_allclose(lab.tracker.scene()[:, :2], lab.poses[:, :2])


def test_a_pushed_body_that_no_look_has_shown_elsewhere_may_be_anywhere(lab):
    lab.tracker.sent(1, *lab.ids, lab.time, body=1)
    for shown in ({0: Observed(START[0])}, {}):
        lab.time += PERIOD
        assert lab.tracker.observe(shown, lab.time, lab.time, whole=True)
        scene = lab.tracker.scene()
        assert scene[1, VX] > SLOW and not scene[0, VELOCITY].any()  # the arm goes above it
    lab.look()
    assert not lab.tracker.scene()[:, VELOCITY].any()
    lab.move(1, (0.05, 0.0), 10)
    lab.look(10)
    lab.time += PERIOD
    assert lab.tracker.observe({0: Observed(START[0])}, lab.time, lab.time, whole=True)
    assert not lab.tracker.scene()[:, VELOCITY].any()  # it was seen at rest after the push


def test_where_an_arm_hides_all_bodies_in_a_push_they_are_held():
    lab = Laboratory("disk")
    lab.poses = START[:1].copy()
    lab.look(20)
    seen = lab.tracker.stamp
    lab.look(20, hidden=(0,))
    assert lab.tracker.stamp == seen  # without a push it does not count
    lab.look(20)
    lab.tracker.sent(1, *lab.ids, lab.time)
    for _ in range(20):
        lab.time += PERIOD
        assert lab.tracker.observe({}, lab.time, lab.time)
        assert not lab.tracker.observe({}, lab.time - 0.1, lab.time)
        assert lab.tracker.stamp == lab.time
    assert lab.tracker.scene()[:, VELOCITY].any()
    lab.look(20)
    assert not lab.tracker.scene()[:, VELOCITY].any()
    lab.tracker.answered(1, ErrorCode.OK, lab.time)
    lab.look(20)
    assert lab.tracker.settled


def test_bodies_may_come_one_by_one_and_there_is_no_scene_before_each_was_seen():
    lab = Laboratory()
    lab.look(20, hidden=(1,))
    assert not lab.tracker.ready
    assert lab.tracker.problem == "body 1 (target) has not been seen yet"
    for _ in range(12):
        lab.look(hidden=(0,))
        lab.look(hidden=(1,))
    assert lab.tracker.settled and lab.ids == (1, 1)


def test_the_estimate_weighs_poses_and_shares_their_errors():
    lab = Laboratory()
    for offset, scale in ((0.0, 1.0), (0.0004, 3.0)) * 5:
        lab.time += PERIOD
        variance = 1e-8 * scale * np.eye(3)
        seen = {b: Observed(START[b] + (offset, 0, 0), variance) for b in (0, 1)}
        lab.tracker.observe(seen, lab.time, lab.time)
    pose, covariance = lab.tracker.estimates()[0]
    np.testing.assert_allclose(pose, START[0] + (0.0001, 0, 0), atol=1e-6)
    np.testing.assert_allclose(covariance, 1.5e-8 * np.eye(3), rtol=1e-3)
