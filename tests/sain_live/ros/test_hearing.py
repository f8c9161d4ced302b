"""What the page hears: messages that cannot be, or are of another episode, change nothing."""

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState

from sain_core.errors import InvalidInputError
from sain_core.ros import codec
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_live.ros.hearing import Hearing
from sain_live.state import LiveState

SCENE = make_scene(np.array([(0.4, 0.0), (0.6, 0.2)]), np.full(2, 8.0), np.full(2, 0.06))
TEE, BOX = Bodies.named(["t", "disk"]), Bodies.named(["box_3x2", "disk"])


@pytest.fixture
def known() -> LiveState:
    return LiveState()


@pytest.fixture
def hearing(known) -> Hearing:
    return Hearing(known, lambda: True)


def scene(episode_id, scene_id=1):
    ids = {"episode_id": episode_id, "scene_id": scene_id}
    return codec.encode_scene(SCENE, stamp=Time(), settled=True, **ids)


def shapes(bodies, episode_id):
    return codec.encode_bodies(bodies, [0.06, 0.06], stamp=Time(), episode_id=episode_id)


def test_shapes_of_another_episode_wait_for_its_scenes(known, hearing):
    hearing._on_scene(scene(1))
    assert known.scene is None  # its shapes are on their way
    hearing._on_bodies(shapes(BOX, 7))
    hearing._on_bodies(shapes(TEE, 1))
    assert (known.scene.episode_id, known.bodies) == (1, TEE)
    for episode in range(100, 200):
        hearing._on_bodies(shapes(BOX, episode))
    hearing._on_scene(scene(1, 2))
    assert (known.scene.scene_id, known.bodies) == (2, TEE)
    hearing._on_scene(scene(199))
    assert (known.scene.episode_id, known.bodies) == (199, BOX)


def test_joints_of_unequal_lengths_are_refused(known, hearing):
    hearing._on_joints(JointState(name=["a"], position=[0.5]))
    wrong = JointState(name=["a", "b", "c"], position=[0.1, 0.2])
    with pytest.raises(InvalidInputError, match="3 names and 2 positions; allowed: as many"):
        hearing._on_joints(wrong)
    assert known.joints == {"a": 0.5}
