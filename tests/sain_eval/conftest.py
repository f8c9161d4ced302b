"""A short episode made up by hand, for everything that only reads one."""

import numpy as np
import pytest

from sain_core.goal import Goal
from sain_core.push import make_push
from sain_core.scene import POSITION, TARGET, make_scene
from sain_core.world import PushRecord
from sain_eval.episode import EpisodeRecord


@pytest.fixture
def episode():
    """Two pushes that bring the target to 40 mm and then to 8 mm from the goal."""
    place = np.array([0.70, 0.0])
    scenes = [
        make_scene(np.array([[x - 0.141, 0.0], [x, 0.0]]), np.full(2, 8.0), np.array([0.08, 0.06]))
        for x in (0.50, 0.66, 0.692)
    ]
    predicted = [scene.copy() for scene in scenes[1:]]
    predicted[0][TARGET, POSITION] += [0.003, 0.004]
    pushes = tuple(
        PushRecord(make_push(0.0, 0.1, 0.12), before, after, expected, planning_time=0.05)
        for before, expected, after in zip(scenes, predicted, scenes[1:], strict=False)
    )
    return EpisodeRecord(Goal.place(*place, 0.02), pushes, scenes[0])
