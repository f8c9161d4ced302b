"""Goals as ROS users send them, each seen in the push that follows."""

from types import SimpleNamespace

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from rclpy.action import ActionClient
from rclpy.qos import QoSProfile

from sain_core.errors import ErrorCode
from sain_core.scene import POSITION
from sain_core.shapes.bodies import Bodies
from sain_interfaces.action import Reach
from sain_interfaces.msg import Goal, GoalPose, Plan
from tests.sain_mppi.ros.straw import GOAL, START, nth_push, plan

POSE = GoalPose(body=1, x=GOAL[0], y=GOAL[1])
THERE = START.copy()
THERE[1, POSITION] = GOAL


@pytest.fixture
def client(graph):
    made = ActionClient(graph.bystander, Reach, "reach")
    yield made
    made.destroy()


def send(graph, client, feedback=None, **fields):
    """Send a goal by the action; return its handle once it is accepted."""
    graph.wait(client.server_is_ready, "the action")
    request = Reach.Goal(goal=Goal(poses=[POSE], **fields))
    sent = client.send_goal_async(request, feedback_callback=feedback)
    graph.wait(sent.done, "an answer of the action")
    assert sent.result().accepted
    return sent.result()


def result_of(graph, handle):
    """Wait for the result of an action."""
    future = handle.get_result_async()
    graph.wait(future.done, "the result")
    return future.result()


def test_a_publisher_with_the_defaults_of_ros_is_heard(graph, straw, planner):
    """`ros2 topic pub --once` keeps nothing for who comes late, and gives no id."""
    publisher = graph.bystander.create_publisher(Goal, "goal", QoSProfile(depth=10))
    graph.wait(lambda: publisher.get_subscription_count() == 1, "who listens to it")
    publisher.publish(Goal(poses=[POSE]))
    straw.show()
    nth_push(graph, 1)
    assert plan(graph, status=Plan.PUSH).goal_distance == pytest.approx(np.hypot(0.159, 0.05))


def turned(x, y, *turn, frame="world"):
    """A pose as RViz sends it; the quaternion is x, y, z, w."""
    x_, y_, z, w = turn
    pose = Pose(position=Point(x=x, y=y), orientation=Quaternion(x=x_, y=y_, z=z, w=w))
    message = PoseStamped(pose=pose)
    message.header.frame_id = frame
    return message


@pytest.fixture
def poses(graph, planner):
    publisher = graph.bystander.create_publisher(PoseStamped, "goal_pose", 10)
    graph.wait(publisher.get_subscription_count, "who listens to poses")
    return publisher


@pytest.mark.parametrize("shape", ["disk", "box_3x2"])
def test_a_pose_from_rviz_moves_the_target_and_turns_it_where_that_is_seen(
    graph, straw, planner, poses, shape
):
    disks = START if shape == "disk" else START[:1].copy()
    planner.agent._bodies[1] = Bodies.named([shape] * len(disks))
    straw.show(disks=disks)
    target, (x, y) = disks[-1, POSITION], GOAL
    heading = 0.0, 0.0, np.sin(0.2), np.cos(0.2)
    poses.publish(turned(x, y, *heading, frame="map"))  # another frame is ignored
    poses.publish(turned(x, y, *heading))
    made = plan(graph, status=Plan.PUSH)
    assert made.goal_distance == pytest.approx(np.hypot(*(GOAL - target)))
    assert made.goal_turn == pytest.approx(0.0 if shape == "disk" else 0.4)


@pytest.mark.parametrize(
    ("turn", "text"),
    [
        ((0.0, 0.0, 0.0, 0.0), "quaternion of length 0; it must be 1"),
        ((0.5, 0.0, 0.0, 0.866), "is tilted by 60 degrees; its z axis must point up"),
    ],
)
def test_a_pose_that_no_body_on_the_table_has_is_refused(
    graph, straw, planner, poses, monkeypatch, turn, text
):
    said = []
    logger = SimpleNamespace(error=said.append, warning=said.append)
    monkeypatch.setattr(planner, "get_logger", lambda: logger)
    straw.show()
    poses.publish(turned(*GOAL, *turn))
    graph.wait(lambda: said, "the refusal")
    (line,) = said
    assert line.startswith("a message on goal_pose is ignored: the goal pose ") and text in line
    assert planner.agent._tracker.task is None


def test_the_action_tells_how_it_goes_and_how_it_ended(graph, straw, planner, client):
    told = []
    straw.show()
    handle = send(graph, client, feedback=told.append, tolerance=0.01, max_pushes=5)
    push = nth_push(graph, 1)
    graph.wait(lambda: told, "feedback")
    feedback = told[0].feedback
    assert feedback.pushes == 1
    assert feedback.goal_distance == pytest.approx(np.hypot(0.159, 0.05))
    predicted = np.array([(disk.x, disk.y) for disk in feedback.predicted])
    assert predicted.shape == (2, 2)
    assert np.abs(predicted - START[:, POSITION]).max() > 0.01
    assert plan(graph, push_id=push.push_id).goal_id != 0
    straw.answer(push, ErrorCode.OK, before=START, after=THERE)
    straw.show(scene_id=2, disks=THERE)
    answer = result_of(graph, handle)
    assert answer.status == GoalStatus.STATUS_SUCCEEDED
    assert (answer.result.status, answer.result.pushes) == (Plan.REACHED, 1)
    assert answer.result.goal_distance == pytest.approx(0.0)


def test_a_cancelled_action_sends_no_more_pushes(graph, straw, planner, client):
    straw.show()
    handle = send(graph, client)
    push = nth_push(graph, 1)
    cancelled = handle.cancel_goal_async()
    graph.wait(cancelled.done, "the cancellation")
    answer = result_of(graph, handle)
    assert answer.status == GoalStatus.STATUS_CANCELED
    assert answer.result.error_code == ErrorCode.CANCELLED
    straw.answer(push, ErrorCode.OK, before=START, after=START)
    straw.show(scene_id=2)
    graph.spin(1.0)
    assert len(graph.heard["push"]) == 1


def test_a_newer_goal_ends_the_action(graph, straw, planner, client):
    straw.show()
    handle = send(graph, client)
    nth_push(graph, 1)
    graph.aim((0.45, 0.2), 7)
    answer = result_of(graph, handle)
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert answer.result.error_message == "goal 7 was given"
