"""``ros2 run sain_bringup push``: one push by hand, and what became of it."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Final

import numpy as np
from rich.console import Console
from rich.markup import escape

from sain_bringup.waiting import WaitOptions
from sain_core.cli.terminal import FittingTable
from sain_core.config import option
from sain_core.errors import ErrorCode
from sain_core.push import DEFAULT_SPEED, make_push, push_ids
from sain_core.scene import POSITION, THETA
from sain_core.shapes.solids import DISK
from sain_core.types import PushArray
from sain_core.wire import decode_disks

if TYPE_CHECKING:
    from rclpy.node import Node

    from sain_interfaces.msg import Bodies, PushResult, Scene

DISK_NAMES: Final = ("mid disk", "target")
MATCHING: Final = 2.0  # [s] after which a subscriber that is not matched never will be


@dataclass(frozen=True)
class PushOptions(WaitOptions):
    """Send one push to the simulator and print what became of it.

    Exits with 0 when the push was carried out, and with the error code of the refusal when not.
    """

    location: float = option(
        0.0,
        "where the tool touches: of a disk the heading from there to its centre, 0: along +x; of"
        " another body 2 pi times the share of its outline",
        unit="rad",
    )
    angle: float = option(
        0.0, "direction of travel relative to straight inward, -pi/4 to pi/4", unit="rad"
    )
    length: float = option(0.1, "travel of the tool, 0 to 0.15", unit="m")
    speed: float = option(DEFAULT_SPEED, "of the tool, 0.01 to 0.5", unit="m/s")
    body: int = option(0, "body to push, as counted in the scene", minimum=0, maximum=2**32 - 1)


class PushSender:
    """Sends one push from the scene that it sees."""

    def __init__(self, node: "Node", timeout_s: float, console: Console) -> None:
        """Listen to the simulator; print what is waited for, and what is wrong in the graph."""
        from sain_bringup.ros.listener import SCENES, GraphWait
        from sain_core.ros.qos import LATCHED, RELIABLE
        from sain_interfaces.msg import Bodies, Push, PushResult, Scene

        self.node = node
        self._wait = GraphWait(node, console, timeout_s, (SCENES,))
        self._push_id = next(push_ids())
        self._scene: "Scene | None" = None
        self._result: "PushResult | None" = None
        self._executor_at = inf  # when the one that executes pushes was discovered [s]
        self.shapes: tuple[str, ...] = ()  # of the bodies, where the simulator states them
        self._publisher = self.node.create_publisher(Push, "push", RELIABLE)
        node.create_subscription(Scene, "scene", self._on_scene, RELIABLE)
        on_result = PushResult, "push_result", self._on_result
        self._results = node.create_subscription(*on_result, RELIABLE)
        node.create_subscription(Bodies, "shapes", self._on_bodies, LATCHED)

    def send(self, push: PushArray) -> "PushResult":
        """Send a push from the next settled scene and return its result.

        Raises:
            SilentError: no simulator, or no answer in time.
        """
        from sain_core.ros.codec import encode_push

        pushes, scenes = map(self.node.resolve_topic_name, ("push", "scene"))
        self._wait(self._is_connected, f"a node that executes pushes on {pushes}")
        self._wait(lambda: self._scene is not None, f"a settled scene on {scenes}")
        assert self._scene is not None
        message = encode_push(
            push,
            stamp=self._scene.header.stamp,
            push_id=self._push_id,
            episode_id=self._scene.episode_id,
            scene_id=self._scene.scene_id,
            source=self.node.get_fully_qualified_name(),
        )
        self._publisher.publish(message)
        self._wait(lambda: self._result is not None, f"the result of the push on {pushes}")
        return self._result

    def _is_connected(self) -> bool:
        """Return whether a push reaches the node that executes it: a recorder takes pushes, too."""
        from sain_core.guarding.ros.ownership import full_name

        pushes, results = map(self.node.resolve_topic_name, ("push", "push_result"))
        takers = self.node.get_subscriptions_info_by_topic(pushes)
        answering = self.node.get_publishers_info_by_topic(results)
        if not {*map(full_name, takers)} & {*map(full_name, answering)}:
            self._executor_at = inf
            return False
        now = time.monotonic()
        self._executor_at = min(self._executor_at, now)
        matched = self._publisher.get_subscription_count(), self._results.get_publisher_count()
        if matched[0] >= len(takers) and matched[1] >= len(answering):
            return True
        return min(matched) > 0 and now - self._executor_at > MATCHING

    def _on_scene(self, message: "Scene") -> None:
        self._scene = message if message.settled else None

    def _on_bodies(self, message: "Bodies") -> None:
        self.shapes = tuple(body.name for body in message.bodies)

    def _on_result(self, message: "PushResult") -> None:
        if message.push_id == self._push_id:
            self._result = message


def show(result: "PushResult", console: Console, shapes: Sequence[str] = ()) -> None:
    """Print what became of a push; bodies are named by their shapes where these are not disks."""
    push = f"push {result.push_id} of episode {result.episode_id}"
    if result.error_code != ErrorCode.OK:
        name = ErrorCode(result.error_code).name
        console.print(f"[red]{push} was refused[/]: {name}, {escape(result.error_message)}")
        return
    console.print(f"[green]{push} was carried out[/] in {result.duration:.2f} s of simulated time")
    shaped = any(shape != DISK for shape in shapes[:1])
    columns = "body" if shaped else "disk", "x [m]", "y [m]", "theta [rad]", "moved [mm]"
    table = FittingTable(columns)
    before, after = decode_disks(result.before.disks), decode_disks(result.after.disks)
    moved = 1e3 * np.linalg.norm(after[:, POSITION] - before[:, POSITION], axis=1)
    for disk, row in enumerate(after):
        name = DISK_NAMES[disk] if disk < len(DISK_NAMES) else f"disk {disk}"
        name = f"{disk} {shapes[disk]}" if shaped and disk < len(shapes) else name
        place = [f"{value:.4f}" for value in (*row[POSITION], row[THETA])]
        table.add_row(name, *place, f"{moved[disk]:.1f}")
    console.print(table, soft_wrap=True)


def run(options: PushOptions, console: Console) -> int:
    """Send the push, print what became of it, and return the exit code."""
    from sain_core.ros.node_main import command_node

    path = options.location, options.angle, options.length
    push = make_push(*path, body=options.body, speed=options.speed)
    with command_node("push") as node:
        sender = PushSender(node, options.timeout, console)
        result = sender.send(push)
    show(result, console, sender.shapes)
    return 0 if result.error_code == ErrorCode.OK else int(result.error_code) or 1
