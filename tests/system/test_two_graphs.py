"""Two graphs in two namespaces, started as the page of the architecture says."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from sain_core.errors import ErrorCode
from sain_core.goal import Goal
from sain_core.ros import codec
from sain_core.ros.node_main import ros_context
from sain_core.ros.qos import LATCHED, QUEUE
from sain_interfaces.msg import Goal as GoalMessage
from sain_interfaces.msg import PushResult

pytestmark = pytest.mark.system

NODES = {"sim_node": "sain_sim", "model_node": "sain_model", "mppi_node": "sain_mppi"}
PARAMETERS = {
    "sim_node": [],
    "model_node": ["-p", "model:=planar", "-p", "use_sim_time:=true"],
    "mppi_node": ["-p", "use_sim_time:=true", "-p", "planner.samples:=64"],
}
REMAPPED = ["-r", "__ns:=/{graph}", "-r", "/clock:=clock"]


@contextmanager
def started(name: str, graph: str) -> Iterator[subprocess.Popen[bytes]]:
    code = f"import sys; from {NODES[name]}.commands import {name}; sys.exit({name}())"
    remapped = [word.format(graph=graph) for word in REMAPPED]
    arguments = ["--ros-args", *remapped, *PARAMETERS[name]]
    process = subprocess.Popen([sys.executable, "-c", code, *arguments], stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


class Bystander(Node):
    def __init__(self) -> None:
        super().__init__("bystander")
        self.results: dict[str, list[PushResult]] = {"a": [], "b": []}
        self.levels: dict[str, bytes] = {}
        self.goals = {}
        for graph, results in self.results.items():
            self.create_subscription(PushResult, f"/{graph}/push_result", results.append, QUEUE)
            self.goals[graph] = self.create_publisher(GoalMessage, f"/{graph}/goal", LATCHED)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 100)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.levels.update((status.name, status.level) for status in message.status)

    def aim(self, graph: str) -> None:
        stamp = self.get_clock().now().to_msg()
        goal = codec.encode_goal(Goal.place(0.7, 0.05), stamp=stamp, goal_id=1)
        self.goals[graph].publish(goal)


def test_two_graphs_do_not_hear_each_other_and_each_has_its_clock(ros_domain):
    with ExitStack() as stack:
        stack.enter_context(ros_context())
        processes = [
            stack.enter_context(started(name, graph)) for graph in ("a", "b") for name in NODES
        ]
        bystander, executor = Bystander(), SingleThreadedExecutor()
        executor.add_node(bystander)

        def wait(done):
            for _ in range(600):
                if done():
                    return
                executor.spin_once(timeout_sec=0.1)
            raise AssertionError(f"waited for too long; {bystander.levels}")

        wait(lambda: len(bystander.levels) == 6)
        bystander.aim("a")
        wait(lambda: bystander.results["a"])
        assert not bystander.results["b"]
        bystander.aim("b")
        wait(lambda: bystander.results["b"])
        codes = {one.error_code for found in bystander.results.values() for one in found}
        assert codes == {ErrorCode.OK}
        assert set(bystander.levels.values()) <= {DiagnosticStatus.OK, DiagnosticStatus.WARN}
        counts = [bystander.count_publishers(name) for name in ("/clock", "/a/clock", "/b/clock")]
        assert counts == [0, 1, 1]
        assert all(process.poll() is None for process in processes)
        executor.shutdown()
        bystander.destroy_node()
