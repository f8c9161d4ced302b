"""The film of trials: bodies as the simulator has them, clocks as the camera sees the goals."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from benchmarks.anything.__main__ import Options, recorded
from benchmarks.anything.film import CAMERA, GAP, RATE, SPEED, clocks, film
from sain_bags.reading.reader import Bag
from sain_bags.rows.episodes import read_episodes
from sain_bringup.movie import episode_moments
from sain_core.view.palette import PALETTE
from tests.sain_bags.conftest import SECOND, messages, record, resting_scene  # noqa: F401 - fixtures

TICK = SECOND // 10  # between messages of a recording


class Trial:
    """A recording of a UR5, its camera and the simulator's poses."""

    def __init__(self, recording):
        self.recording, self.make = recording, recording.messages.make

    def stamped(self, topic, kind, **fields):
        stamp = divmod(self.recording.now + TICK, SECOND)
        time = self.make("builtin_interfaces/msg/Time", sec=stamp[0], nanosec=stamp[1])
        header = self.make("std_msgs/msg/Header", stamp=time)
        self.recording.add(topic, kind, header=header, **fields)

    def goal(self, number, x):
        poses = self.recording.messages.poses(x)
        self.recording.add("/sain/goal", "Goal", goal_id=number, poses=poses)

    def scene(self, x, settled=True):
        disks = self.recording.messages.disks(resting_scene(x))
        self.stamped("/sain/scene", "Scene", episode_id=1, settled=settled, disks=disks)

    def truth(self, x, joint):
        self.stamped("/joint_states", "sensor_msgs/msg/JointState", position=np.full(6, joint))
        turned = self.make("geometry_msgs/msg/Quaternion", w=1.0)
        places = [self.make("geometry_msgs/msg/Point", x=at) for at in (x - 0.15, x)]
        poses = [
            self.make("geometry_msgs/msg/Pose", position=place, orientation=turned)
            for place in places
        ]
        self.stamped("/sain/truth", "geometry_msgs/msg/PoseArray", poses=poses)


@pytest.fixture
def bag(record, tmp_path):  # noqa: F811 - the fixture
    """A goal that is reached when the camera sees it, after the simulator has it; and another."""
    recording = record("logs/ur5-tags-jug/bag-1")
    trial = Trial(recording)
    trial.scene(0.45)
    trial.truth(0.45, 0.0)
    trial.goal(1, 0.60)
    for step in range(10):
        trial.truth(0.45 + 0.015 * (step + 1), 0.1 * step)
    trial.scene(0.60, settled=False)
    trial.scene(0.60)
    trial.goal(2, 0.50)
    trial.truth(0.60, 0.5)
    trial.scene(0.60)
    recording.writer.close()
    return tmp_path / "logs" / "ur5-tags-jug" / "bag-1"


def test_bodies_are_where_the_simulator_has_them_and_clocks_stop_where_they_are_seen(bag):
    parts = [part for one in read_episodes(Bag(bag)) for part in one.by_goal if part.goal]
    moments = episode_moments(Bag(bag), *parts)
    first = [one for one in moments if one.judged.goal.places[0, 0] == pytest.approx(0.60)]
    assert [one.scene[1, 0] for one in first[:10]] == pytest.approx(np.linspace(0.465, 0.6, 10))
    assert [one.joints[0] for one in first[:10]] == pytest.approx(0.1 * np.arange(10))
    assert [one.judged.distance for one in first[:10]] == pytest.approx([0.15] * 10), "as seen"
    assert clocks(first[:10]) == [(" 2.0 s ", PALETTE.ink)]
    assert clocks(first) == [(" 2.2 s ", PALETTE.success)]
    assert clocks(moments) == [(" 2.2 s ", PALETTE.success), (" 0.3 s ", PALETTE.ink)]


def test_a_film_shows_trials_side_by_side_as_fast_as_it_states(bag, tmp_path):
    options = Options(out=tmp_path, film=("mug", "jug"))
    bags = recorded(options, ["panda tags jug", "ur5 tags jug", "ur5 tags mug"])
    assert bags == {"jug": (bag, "ur5")}, "only what has a bag"
    with Image.open(BytesIO(film(bags | {"again": (bag, "ur5")}))) as shown:
        assert shown.size == (2 * CAMERA.width + GAP, CAMERA.height)
        seconds = 2.3 + 0.3  # from the first goal on, up to the last message
        assert shown.n_frames == pytest.approx(seconds / SPEED * RATE, abs=2)
        left = np.array(shown.convert("RGB"))
        shown.seek(shown.n_frames - 1)
        right = np.array(shown.convert("RGB"))
    moved = np.abs(right.astype(int) - left).max(axis=-1) > 40
    assert moved[:180, : CAMERA.width].sum() > 300 and moved[:180, CAMERA.width :].sum() > 300
