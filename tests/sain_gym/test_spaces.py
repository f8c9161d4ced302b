"""Actions become pushes, and scenes observations."""

from math import pi

import numpy as np
import pytest

from sain_core.push import ANGLE, PushLimits, make_push
from sain_eval.scenes.scenarios import SCENARIOS
from sain_gym.spaces import PushSpaces

LIMITS = PushLimits()


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
def test_limits_in_any_precision_are_the_limits(kind):
    """A policy in single precision that clips to the space must not be out of range."""
    spaces = PushSpaces("anywhere")
    for limit in (spaces.action.low, spaces.action.high):
        push = spaces.push_of(limit.astype(kind))
        assert push.dtype == np.float64
        assert push.tolist() == [0.0, pi, *limit[ANGLE:]]
        LIMITS.check(push)


@pytest.mark.parametrize("scenario", sorted(SCENARIOS))
def test_scenes_fit(scenario):
    spaces = PushSpaces(scenario)
    counts, some = set(), range(3 if scenario == "streak" else 8)
    for seed in some:
        case = SCENARIOS[scenario].scene(seed)
        counts.add(len(case.disks))
        for goal in case.goals[:3]:
            assert spaces.state_of(case.disks, goal) in spaces.state
    assert max(counts) == spaces.most
    assert (len(counts) > 1) == (scenario in ("clutter", "blocked"))


@pytest.mark.parametrize("scenario", ["anywhere", "rearrange_2"])
def test_a_push_is_an_action(scenario):
    spaces, push = PushSpaces(scenario), make_push(1.0, 0.2, 0.1, speed=0.05)
    assert push in spaces.action
    assert spaces.push_of(push).tolist() == push.tolist()
