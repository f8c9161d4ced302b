"""A policy in the planner's node that has no pushes: nothing moves, and messages say why."""

import numpy as np
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


def test_a_policy_sees_by_the_camera_what_comes_after_the_scene_at_rest(graph, straw):
    graph.start(MppiNode, policy="tests.policies:of_images", max_refusals=1)
    graph.wait(lambda: graph.aiming.get_subscription_count() == 2, "the planner")
    straw.show()
    graph.aim(GOAL, 1)
    made = plan(graph, goal_id=1)
    assert made.status == Plan.NO_PUSH
    assert made.error_message.endswith(
        "no image of observation.images.camera_color came; there are none"
    )
    camera = graph.bystander.create_publisher(Image, "camera/color/image_raw", RELIABLE)
    graph.wait(camera.get_subscription_count, "who looks at images")
    black = np.zeros((720, 1280, 3), np.uint8)
    camera.publish(codec.encode_image(black, "bgr8", Header()))  # of before: it is not used
    graph.spin(0.2)
    shown = black.copy()
    shown[0, 0] = 255
    for goal, image, status in ((2, shown, Plan.PUSH), (3, shown[:360], Plan.NO_PUSH)):
        message = codec.encode_image(image, "bgr8", Header())
        timer = graph.bystander.create_timer(0.05, lambda it=message: camera.publish(it))
        graph.aim(GOAL, goal)
        assert plan(graph, goal_id=goal).status == status
        graph.bystander.destroy_timer(timer)
    wrong = "camera_color has the shape (360, 1280, 3); the policy takes (720, 1280, 3)"
    assert wrong in plan(graph, goal_id=3).error_message
