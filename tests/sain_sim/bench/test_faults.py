"""The text that names faults, and what the controller makes of it."""

import numpy as np
import pytest

from sain_arm.planning.push_events import Ended
from sain_arm.planning.timing import Trajectory
from sain_arm.robot.robot import read_robot
from sain_core.errors import ConfigError
from sain_sim.bench.controller import STOP_TIME, Controller, ControllerConfig
from sain_sim.bench.faults import FROZEN, Faults, parse_faults

STEP = 1.0 / 240.0


@pytest.mark.parametrize(
    ("text", "faults"),
    [
        ("none", Faults()),
        ("delay=0.5, abort=1", Faults(delay=0.5, abort=1.0)),
        ("reject,twice,every=2", Faults(reject=True, twice=True, every=2)),
    ],
)
def test_faults_are_named_with_their_values(text, faults):
    assert parse_faults(text) == faults


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "dellay=1",
            r"faults has 'dellay' \(did you mean 'delay'\?\); allowed: none",
        ),
        ("delay", r"faults has 'delay'; it must be as in delay=0.5"),
        ("abort=soon", r"faults has 'abort=soon'; it must be as in abort=0.5"),
        ("every=1.5", r"faults has 'every=1.5'; it must be as in every=4"),
        ("twice=yes", r"faults has 'twice=yes'; it must be as in twice"),
        ("delay=9", r"delay is 9.0 s; it must be at most 2"),
        ("abort=nan", r"abort is nan; it must be finite"),
    ],
)
def test_a_fault_that_cannot_be_is_named(text, message):
    with pytest.raises(ConfigError, match=message):
        parse_faults(text)


def follow(faults: str, goals: int = 2) -> list[tuple[Ended | None, float]]:
    """Follow goals of one second with exact servos; return how each ended, and after what time."""
    robot = read_robot("ur5")
    controller = Controller(robot, robot.home, ControllerConfig(), parse_faults(faults))
    goal = Trajectory(np.array([0.0, 1.0]), np.stack([robot.home, robot.home]), np.zeros((2, 6)))
    time, found = 0.0, []
    for _ in range(goals):
        begun, ending = time, None
        if controller.rejects():
            found.append((Ended.REJECTED, 0.0))
            continue
        controller.start(goal, time)
        while ending is None:
            time += STEP
            joints, _ = controller.target(time)
            ending = controller.ending(joints, time)
        found.append((ending.how, time - begun))
    return found


def test_every_nth_goal_is_aborted_or_rejected_and_all_are_late():
    good, late = 1.02, pytest.approx(1.52, abs=2 * STEP)
    assert follow("none") == [(Ended.SUCCEEDED, pytest.approx(good, abs=2 * STEP))] * 2
    assert follow("delay=0.5") == [(Ended.SUCCEEDED, late)] * 2
    ends = [how for how, _ in follow("abort=0.3,every=2", 4)]
    assert ends == [Ended.SUCCEEDED, Ended.ABORTED] * 2
    assert [how for how, _ in follow("reject,every=3", 3)][-1] is Ended.REJECTED


def test_joint_states_freeze_and_the_camera_is_dark_for_a_time():
    robot = read_robot("ur5")
    faults = parse_faults("freeze=0.5,dark=2,every=1")
    controller = Controller(robot, robot.home, ControllerConfig(latency=0.0), faults)
    goal = Trajectory(np.array([0.0, 1.0]), np.stack([robot.home] * 2), np.zeros((2, 6)))
    assert not controller.is_frozen(0.0) and not controller.is_dark(0.0)
    controller.rejects()
    controller.start(goal, 0.0)
    assert [controller.is_frozen(t) for t in (0.4, 0.6, 0.4 + FROZEN, 0.6 + FROZEN)] == [
        False, True, True, False,
    ]  # fmt: skip
    assert controller.is_dark(1.9) and not controller.is_dark(2.1)


def test_a_stopped_goal_comes_to_rest_where_it_was_about_to_be():
    robot = read_robot("ur5")
    controller = Controller(robot, robot.home, ControllerConfig(latency=0.0), Faults())
    speed = np.full(6, 0.2)
    goal = Trajectory(
        np.array([0.0, 1.0]), np.stack([robot.home, robot.home + speed]), np.stack([speed] * 2)
    )
    controller.start(goal, 0.0)
    position, _ = controller.target(0.5)
    controller.stop(0.5)
    rest, velocity = controller.target(0.5 + STOP_TIME)
    assert not controller.busy and np.abs(velocity).max() == 0.0
    np.testing.assert_allclose(rest, position + speed * STOP_TIME / 2, atol=1e-9)
