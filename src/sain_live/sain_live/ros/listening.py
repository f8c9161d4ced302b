"""Subscriptions to all that the page shows of a running graph.

Of some topics only the latest message matters. These are taken at a pace, and not as they come: a
simulator without a pace sends hundreds of scenes a second, and the executor would wake up for each.
"""

from collections.abc import Callable
from threading import Event, Lock, Thread
from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from sensor_msgs.msg import Image

from sain_bringup.ros.listener import LatestMessage
from sain_core.guarding.ros.reception import LARGE_BYTES, Reception
from sain_core.ros.qos import LATCHED, LATCHED_QUEUE, QUEUE, RELIABLE
from sain_live.ros.hearing import Hearing
from sain_live.state import LiveState

PICTURE: Final = "camera/overlay"
LATEST: Final = QoSProfile(depth=1)


class Polling:
    """Takes the latest message of some topics, again and again, on a thread of its own.

    An executor that is woken up so often takes several percent of a processor.
    """

    def __init__(self, node: Node, reception: Reception, rate: float) -> None:
        """Look so often [Hz], once started."""
        self._node, self._reception, self._period = node, reception, 1.0 / rate
        self._taken: list[tuple[LatestMessage, Callable[[Any], None]]] = []
        self._end = Event()
        self._thread = Thread(target=self._run, name="polling", daemon=True)

    def listen(self, kind: type, topic: str, callback: Callable[[Any], None]) -> None:
        """Subscribe; a message that fails the callback is logged."""

        def refuse(_: Any, error: BaseException) -> None:
            text = f"a message on {topic} is ignored: {error}"
            self._node.get_logger().error(text, throttle_duration_sec=5.0)

        handle = self._reception.guarded(topic, callback, refuse, LARGE_BYTES)
        self._taken.append((LatestMessage(self._node, kind, topic), handle))

    def start(self) -> None:
        """Look from now on."""
        self._thread.start()

    def close(self) -> None:
        """Look no more."""
        self._end.set()
        if self._thread.is_alive():
            self._thread.join()

    def take(self) -> None:
        """Hand on what has come since the last look."""
        for latest, handle in self._taken:
            if (message := latest.take()) is not None:
                handle(message)

    def _run(self) -> None:
        while not self._end.wait(self._period):
            self.take()


RATE: Final = 60.0  # [Hz], looks for new scenes and joints
POLLED: Final = ("scene", "joint_states", "/joint_states")
UNLIMITED: Final = (
    "robot_description",
    "/robot_description",
)  # longer than texts elsewhere may be: it has its own limit
QOS: Final[dict[str, tuple[QoSProfile, ...]]] = {
    "shapes": (LATCHED,),
    "goal": (LATCHED_QUEUE, RELIABLE),  # as the planner: the same one twice is no harm
    "push_result": (QUEUE,),
    "learning": (LATCHED,),
    "world_parameters": (LATCHED,),
    "robot_description": (LATCHED,),
    "/robot_description": (LATCHED,),
    "ghost": (LATCHED,),
    "/tf_static": (LATCHED_QUEUE,),
}


class Listening:
    """Hands the messages of a graph to `Hearing`."""

    def __init__(self, node: Node, known: LiveState) -> None:
        """Listen from now on."""
        self._lock = Lock()  # scenes come on a thread of their own
        reception = Reception(node)
        self._polling = Polling(node, reception, RATE)
        self._node, self._reception = node, reception
        self._picture: Subscription | None = None
        self._hearing = hearing = Hearing(known, lambda: bool(node.count_publishers("shapes")))
        for topic, (kind, callback) in hearing.handlers.items():
            take = self._locked(callback)
            if topic in POLLED:
                self._polling.listen(kind, topic, take)
                continue
            for qos in QOS.get(topic, (RELIABLE,)):
                if topic in UNLIMITED:
                    node.create_subscription(kind, topic, take, qos)
                else:
                    reception.listen(kind, topic, take, qos)
        self._polling.start()

    def close(self) -> None:
        """Listen no more."""
        self._polling.close()

    def watch_camera(self, viewed: bool) -> None:
        """Take pictures while somebody views the page: nobody else makes the effort then."""
        if viewed and self._picture is None:
            take = self._locked(self._hearing.on_picture)
            self._picture = self._reception.listen(Image, PICTURE, take, LATEST, most=LARGE_BYTES)
        elif not viewed and self._picture is not None:
            self._node.destroy_subscription(self._picture)
            self._picture = None

    def _locked(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            with self._lock:
                callback(message)

        return take
