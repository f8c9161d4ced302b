"""How often an arm begins to move after somebody said `false`, while somebody else says `true`.

    ./env python -m benchmarks.faults.enable_signal --tries 50

Driver, laboratory and converter have one executor; both publishers and the pushes another one. A
goal is wrong that was sent later than `SLACK` after the first `false`. Motion is wrong later than
`BRAKES` after the driver received it, which a busy machine delays: that time is printed.
"""

import random
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from threading import Thread
from typing import Any, Final

import numpy as np
import tyro
from nav_msgs.msg import OccupancyGrid
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.timer import Timer
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from benchmarks.faults.running import own_domain
from sain_arm.robot.robot import SHIPPED
from sain_arm.ros.arm_node import ArmNode
from sain_arm.ros.trajectory_server import TrajectoryServer
from sain_core.errors import ErrorCode
from sain_core.push import make_push
from sain_core.ros import codec
from sain_core.ros.node_main import NAMESPACE, ros_context
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_interfaces.msg import Push, PushResult, Scene
from sain_vision.ros.scene_node import SceneNode

PERIODS: Final = (0.05, 0.1, 0.3, 1.0)  # [s] between two that are false
BRAKES: Final = 0.5  # [s]
MOVES: Final = 0.05  # [rad/s], of a joint
SLACK: Final = 0.02  # [s], from a message's way to its subscriber
LONGEST: Final = 300.0  # [s]
PATIENT: Final[dict[str, Any]] = {  # the machine may be busy; false counts at once in any case
    "enable_timeout": 1.0,
    "joints_timeout": 2.0,
    "scene_timeout": 5.0,
    "patience": 15.0,
}


@dataclass(frozen=True)
class Options:
    """Let two publishers of the enable signal disagree, again and again."""

    tries: int = 50
    seed: int = 0


class Owner(Node):
    """Publishes true all the time, pushes, and takes note of what the arm does."""

    def __init__(self) -> None:
        """Listen, and say true."""
        super().__init__("owner", namespace=NAMESPACE)
        self.scene: Scene | None = None
        self.results: dict[int, PushResult] = {}
        self.moved_at, self.reaches = -np.inf, False
        self.create_subscription(Scene, "scene", self._on_scene, RELIABLE)
        self.create_subscription(PushResult, "push_result", self._on_result, RELIABLE)
        self.create_subscription(JointState, "/joint_states", self._on_joints, RELIABLE)
        self.create_subscription(OccupancyGrid, "reach_table", self._on_reach, LATCHED)
        self.pushes = self.create_publisher(Push, "push", RELIABLE)
        self.says_true = self.create_publisher(Bool, "enable", RELIABLE)
        self.create_timer(0.1, lambda: self.says_true.publish(Bool(data=True)))

    def _on_scene(self, message: Scene) -> None:
        self.scene = message if message.settled else None

    def _on_result(self, message: PushResult) -> None:
        self.results[message.push_id] = message

    def _on_joints(self, message: JointState) -> None:
        if np.abs(message.velocity).max() > MOVES:
            self.moved_at = time.time()

    def _on_reach(self, message: OccupancyGrid) -> None:
        self.reaches = True

    def push(self, push_id: int, location: float) -> None:
        """Push the T from its present place."""
        assert self.scene is not None
        stamp = self.get_clock().now().to_msg()
        ids = {"episode_id": self.scene.episode_id, "scene_id": self.scene.scene_id}
        push = make_push(location, 0.0, 0.03)
        self.pushes.publish(
            codec.encode_push(push, stamp=stamp, push_id=push_id, source="owner", **ids)
        )


class Pendant(Node):
    """Says false while it is pressed."""

    def __init__(self) -> None:
        """Say nothing yet."""
        super().__init__("pendant", namespace=NAMESPACE)
        self.publisher = self.create_publisher(Bool, "enable", RELIABLE)
        self._timer: Timer | None = None
        self.since = float("inf")

    def press(self, period: float) -> None:
        """Say false from now on, each period [s]."""
        self._timer = self.create_timer(period, self._say)
        self.since = time.time()
        self._say()

    def _say(self) -> None:
        self.publisher.publish(Bool(data=False))

    def release(self) -> None:
        """Say nothing any more."""
        if self._timer is not None:
            self.destroy_timer(self._timer)
        self._timer, self.since = None, float("inf")


