"""Policies by name, and what they may observe."""

import numpy as np
import pytest

from sain_core.errors import CheckpointError, ConfigError
from sain_core.goal import BodyPose, Goal
from sain_core.policy import (
    ACTION,
    GOAL,
    IMAGE,
    STATE,
    TASK,
    check_features,
    check_names,
    load_policy,
    names_of_numbers,
    observe,
)
from sain_core.scene import make_scene
from sain_core.shapes.bodies import PAPER_DISKS
from sain_core.wire.images import CAMERAS

SCENE = make_scene(np.array([(0.45, 0.0), (0.60, 0.1)]), np.full(2, 8.0), np.array([0.08, 0.06]))
AIM = Goal((BodyPose(1, 0.7, 0.05),))


def test_what_is_observed_has_the_names_of_the_data_sets():
    seen = observe(SCENE, AIM, PAPER_DISKS, {IMAGE: (96, 96, 3)})
    names = names_of_numbers(2)
    found = dict(zip(names[STATE] + names[GOAL], [*seen[STATE], *seen[GOAL]], strict=True))
    assert found["target_y"] == 0.1 and found["mid_radius"] == 0.08
    assert (found["mid_goal_wanted"], found["target_goal_wanted"]) == (0.0, 1.0)
    assert (found["target_goal_x"], found["target_goal_y"]) == (0.7, 0.05)
    assert seen[IMAGE].shape == (96, 96, 3) and seen[IMAGE].dtype == np.uint8
    assert seen[TASK].startswith("Push the mid disk")


@pytest.mark.parametrize(
    ("name", "error", "text"),
    [
        ("nobody", ConfigError, "policy 'nobody' is unknown"),
        ("tests.nowhere:make", ConfigError, "No module named 'tests.nowhere'"),
        ("tests.policies:no_policy", ConfigError, "returned a str; a policy inherits from"),
        ("tests.policies:of_numbers", ConfigError, "needed: shapes, tuples of whole numbers of 1"),
        ("./nowhere", CheckpointError, "nowhere holds no config.json; give the folder"),
    ],
)
def test_a_policy_that_cannot_be_used_is_named_with_the_reason(name, error, text):
    with pytest.raises(error, match=text):
        load_policy(name)


@pytest.mark.parametrize(
    ("features", "text"),
    [
        ({STATE: (14,)}, r"observation.state \(14,\); there are, with 1 bodies, observation.state"),
        ({STATE: (16,), GOAL: (5,)}, r"environment_state \(5,\); there are, with 2 bodies"),
        ({IMAGE: (96, 128, 3)}, r"observation.image \(96, 128, 3\)"),
        ({f"{CAMERAS}wrist": (96, 128)}, r"wrist \(96, 128\); .* in a graph observation.images.N"),
    ],
)
def test_shapes_that_no_scene_has_are_refused(features, text):
    with pytest.raises(ConfigError, match=text):
        check_features("act", features)


def test_a_scene_of_other_bodies_is_refused():
    features = {STATE: (16,), GOAL: (10,), IMAGE: (96, 96, 3)}
    check_features("act", features)
    check_features("act", features, 2)
    with pytest.raises(ConfigError, match=r"observation.state \(16,\); there are, with 3 bodies"):
        check_features("act", features, 3)


def test_a_data_set_that_states_other_numbers_is_refused():
    stated = dict(names_of_numbers(2)) | {IMAGE: ["height", "width", "channels"], "task": None}
    check_names("the data set", stated)
    stated[ACTION] = ["location", "body", "angle", "length", "speed"]
    with pytest.raises(ConfigError, match=r"action has location, body, .* not body, location"):
        check_names("the data set", stated)
