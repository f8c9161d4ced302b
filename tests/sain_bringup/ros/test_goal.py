"""Goals that are asked for; and what a person reads where no planner is there, or able to plan."""

from io import StringIO

import pytest
from rich.console import Console

from sain_bringup import commands
from sain_bringup.graph import GraphOptions
from sain_bringup.ros.goal import GoalOptions, GoalSender, goal_message
from sain_bringup.ros.listener import SilentError
from sain_bringup.running import check_free
from sain_core.errors import BusyError
from sain_core.guarding.ros.ownership import lock_namespace
from sain_core.ros.node_main import command_node
from sain_interfaces.msg import Goal

pytestmark = pytest.mark.ros


@pytest.fixture
def sender(ros_domain):
    with command_node("goal") as node:
        yield GoalSender(node, 4.0, Console(file=StringIO(), width=80))


def printed(sender):
    return sender._console.file.getvalue().splitlines()


def test_without_a_planner_it_says_what_it_waits_for_and_then_what_to_do(sender, monkeypatch):
    monkeypatch.setattr("sain_bringup.ros.listener.ABSENT", 2.0)
    said = r"no planner in namespace /sain.*ROS_DOMAIN_ID.* \(waited 4 s\)"
    with pytest.raises(SilentError, match=said):
        sender.send(Goal())
    first, *then = printed(sender)
    assert first == "waiting for a planner on /sain/reach, at most 4 s"
    assert sum("no planner in namespace /sain" in line for line in then) == 1


def test_a_goal_is_a_pose_with_or_without_a_heading():
    (pose,) = goal_message(GoalOptions(place=(0.6, 0.1), heading=1.0)).poses
    assert (pose.body, pose.heading, pose.has_heading) == (1, 1.0, True)
    (pose,) = goal_message(GoalOptions(place=(0.6, 0.1), body=0)).poses
    assert (pose.body, pose.has_heading, pose.x) == (0, False, 0.6)


def test_a_second_graph_is_refused_before_anything_starts(graph):
    release = lock_namespace(graph.bystander)
    try:
        with pytest.raises(BusyError, match=r"executes pushes in namespace /sain of domain \d+"):
            check_free(GraphOptions())
        check_free(GraphOptions(driver="elsewhere"))  # arm_node has it
    finally:
        release()
    check_free(GraphOptions())


@pytest.mark.parametrize("words", [["0.6"], ["0.6", "x"], ["0.6", "0.1", "0.2"]])
def test_a_place_has_two_numbers(words, capsys):
    assert commands.goal(words) == 2
    assert "it must be 2 values, each a number" in capsys.readouterr().err
