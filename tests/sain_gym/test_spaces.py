"""Actions become pushes, and scenes observations."""

from math import pi

import numpy as np
import pytest

from sain_core.push import ANGLE, BODY, PushLimits, make_push
from sain_eval.scenes.scenarios import SCENARIOS
from sain_gym.spaces import PushSpaces

LIMITS = PushLimits()


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
def test_limits_in_any_precision_are_the_limits(kind: type) -> None:
    """A policy in single precision that clips to the space must not be out of range."""
    spaces = PushSpaces("anywhere")
    for limit in (spaces.action.low, spaces.action.high):
        push = spaces.push_of(limit.astype(kind))
        assert push.dtype == np.float64
        assert push.tolist() == [0.0, pi, *limit[ANGLE:]]
        LIMITS.check(push)


def test_numbers_within_the_limits_stay_as_they_are() -> None:
    spaces = PushSpaces("anywhere")
    push = make_push(-3.1, 0.123456789, 0.15)
    assert spaces.push_of(push).tolist() == push.tolist()
    assert spaces.push_of([0, 1, 0, 0, 0.5]).tolist() == [0.0, 1.0, 0.0, 0.0, 0.5]
    given = push.copy()
    spaces.push_of(given)[:] = 0.0
    assert given.tolist() == push.tolist()


@pytest.mark.parametrize(
    ("number", "body"), [(-0.5, 0), (0.0, 0), (0.49, 0), (0.5, 1), (1.0, 1), (2.49, 2), (2.5, 2)]
)
def test_the_body_is_the_nearest_whole_number(number: float, body: int) -> None:
    push = PushSpaces("rearrange_3").push_of(make_push(0.0, 0.0, 0.1, body=number))
    assert push.tolist() == [body, 0.0, 0.0, 0.1, 0.2]


def test_each_body_has_the_same_share_of_random_actions() -> None:
    spaces = PushSpaces("rearrange_3")
    spaces.action.seed(0)
    bodies = [spaces.push_of(spaces.action.sample())[BODY] for _ in range(3000)]
    assert np.allclose(np.bincount(np.array(bodies, dtype=int)) / 3000, 1 / 3, atol=0.03)


@pytest.mark.parametrize("scenario", sorted(SCENARIOS))
def test_scenes_fit(scenario: str) -> None:
    spaces = PushSpaces(scenario)
    counts, some = set(), range(3 if scenario == "streak" else 25)
    for seed in some:
        case = SCENARIOS[scenario].scene(seed)
        counts.add(len(case.disks))
        for goal in case.goals[:3]:
            assert spaces.state_of(case.disks, goal) in spaces.state
    assert max(counts) == spaces.most
    assert (len(counts) > 1) == (scenario in ("clutter", "blocked"))


def test_a_place_is_wanted_of_the_target() -> None:
    spaces = PushSpaces("clutter")
    case = SCENARIOS["clutter"].scene(1)
    state = spaces.state_of(case.disks, case.goal)
    assert np.array_equal(state["bodies"][: len(case.disks)], case.disks)
    assert not state["bodies"][len(case.disks) :].any()
    assert state["goal"][1].tolist() == [1.0, *case.goal.places[0], 0.0, 0.0]
    assert not np.delete(state["goal"], 1, axis=0).any()


@pytest.mark.parametrize("scenario", ["anywhere", "rearrange_2"])
def test_a_push_is_an_action(scenario: str) -> None:
    spaces, push = PushSpaces(scenario), make_push(1.0, 0.2, 0.1, speed=0.05)
    assert push in spaces.action
    assert spaces.push_of(push).tolist() == push.tolist()
