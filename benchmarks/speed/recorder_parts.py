"""Processes beside the recorder: ``python -m benchmarks.speed.recorder_parts PART``, until SIGTERM.

``scene RATE LISTENERS`` publishes numbered scenes on ``/load/scene`` at a rate [1/s], once so many
listen, and prints at the end how many that were. ``bare`` subscribes to the raw bytes of every
topic, as the recorder does, and does nothing with them.
"""

import signal
import sys
import time
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter

from sain_bags.ros.endpoints import message_class, offered_qos, qos_profile
from sain_bags.ros.recorder import ENTITIES
from sain_bags.writing.selection import Selection, adapt
from sain_interfaces.msg import DiskState, Scene

TOPIC = "/load/scene"
DEPTH = 2000  # messages; what a listener that is late for a moment may still ask for


class Bare(Node):
    """A raw subscription on every topic, with an empty callback."""

    def __init__(self) -> None:
        """Look for topics twice a second."""
        overrides = [Parameter(name, value=value) for name, value in ENTITIES.items()]
        super().__init__("bare", start_parameter_services=False, parameter_overrides=overrides)
        self.create_timer(0.5, self.discover)
        self._heard: set[str] = set()

    def discover(self) -> None:
        """Subscribe to what is new."""
        for name, types in self.get_topic_names_and_types():
            publishers = self.get_publishers_info_by_topic(name)
            if name in self._heard or not publishers or not Selection().wants(name):
                continue
            self._heard.add(name)
            profile = qos_profile(adapt([offered_qos(info) for info in publishers]))
            self.create_subscription(message_class(types[0]), name, ignore, profile, raw=True)


def ignore(data: bytes) -> None:
    """Do nothing with a message."""


def publish_scenes(rate: float, listeners: int) -> None:
    """Publish until a signal comes, then print how many."""
    stopped: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, frame: stopped.append(number))
    node = Node("load")
    publisher = node.create_publisher(Scene, TOPIC, DEPTH)
    scene = Scene(disks=[DiskState(x=0.4), DiskState(x=0.5)])
    while publisher.get_subscription_count() < listeners and not stopped:
        time.sleep(0.01)
    begun = time.perf_counter()
    while not stopped:
        scene.scene_id += 1
        publisher.publish(scene)
        time.sleep(max(begun + scene.scene_id / rate - time.perf_counter(), 0.0))
    time.sleep(1.0)  # what was sent is still to be delivered
    print(scene.scene_id, flush=True)
    node.destroy_node()


def main(part: str, *arguments: str) -> None:
    """Be one of the parts."""
    is_bare = part == "bare"
    options = rclpy.signals.SignalHandlerOptions
    handlers: Any = options.ALL if is_bare else options.NO
    rclpy.init(signal_handler_options=handlers)
    try:
        if is_bare:
            rclpy.spin(Bare())
        else:
            publish_scenes(float(arguments[0]), int(arguments[1]))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main(*sys.argv[1:])
