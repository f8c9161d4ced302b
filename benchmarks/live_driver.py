"""Plays episodes without a page, for the benchmark of the page."""

import time
from collections.abc import Callable
from typing import Any

from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from sain_core.errors import ErrorCode
from sain_core.ros.codec import encode_disks, encode_goal
from sain_core.ros.node_main import NAMESPACE
from sain_core.ros.qos import QUEUE, RELIABLE
from sain_interfaces.action import Reach
from sain_interfaces.msg import Plan, Push, PushResult, Scene
from sain_interfaces.srv import ResetScene
from sain_live.orders import Reset

SCENARIO = "push_t"
PATIENCE = 120.0  # [s]


class Driver(Node):
    """Plays episodes without a page, and hears pushes, results and scenes."""

    def __init__(self) -> None:
        """Join the graph."""
        super().__init__("driver", namespace=NAMESPACE)
        self.pushes: list[float] = []
        self.results: list[float] = []
        self.scenes: list[float] = []
        self.searches: dict[int, float] = {}  # times [s] of the search, by push
        self.scene: Scene | None = None
        self.ids: list[int] = []  # of the pushes
        self.create_subscription(Push, "push", self._on_push, QUEUE)
        self.create_subscription(Plan, "plan", self._on_plan, QUEUE)
        self.create_subscription(PushResult, "push_result", self._on_result, QUEUE)
        self.create_subscription(Scene, "scene", self._on_scene, RELIABLE)
        self._reset = self.create_client(ResetScene, "reset_scene")
        self._reach = ActionClient(self, Reach, "reach")
        self.ready: Callable[[], None] = lambda: None  # waits until all of the graph is
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)

    def wait(self, done: Any, what: str) -> None:
        """Let time pass until something is so."""
        end = time.monotonic() + PATIENCE
        while not done():
            self._executor.spin_once(timeout_sec=0.01)
            assert time.monotonic() < end, f"waited {PATIENCE} s for {what}"

    def play(self, seed: int) -> float:
        """Play an episode; return the wall time [s] from its goal to its end."""
        case = Reset(SCENARIO, seed).case()
        self.wait(lambda: self._reset.service_is_ready() and self._reach.server_is_ready(), "graph")
        request = ResetScene.Request(seed=seed, disks=encode_disks(case.disks))
        request.shapes, request.roles = list(case.shapes), list(map(str, case.roles))
        request.friction = case.friction
        asked = self._reset.call_async(request)
        self.wait(asked.done, "reset")
        assert asked.result().error_code == ErrorCode.OK, asked.result().error_message
        begun = time.monotonic()
        goal = encode_goal(
            case.goal, stamp=self.get_clock().now().to_msg(), goal_id=0, max_pushes=30
        )
        sent = self._reach.send_goal_async(Reach.Goal(goal=goal))
        self.wait(sent.done, "planner")
        ended = sent.result().get_result_async()
        self.wait(ended.done, "end")
        return time.monotonic() - begun

    def _on_push(self, message: Push) -> None:
        self.pushes.append(time.monotonic())
        self.ids.append(message.push_id)

    def _on_plan(self, message: Plan) -> None:
        self.searches[message.push_id] = message.search_time

    def _on_result(self, _: PushResult) -> None:
        self.results.append(time.monotonic())

    def _on_scene(self, message: Scene) -> None:
        self.scenes.append(time.monotonic())
        self.scene = message
