"""What ``ros2 run sain_bringup goal`` asks for."""

import pytest

from sain_bringup.options import GoalOptions

pytest.importorskip("rclpy")


def test_a_place_is_that_of_the_target() -> None:
    from sain_bringup.ros.goal import goal_message

    goal = goal_message(GoalOptions(x=0.6, y=-0.1))
    assert (goal.x, goal.y, goal.tolerance, goal.max_pushes) == (0.6, -0.1, 0.02, 30)
    assert not goal.poses


def test_a_heading_or_a_body_makes_it_a_pose() -> None:
    from sain_bringup.ros.goal import goal_message

    (pose,) = goal_message(GoalOptions(x=0.6, y=0.1, heading=1.0)).poses
    assert (pose.body, pose.heading, pose.has_heading) == (1, 1.0, True)
    (pose,) = goal_message(GoalOptions(x=0.6, y=0.1, body=0)).poses
    assert (pose.body, pose.has_heading, pose.x) == (0, False, 0.6)
