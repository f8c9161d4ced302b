"""The planner's node against a simulator of straw: the test itself answers its pushes."""

import numpy as np

from sain_core.ros import codec
from sain_core.ros.qos import RELIABLE
from sain_core.scene import make_scene
from sain_interfaces.msg import PushResult
from sain_interfaces.msg import Scene as SceneMessage

SMALL = {"planner__samples": 64, "planner__rounds": 2, "planner__horizon": 2}
GOAL = (0.70, 0.05)
START = make_scene(
    np.array([(0.40, 0.0), (0.541, 0.0)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)


class Straw:
    """Says what a simulator says, as the test wants it."""

    def __init__(self, graph):
        self.graph = graph
        self.scenes = graph.bystander.create_publisher(SceneMessage, "scene", RELIABLE)
        self.results = graph.bystander.create_publisher(PushResult, "push_result", RELIABLE)

    def show(self, scene_id=1, episode_id=1, disks=START, settled=True):
        self.graph.wait(self.scenes.get_subscription_count, "who looks at the scene")
        stamp = self.graph.bystander.get_clock().now().to_msg()
        message = codec.encode_scene(
            disks, stamp=stamp, episode_id=episode_id, scene_id=scene_id, settled=settled
        )
        self.scenes.publish(message)

    def answer(self, push, code, message="", before=None, after=None):
        result = PushResult(
            push_id=push.push_id,
            episode_id=push.episode_id,
            error_code=int(code),
            error_message=message,
            push=push,
        )
        if before is not None:
            result.before.disks = codec.encode_disks(before)
            result.after.disks = codec.encode_disks(after)
        self.results.publish(result)


def plan(graph, **fields):
    graph.wait(lambda: graph.find("plan", **fields), f"a plan with {fields}")
    return graph.find("plan", **fields)[0]


def nth_push(graph, number):
    graph.wait(lambda: len(graph.heard["push"]) >= number, f"push {number}")
    return graph.heard["push"][number - 1]
