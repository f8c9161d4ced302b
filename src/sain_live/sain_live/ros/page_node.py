"""The node of the live page."""

from pathlib import Path
from typing import Any

from rclpy.node import Node

from sain_core.ros.node_main import NAMESPACE, steady_timer
from sain_core.ros.parameters import read_parameters
from sain_live.page.live_page import LivePage
from sain_live.player import RecordingPlayer
from sain_live.requests import Reset
from sain_live.ros.reading import read_recording
from sain_live.ros.steering import Steering
from sain_live.ros.subscriptions import GraphSubscriptions
from sain_live.settings import NO_BAG, NO_SCENARIO, PageConfig, check_free, is_loopback
from sain_live.state import LiveState

LOOK: float = 0.1  # [s] between looks for a simulator, at the start


class PageNode(Node):
    """Serves the page, of the graph or of a recording.

    It knows and steers the graph by topics, services and actions alone.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("page_node", namespace=NAMESPACE, **options)
        self.config = config = read_parameters(self, PageConfig)
        check_free(config.host, config.port)
        self.state = LiveState(world="")
        self._parts: list[Any] = []  # to be closed
        if config.bag == NO_BAG:
            self._show_graph()
        else:
            self._show_recording()
        if not is_loopback(config.host):
            self.get_logger().warning(
                "whoever reaches this computer may open the page and steer the arm; there is no"
                " password"
            )
        self.ready = f"the page is at {config.address}"

    def _show_graph(self) -> None:
        self.steering = Steering(self, self.state)
        subscriptions = GraphSubscriptions(self, self.state)
        self.page = LivePage(self.state, self.steering.send, self.config)
        self._parts += [self.page]
        self._reset_to = self.config.scenario
        steady_timer(self, LOOK, self._begin)
        steady_timer(self, LOOK, lambda: subscriptions.watch_camera(self.page.viewers > 0))

    def _show_recording(self) -> None:
        self.get_logger().info(f"reading {self.config.bag}")
        recording = read_recording(Path(self.config.bag))
        self.player = RecordingPlayer(self.state, recording, self.config.speed, self.config.loop)
        self.page = LivePage(self.state, None, self.config, self.player)
        self._parts += [self.player, self.page]

    def _begin(self) -> None:
        """Reset the scene to the scenario that was asked for, once there is a simulator."""
        if self._reset_to != NO_SCENARIO and self.steering.has_simulator:
            self.steering.send(Reset.draw(self._reset_to, self.config.seed))
            self._reset_to = NO_SCENARIO

    def destroy_node(self) -> None:
        """Serve the page no more."""
        for part in self._parts:
            part.close()
        super().destroy_node()