class Watched(ArmNode):
    """A driver that takes note of when [s] it received false, and when it sent goals."""

    def __init__(self, **options: Any) -> None:
        """Watch its gate and its client."""
        self.received, self.sent = list[float](), list[float]()
        super().__init__(**options)
        send = self.client.send

        def noted(*given: Any) -> None:
            self.sent.append(time.time())
            send(*given)

        self.client.send = noted  # type: ignore[method-assign, assignment]

    def _on_enable(self, message: Bool) -> None:
        if not message.data:
            self.received.append(time.time())
        super()._on_enable(message)


def main() -> None:
    """Do the tries and print what was wrong."""
    options = tyro.cli(Options)
    with ExitStack() as stack:
        stack.enter_context(own_domain())
        stack.enter_context(ros_context())
        robot, nodes = SingleThreadedExecutor(), dict[type, Any]()
        bodies = str(SHIPPED / "bodies" / "t.yaml")
        parts: tuple[tuple[type, dict[str, Any]], ...] = (
            (TrajectoryServer, {"robot": "ur5", "bodies": bodies, "pace": 2.0}),
            (Watched, {"robot": "ur5"} | PATIENT),
            (SceneNode, {"bodies": bodies, "max_speed": 1.5, "max_age": 2.0}),
        )
        for kind, given in parts:
            parameters = [Parameter(name, value=value) for name, value in given.items()]
            nodes[kind] = kind(parameter_overrides=parameters)
            robot.add_node(nodes[kind])
            stack.callback(nodes[kind].destroy_node)
        thread = Thread(target=robot.spin, daemon=True)
        stack.callback(thread.join, 20.0)
        stack.callback(robot.shutdown, 20.0)
        thread.start()
        owner, pendant = Owner(), Pendant()
        executor = SingleThreadedExecutor()
        for other in (owner, pendant):
            executor.add_node(other)
            stack.callback(other.destroy_node)
        listens = pendant.publisher.get_subscription_count
        wait(executor, lambda: owner.reaches and owner.scene is not None and listens())
        outcomes = Counter(
            one_try(executor, nodes[Watched], owner, pendant, number, random.Random(seed))
            for number, seed in enumerate(range(options.seed, options.seed + options.tries))
        )
    for outcome, count in outcomes.most_common():
        print(f"{count:4d}  {outcome}")


def one_try(
    executor: SingleThreadedExecutor,
    arm: Watched,
    owner: Owner,
    pendant: Pendant,
    number: int,
    draw: random.Random,
) -> str:
    """Push, say false at some time, and return what came of it."""
    began = time.monotonic()
    wait(executor, lambda: owner.scene is not None and time.monotonic() > began + 1.0)
    after, period = draw.uniform(-0.5, 2.0), draw.choice(PERIODS)  # [s], from the push on
    if after < 0.0:
        pendant.press(period)
    wait(executor, lambda: time.monotonic() > began + 1.0 - min(after, 0.0))
    owner.push(number + 1, draw.choice((0.0, np.pi, 0.5 * np.pi)))
    due = time.monotonic() + after
    wait(executor, lambda: time.monotonic() > due)
    if after >= 0.0:
        pendant.press(period)
    end = time.monotonic() + 4.0
    wait(executor, lambda: time.monotonic() > end and number + 1 in owner.results)
    since = pendant.since
    late = [at - since for at in arm.sent if at > since + SLACK]
    heard = min((at - since for at in arm.received if at > since), default=np.inf)
    ran = owner.moved_at - since
    code = ErrorCode(owner.results[number + 1].error_code).name
    pendant.release()
    restless = time.monotonic() + 3.5  # a false that may be one of a slow row
    wait(executor, lambda: time.monotonic() > restless)
    print(
        f"{number + 1}: {code}; from the first false on, {period} s apart: received {heard:.3f} s,"
        f" goals sent {late}, last motion {ran:.3f} s",
        flush=True,
    )
    if late:
        return f"WRONG: {len(late)} goals were sent after false ({period} s apart); result {code}"
    if ran > heard + BRAKES:
        return f"WRONG: the arm moved for {ran:.1f} s after false ({period} s apart)"
    return f"nothing was sent after false; result {code}"


def wait(executor: SingleThreadedExecutor, done: Callable[[], Any]) -> None:
    """Spin until something is so."""
    end = time.monotonic() + LONGEST
    while not done():
        if time.monotonic() > end:
            raise TimeoutError(f"not within {LONGEST:g} s")
        executor.spin_once(timeout_sec=0.02)


if __name__ == "__main__":
    main()
