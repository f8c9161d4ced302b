"""A graph with a simulated arm and a camera, to which goals are given one after another.

All processes are those that the owner of a robot runs. The arm's table keeps the wall clock. A
goal's clock runs from its message to the first scene at rest within tolerance, as it is seen.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from math import inf
from pathlib import Path
from typing import Any, Final

import numpy as np
import psutil
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseArray
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from benchmarks.faults.running import own_domain
from sain_bringup.bench import SERVER
from sain_bringup.graph import (
    MODEL,
    PLANNER,
    SCENES,
    TAGS,
    GraphOptions,
    graph_commands,
    ros_arguments,
)
from sain_bringup.movie import TRUTH
from sain_bringup.processes import UNHURRIED, Supervisor
from sain_bringup.running import start_commands
from sain_core import wire
from sain_core.errors import ErrorCode, SainError
from sain_core.goal import Goal
from sain_core.ros.codec import encode_goal
from sain_core.ros.node_main import NAMESPACE, node_of, ros_context
from sain_core.ros.qos import LATCHED, QUEUE, RELIABLE
from sain_core.shapes.body_file import BodyFile, Poses, read_bodies
from sain_interfaces.msg import Goal as GoalMessage
from sain_interfaces.msg import Plan, PushResult
from sain_interfaces.msg import Scene as SceneMessage

START: Final = 120.0  # [s] for a graph to come up
LONGEST: Final = 120.0  # [s] for a goal, then it has failed
MOVES: Final = 0.01  # [rad/s], of a joint
SPIN: Final = 0.02  # [s]
VIEW: Final = 31.0  # [degrees], of the camera, vertical: tags of letters are 18 mm wide
ENDED: Final = (Plan.REACHED, Plan.NO_PUSH, Plan.EXHAUSTED)


@dataclass(frozen=True)
class Played:
    """What came of one goal.

    Attributes:
        seconds: from the goal to the first scene within tolerance; NaN: it was not reached.
        pushes: executed for it.
        refused: pushes that were refused.
        off_mm: largest distance of a body from its goal, as simulated, at that moment.
        off_degrees: likewise of a heading.
        at_rest: share of the time in which no joint moved: seeing, planning, waiting.
        busy: share of the machine's cores that the graph took, the simulated table among it.
        failure: why it was not reached; empty: it was.
    """

    seconds: float
    pushes: int
    refused: int
    off_mm: float
    off_degrees: float
    at_rest: float
    busy: float
    failure: str

    def row(self) -> dict[str, Any]:
        """Return it for a file; a time that is not there is null."""
        return asdict(self) | {"seconds": None if np.isnan(self.seconds) else self.seconds}


class Client(Node):
    """Gives goals and follows what happens."""

    def __init__(self) -> None:
        """Join the graph."""
        super().__init__("goals", namespace=NAMESPACE)
        self.scene: SceneMessage | None = None  # the latest one at rest
        self.truth: Poses | None = None  # as simulated
        self.plans: list[Plan] = []
        self.results: list[PushResult] = []
        self.report, self.planner_ready = "", False
        self.resting, self._last = 0.0, (0.0, False)
        self.goal = self.create_publisher(GoalMessage, "goal", LATCHED)
        for topic, kind, hear, quality in (
            ("scene", SceneMessage, self._on_scene, RELIABLE),
            ("plan", Plan, self._on_news, QUEUE),
            ("push_result", PushResult, self._on_news, QUEUE),
            (TRUTH, PoseArray, self._on_poses, RELIABLE),
            ("bench", String, self._on_report, RELIABLE),
            ("/joint_states", JointState, self._on_joints, RELIABLE),
            ("/diagnostics", DiagnosticArray, self._on_diagnostics, RELIABLE),
        ):
            self.create_subscription(kind, topic, hear, quality)

    def starts(self) -> float:
        """Forget what was before a goal; return its time [s]."""
        self.plans.clear()
        self.results.clear()
        self.resting, self._last = 0.0, (time.monotonic(), False)
        return self._last[0]

    def _on_news(self, message: Plan | PushResult) -> None:
        (self.plans if isinstance(message, Plan) else self.results).append(message)

    def _on_scene(self, message: SceneMessage) -> None:
        self.scene = message if message.settled else None

    def _on_poses(self, message: PoseArray) -> None:
        self.truth = np.array(
            [
                (p.position.x, p.position.y, 2.0 * np.arctan2(p.orientation.z, p.orientation.w))
                for p in message.poses
            ]
        )

    def _on_report(self, message: String) -> None:
        self.report = message.data

    def _on_joints(self, message: JointState) -> None:
        now, (before, rested) = time.monotonic(), self._last
        self.resting += (now - before) * rested
        self._last = now, bool(np.abs(message.velocity).max() < MOVES)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if node_of(status) == self.resolve_topic_name("mppi_node"):
                self.planner_ready = status.level == DiagnosticStatus.OK


@dataclass(eq=False)
class Trial:
    """A graph that runs, and the goals that it was given."""

    supervisor: Supervisor
    client: Client
    executor: Executor
    bodies: BodyFile
    goals: int = 0
    report: str = ""  # of the table, at the end: what was broken

    def wait(self, done: Callable[[], Any], longest: float) -> bool:
        """Spin until something is so, and look after the processes; return whether it is, in time.

        Raises:
            ProcessDiedError: a process ended that is not started anew.
        """
        end = time.monotonic() + longest
        while not (so := done()) and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=SPIN)
            self.supervisor.check()
        return bool(so)

    def reach(self, goal: Goal) -> Played:
        """Give a goal, and wait until it is reached or has failed."""
        client = self.client
        self.goals += 1
        stamp = client.get_clock().now().to_msg()
        message = encode_goal(goal, stamp=stamp, goal_id=self.goals, episode_id=0, max_pushes=0)
        began = client.starts()
        worked = processor_time()
        client.goal.publish(message)
        reached_at = inf

        def over() -> bool:
            nonlocal reached_at
            if reached_at == inf and self.is_reached(goal):
                reached_at = time.monotonic()
            return any(one.goal_id == self.goals and one.status in ENDED for one in client.plans)

        ended = self.wait(over, LONGEST)
        took = time.monotonic() - began
        assert client.truth is not None
        true = self.bodies.scene(client.truth)
        judged = goal.judge(true, true, self.bodies.bodies)
        failure = "" if reached_at < inf else (self._said() if ended else f"{LONGEST:g} s are over")
        executed = [one for one in client.results if one.error_code == ErrorCode.OK]
        return Played(
            seconds=reached_at - began if not failure else np.nan,
            pushes=len(executed),
            refused=len(client.results) - len(executed),
            off_mm=1e3 * judged.distance,
            off_degrees=float(np.degrees(judged.turn)),
            at_rest=client.resting / took,
            busy=(processor_time() - worked) / (took * psutil.cpu_count()),
            failure=failure,
        )

    def _said(self) -> str:
        last = self.client.plans[-1]
        return last.error_message or "no push is left"

    def is_reached(self, goal: Goal) -> bool:
        """Return whether the bodies are seen at rest within the tolerances of a goal."""
        if self.client.scene is None:
            return False
        seen = wire.decode_disks(self.client.scene.disks)
        return goal.judge(seen, seen, self.bodies.bodies).met


def processor_time() -> float:
    """Return the processor time [s] of this process and of all that it started, so far."""
    me, spent = psutil.Process(), 0.0
    for process in (me, *me.children(recursive=True)):
        with suppress(psutil.NoSuchProcess):  # it has just ended
            times = process.cpu_times()
            spent += times.user + times.system
    return spent


@contextmanager
def trial(options: GraphOptions, folder: Path) -> Iterator[Trial]:
    """Run a graph in a domain of its own until it is left; its logs are in a folder.

    Raises:
        SainError: it does not come up.
        ProcessDiedError: a process ended that is not started anew.
    """
    assert options.bench is not None
    options.bench.check()
    with ExitStack() as stack:
        stack.enter_context(own_domain())
        stack.enter_context(ros_context())
        supervisor = stack.enter_context(Supervisor(folder, UNHURRIED))
        client, executor = Client(), EventsExecutor()
        stack.callback(client.destroy_node)
        executor.add_node(client)
        stack.callback(executor.shutdown, 5.0)
        commands = graph_commands(options, ros_arguments(()), folder)
        # Not on `poses`: scene_node listens there, and the graph sees by its camera alone.
        commands[SERVER] += ["-p", "poses:=true", "-r", f"poses:={TRUTH}"]
        if options.see == TAGS:
            commands[SERVER] += ["-p", f"images.field_of_view:={VIEW}"]
        start_commands(supervisor, commands)
        run = Trial(supervisor, client, executor, read_bodies(options.bench.bodies_file))
        nodes = (MODEL, PLANNER, SCENES)

        def up() -> bool:
            ready = client.planner_ready and client.scene is not None
            return ready and not supervisor.starting(nodes)

        if not run.wait(up, START):
            seen = "seen" if client.scene is not None else "not seen"
            raise SainError(
                f"the graph is not up after {START:g} s; bodies are {seen}; logs: {folder}"
            )
        yield run
        run.report = client.report
        supervisor.close_files(UNHURRIED.interrupt)
        supervisor.stop()
