"""Nodes of this process on one headless executor, in a domain of their own."""

import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from visualization_msgs.msg import MarkerArray

from sain_core.errors import ErrorCode
from sain_core.push import PUSH_SIZE, make_push
from sain_core.ros import codec
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_core.scene import TARGET
from sain_interfaces.msg import (
    Bodies,
    Goal,
    GoalPose,
    Plan,
    Push,
    PushResult,
    WorldParameters,
)
from sain_interfaces.msg import Scene as SceneMessage
from sain_interfaces.srv import ResetScene

N = TypeVar("N", bound=Node)
DEADLINE = 60.0  # [s], for what takes far less unless something is broken
STEP = 0.02  # [s] that the executor waits for work

HEARD = {
    "scene": SceneMessage,
    "push_result": PushResult,
    "plan": Plan,
    "push": Push,
    "plan_markers": MarkerArray,
    "world_parameters": WorldParameters,
    "shapes": Bodies,
}


class Graph:
    """Nodes, an executor, and a bystander who hears everything and may speak."""

    def __init__(self, domain: int) -> None:
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.nodes: list[Node] = []
        self.heard: dict[str, list[Any]] = defaultdict(list)
        self.bystander = self.add(Node("bystander", namespace="sain", context=self.context))
        for topic, kind in HEARD.items():
            self.listen(topic, kind)
        self.pushing = self.bystander.create_publisher(Push, "push", RELIABLE)
        self.aiming = self.bystander.create_publisher(Goal, "goal", LATCHED)

    def listen(self, topic: str, kind: Any) -> None:
        self.bystander.create_subscription(kind, topic, self.heard[topic].append, 1000)

    def add(self, node: N) -> N:
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def start(self, kind: Callable[..., N], **parameters: Any) -> N:
        """Start a node with these parameters; a dot in a name is written as two underscores."""
        overrides = [Parameter(k.replace("__", "."), value=v) for k, v in parameters.items()]
        return self.add(kind(context=self.context, parameter_overrides=overrides))

    def wait(self, done: Callable[[], Any], what: str) -> None:
        """Let everything run until something is so."""
        end = time.monotonic() + DEADLINE
        while not done():
            assert time.monotonic() < end, f"waited {DEADLINE} s for {what}; heard {self.summary()}"
            self.spin()

    def spin(self, seconds: float = 0.0) -> None:
        """Let everything run for a time [s]; 0: one callback.

        The step is always the same: where it changes, rclpy's executor forgets who else was ready
        and begins with the first node again, so that on a slow machine the last node has no turn.
        """
        end = time.monotonic() + seconds
        self.executor.spin_once(timeout_sec=STEP)
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=STEP)

    def call(self, kind: Any, name: str, request: Any) -> Any:
        client = self.bystander.create_client(kind, name)
        self.wait(client.service_is_ready, f"service {name}")
        future = client.call_async(request)
        self.wait(future.done, f"answer of {name}")
        self.bystander.destroy_client(client)
        return future.result()

    def reset(self, **request: Any) -> SceneMessage:
        """Start an episode and return its first scene."""
        response = self.call(ResetScene, "reset_scene", ResetScene.Request(**request))
        assert response.error_code == ErrorCode.OK, response.error_message
        return response.scene

    def push(self, scene: SceneMessage, push_id: int, push: Any, **ids: int) -> None:
        """Send a push from a scene: five numbers, or location, angle and length against body 0."""
        self.wait(lambda: self.pushing.get_subscription_count() > 0, "who takes a push")
        names = {"episode_id": scene.episode_id, "scene_id": scene.scene_id} | ids
        stamp = self.bystander.get_clock().now().to_msg()
        array = np.asarray(push) if len(push) == PUSH_SIZE else make_push(*push)
        self.pushing.publish(
            codec.encode_push(array, stamp=stamp, push_id=push_id, source="test", **names)
        )

    def result(self, push_id: int) -> PushResult:
        """Wait for what became of a push."""
        self.wait(lambda: self.find("push_result", push_id=push_id), f"result of push {push_id}")
        return self.find("push_result", push_id=push_id)[0]

    def aim(self, goal: Any, goal_id: int, tolerance: float = 0.01, **more: int) -> None:
        x, y = map(float, goal)
        stamp = self.bystander.get_clock().now().to_msg()
        pose = GoalPose(body=TARGET, x=x, y=y, tolerance=tolerance)
        message = Goal(header=codec.header(stamp), goal_id=goal_id, poses=[pose], **more)
        self.aiming.publish(message)

    def aim_at(self, goal: Any, goal_id: int, **more: int) -> None:
        """Give a goal of poses."""
        stamp = self.bystander.get_clock().now().to_msg()
        self.aiming.publish(codec.encode_goal(goal, stamp=stamp, goal_id=goal_id, **more))

    def find(self, topic: str, **fields: Any) -> list[Any]:
        """Return what was heard on a topic and has these values."""
        return [
            message
            for message in self.heard[topic]
            if all(getattr(message, name) == value for name, value in fields.items())
        ]

    def summary(self) -> dict[str, int]:
        return {topic: len(messages) for topic, messages in self.heard.items()}

    def stop(self, node: Node) -> None:
        self.executor.remove_node(node)
        self.nodes.remove(node)
        node.destroy_node()

    def close(self) -> None:
        for node in reversed(list(self.nodes)):
            self.stop(node)
        self.executor.shutdown()
        self.context.try_shutdown()
