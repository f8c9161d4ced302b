"""A policy in the planner's node that has no pushes: nothing moves, and messages say why."""

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from sain_core.errors import ErrorCode
from sain_core.ros import codec
from sain_core.ros.qos import RELIABLE
from sain_interfaces.msg import Plan
from sain_mppi.ros.mppi_node import MppiNode
from tests.sain_mppi.ros.straw import GOAL, plan


def test_a_policy_without_pushes_ends_the_goal_and_the_graph_goes_on(graph, straw):
    graph.listen("/diagnostics", DiagnosticArray)
    graph.start(MppiNode, policy="tests.policies:blank")
    graph.wait(lambda: graph.aiming.get_subscription_count() == 2, "the planner")
    straw.show()
    for goal in (1, 2):
        graph.aim(GOAL, goal)
        made = plan(graph, goal_id=goal)
        assert made.status == Plan.NO_PUSH
        assert ErrorCode(made.error_code) is ErrorCode.NO_PUSH
        assert made.error_message == (
            "10 answers in a row were refused, the last: policy tests.policies:blank:"
            " body of the action is nan; must be finite"
        )
    assert not graph.heard["push"]

    def counted():
        return [
            status
            for message in graph.heard["/diagnostics"]
            for status in message.status
            if "in a row were refused" in status.message
            and any((one.key, one.value) == ("policy_refused", "20") for one in status.values)
        ]

    graph.wait(counted, "the count on /diagnostics")


def shown(level: int, height: int = 720, sec: int = 0, stamp: Time | None = None) -> Image:
    """An image with one pixel that is not black; without a stamp its time is unknown."""
    pixels = np.zeros((height, 1280, 3), np.uint8)
    pixels[0, 0] = level
    return codec.encode_image(pixels, "bgr8", Header(stamp=stamp or Time(sec=sec)))


@pytest.fixture
def observed(graph, straw):
    """A planner with a policy that observes a camera, and a scene at rest."""
    graph.start(MppiNode, policy="tests.policies:of_images", max_refusals=1)
    graph.wait(lambda: graph.aiming.get_subscription_count() == 2, "the planner")
    straw.show()
    return graph


def planned(graph, goal, camera=None, image=None):
    """Return the plan for a goal, while images of a camera come."""
    timers = []
    if camera is not None:
        graph.wait(camera.get_subscription_count, "who looks at images")
        timers.append(graph.bystander.create_timer(0.05, lambda: camera.publish(image)))
    graph.aim(GOAL, goal)
    made = plan(graph, goal_id=goal)
    for timer in timers:
        graph.bystander.destroy_timer(timer)
    return made


def camera(graph, topic="camera/color/image_raw"):
    return graph.bystander.create_publisher(Image, topic, RELIABLE)


def test_a_policy_sees_by_the_camera_what_comes_after_the_scene_at_rest(observed):
    made = planned(observed, 1)
    assert made.status == Plan.NO_PUSH
    assert made.error_message.endswith(
        "no image of observation.images.camera_color came: no topic has this name; there are none"
    )
    raw, now = camera(observed), observed.bystander.get_clock().now().to_msg()
    for goal, image, text in (
        (2, shown(255), ""),
        (3, shown(255, sec=7), "the last one on /sain/camera/color/image_raw is "),
        (4, shown(255, 360), "camera_color has the shape (360, 1280, 3); the policy takes (720,"),
        (5, shown(255, stamp=now), ""),
    ):
        made = planned(observed, goal, raw, image)
        assert (made.status == Plan.PUSH) == (not text)
        assert text in made.error_message


def test_a_topic_without_a_publisher_is_no_camera_and_two_with_one_name_are_refused(observed):
    observed.listen("camera/color/image_other", Image)
    observed.listen("/camera/color/image_raw", Image)
    raw = camera(observed)
    assert planned(observed, 1, raw, shown(255)).status == Plan.PUSH
    second = camera(observed, "/camera/color/image_raw")
    observed.spin(1.0)
    assert "/camera/color/image_raw and /sain/camera/color/image_raw have this name; remap" in (
        planned(observed, 2, raw, shown(255)).error_message
    )
    observed.bystander.destroy_publisher(second)


def test_a_new_goal_does_not_wait_for_an_image_of_the_one_before(graph, straw):
    graph.start(MppiNode, policy="tests.policies:of_images", max_refusals=100)
    graph.wait(lambda: graph.aiming.get_subscription_count() == 2, "the planner")
    straw.show()
    graph.aim(GOAL, 1)
    graph.spin(0.5)
    assert planned(graph, 2, camera(graph), shown(255)).status == Plan.PUSH
