"""The node of the live page."""

from pathlib import Path
from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from sensor_msgs.msg import Image

from sain_bringup.ros.listener import LatestMessage
from sain_core.guarding.ros.reception import LARGE_BYTES, MOST_BYTES, Reception
from sain_core.ros.node_main import NAMESPACE, steady_timer
from sain_core.ros.parameters import read_parameters
from sain_core.ros.qos import LATCHED, LATCHED_QUEUE, QUEUE, RELIABLE
from sain_live.page.live_page import LivePage
from sain_live.player import RecordingPlayer
from sain_live.requests import Reset
from sain_live.ros.reading import read_recording
from sain_live.ros.steering import Steering
from sain_live.ros.updates import StateUpdater
from sain_live.settings import NO_BAG, NO_SCENARIO, PageConfig, check_free, is_loopback
from sain_live.state import LiveState

LOOK: Final = 0.1  # [s] between looks for a simulator, at the start
PICTURE: Final = "camera/overlay"
LATEST: Final = QoSProfile(depth=1)
PERIOD: Final = 1.0 / 40.0  # [s] between looks for new scenes and joints
POLLED: Final = ("scene", "joint_states", "/joint_states")
DESCRIPTIONS: Final = ("robot_description", "/robot_description")
DESCRIPTION_BYTES: Final = 4_000_000  # of a URDF: more than other texts may have
QOS: Final[dict[str, tuple[QoSProfile, ...]]] = {
    "goal": (LATCHED_QUEUE, RELIABLE),  # as the planner: the same one twice is no harm
    "push_result": (QUEUE,),
    "/tf_static": (LATCHED_QUEUE,),
    **dict.fromkeys(("shapes", "learning", "world_parameters", "ghost", *DESCRIPTIONS), (LATCHED,)),
}


class GraphSubscriptions:
    """Hands all messages of a running graph that the page shows to `StateUpdater`.

    Of some topics only the latest message matters. These are taken at a pace: a simulator without
    one sends hundreds of scenes a second, and the executor would wake up for each.
    """

    def __init__(self, node: Node, state: LiveState) -> None:
        self._node, self._reception = node, Reception(node)
        self._picture: Subscription | None = None
        self._updater = StateUpdater(state, lambda: bool(node.count_publishers("shapes")))
        self._latest = []
        for topic, (kind, take) in self._updater.handlers.items():
            if topic in POLLED:
                guarded = self._reception.guarded(topic, take, most=LARGE_BYTES)
                self._latest.append((LatestMessage(node, kind, topic), guarded))
                continue
            most = DESCRIPTION_BYTES if topic in DESCRIPTIONS else MOST_BYTES
            for qos in QOS.get(topic, (RELIABLE,)):
                self._reception.listen(kind, topic, take, qos, most=most)
        steady_timer(node, PERIOD, self._poll)

    def _poll(self) -> None:
        for latest, take in self._latest:
            if (message := latest.take()) is not None:
                take(message)

    def watch_camera(self, viewed: bool) -> None:
        """Take pictures while the page is viewed: else no node has to draw them."""
        if viewed and self._picture is None:
            take = self._updater.on_picture
            self._picture = self._reception.listen(Image, PICTURE, take, LATEST, most=LARGE_BYTES)
        elif not viewed and self._picture is not None:
            self._node.destroy_subscription(self._picture)
            self._picture = None


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
            config = self.config
            reset = Reset.draw(self._reset_to, config.seed, outlines=config.outlines_file)
            self.steering.send(reset)
            self._reset_to = NO_SCENARIO

    def destroy_node(self) -> None:
        """Serve the page no more."""
        for part in self._parts:
            part.close()
        super().destroy_node()
