"""Goals that are asked for; and what a person reads where no planner is there, or able to plan."""

from io import StringIO

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rich.console import Console

from sain_bringup.ros import goal as module
from sain_bringup.ros.goal import GoalOptions, GoalSender, SilentPlannerError, goal_message
from sain_core.ros.node_main import command_node, spin_until
from sain_interfaces.msg import Goal

pytestmark = pytest.mark.ros


@pytest.fixture
def sender(ros_domain):
    with command_node("goal") as node:
        yield GoalSender(node, Console(file=StringIO(), width=80))


def printed(sender):
    return sender._console.file.getvalue().splitlines()


def test_without_a_planner_it_says_what_it_waits_for_and_then_what_to_do(sender):
    with pytest.raises(
        SilentPlannerError, match=r"no planner on /sain/reach \(waited 2 s\); start"
    ):
        sender.send(Goal(), 2.0)
    assert printed(sender) == ["waiting for a planner on /sain/reach, at most 2 s"]


def test_while_kernels_are_compiled_nobody_gives_up(sender, monkeypatch):
    looks = iter([f"compiling {count} of 7 kernels" for count in range(8)])
    monkeypatch.setattr(module, "describe_compilation", lambda: next(looks, ""))
    with pytest.raises(SilentPlannerError):
        sender.send(Goal(), 0.3)
    assert next(looks, "") == ""  # far more than 0.3 s
    assert printed(sender)[0] == "waiting for a planner on /sain/reach: compiling 3 of 7 kernels"


def test_it_says_what_the_planner_waits_for(sender, graph):
    publisher = graph.bystander.create_publisher(DiagnosticArray, "/diagnostics", 10)
    graph.wait(lambda: publisher.get_subscription_count() == 1, "who hears diagnostics")

    def heard(message):
        status = DiagnosticStatus(name="/sain/mppi_node: planning", message=message)
        publisher.publish(DiagnosticArray(status=[status]))
        return spin_until(sender.node, lambda: len(printed(sender)) == 1, 0.5)

    sender._line._patience_s = 0.0
    with sender._line:
        assert not heard("goal reached")
        assert heard("waits for the model: compiling 31 of 40 kernels")
    assert printed(sender) == ["the planner waits for the model: compiling 31 of 40 kernels"]


def test_a_place_is_that_of_the_target() -> None:
    goal = goal_message(GoalOptions(x=0.6, y=-0.1))
    assert (goal.x, goal.y, goal.tolerance, goal.max_pushes) == (0.6, -0.1, 0.02, 30)
    assert not goal.poses


def test_a_heading_or_a_body_makes_it_a_pose() -> None:
    (pose,) = goal_message(GoalOptions(x=0.6, y=0.1, heading=1.0)).poses
    assert (pose.body, pose.heading, pose.has_heading) == (1, 1.0, True)
    (pose,) = goal_message(GoalOptions(x=0.6, y=0.1, body=0)).poses
    assert (pose.body, pose.has_heading, pose.x) == (0, False, 0.6)
