"""A recording instead of a simulator: planner and model as processes, and `play` in between."""

import subprocess
import time
from collections.abc import Callable
from typing import Any

import domain_coordinator
import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from sain_bags.bag.metadata import TopicQos
from sain_bags.writing.writer import BagWriter
from sain_bringup.graph import executable
from sain_core.ros.qos import RELIABLE
from sain_core.scene import POSITION, TARGET, make_scene
from sain_core.types import Scene
from sain_core.wire import decode_plan, decode_push
from sain_interfaces.msg import Plan, Push
from tests.sain_bags.conftest import SECOND, Messages, Recording

pytestmark = pytest.mark.system

GOAL = np.array([0.62, 0.08])
TARGETS = ((0.50, 0.0), (0.55, 0.04), (0.62, 0.075))  # where it comes to rest; the last is there
STAY = 15  # scenes at rest, 10 a second
PATIENCE = 120.0  # [s]


def scene_at(target: tuple[float, float]) -> Scene:
    """The mid disk behind the target, as seen from the arm."""
    positions = np.array([[target[0] - 0.145, target[1]], target])
    return make_scene(positions, np.array([8.0, 8.0]), np.array([0.08, 0.06]))


@pytest.fixture
def bag(tmp_path):
    """What an older planner did: its pushes and plans are in the bag, too."""
    recording = Recording(BagWriter(tmp_path / "bag"), Messages())
    latched = TopicQos(durability="transient_local", depth=1)
    topic = recording.messages.topic(
        "/sain/goal", "sain_interfaces/msg/Goal", offered_qos=(latched,)
    )
    recording.writer.add_topic(topic)
    poses = recording.messages.poses(*GOAL, tolerance=0.01)
    recording.add("/sain/goal", "Goal", goal_id=1, episode_id=1, poses=poses, max_pushes=15)
    for number, target in enumerate(TARGETS, start=1):
        for _ in range(STAY):
            recording.scene(1, number, scene_at(target))
        if number < len(TARGETS):
            for share in (0.3, 0.7):
                there = np.array(TARGETS[number])
                between = (1 - share) * np.array(target) + share * there
                recording.scene(1, number, scene_at((between[0], between[1])), settled=False)
            recording.push(number, 1, scene_at(target), scene_at(TARGETS[number]))
    recording.now += 2 * SECOND
    recording.add("/sain/done", "std_msgs/msg/Bool")
    recording.writer.close()
    return tmp_path / "bag"


class Audience:
    """Hears what planner and simulator would say."""

    def __init__(self, domain: int) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node("audience", namespace="sain", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.plans: list[Any] = []
        self.pushes: list[Any] = []
        self.states: dict[str, str] = {}  # the last of each node
        self.node.create_subscription(Plan, "plan", self.plans.append, RELIABLE)
        self.node.create_subscription(Push, "push", self.pushes.append, RELIABLE)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self.note, RELIABLE)

    def note(self, message: DiagnosticArray) -> None:
        self.states |= {status.name: status.message for status in message.status}

    def wait(self, done: Callable[[], object], what: str) -> None:
        end = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < end, f"waited {PATIENCE} s for {what}"
            self.executor.spin_once(timeout_sec=0.05)

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def audience(monkeypatch):
    with domain_coordinator.domain_id() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        audience = Audience(int(domain))
        yield audience
        audience.close()


@pytest.fixture
def nodes(audience, tmp_path):
    """The model and the planner, as docs/guides/replay.md starts them."""
    settings = ["--ros-args", "-p", "result_patience:=0.0"]
    commands = {
        "model": [str(executable("sain_model", "model_node"))],
        "planner": [str(executable("sain_mppi", "mppi_node")), *settings],
    }
    logs = {name: tmp_path / f"{name}.log" for name in commands}
    processes = []
    try:
        for name, command in commands.items():
            with logs[name].open("w") as log:
                processes.append(subprocess.Popen(command, stdout=log, stderr=log))
        for name, log in logs.items():
            audience.wait(lambda log=log: "ready: " in log.read_text(), f"the {name}")
        # Nodes that are up need not have found each other yet: without the model, physics plans.
        audience.wait(
            lambda: audience.states.get("/sain/mppi_node: planning") == "ready",
            "the planner to see the model",
        )
        yield
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait(timeout=30)


@pytest.mark.usefixtures("nodes")
def test_planner_and_model_work_from_a_recording(audience, bag):
    topics = ("/sain/scene", "/sain/goal", "/sain/push_result")
    command = [str(executable("sain_bags", "play")), str(bag), "--topics", *topics]
    play = subprocess.Popen([*command, "--rate", "1", "--wait", "30"])
    audience.wait(lambda: play.poll() is not None, "the end of the recording")
    assert play.returncode == 0
    audience.wait(lambda: len(audience.plans) >= len(TARGETS), "a plan for each scene at rest")

    plans = {plan.scene_id: plan for plan in audience.plans}
    assert set(plans) == {1, 2, 3}
    assert [plans[number].status for number in (1, 2, 3)] == [Plan.PUSH, Plan.PUSH, Plan.REACHED]
    pushes = {push.push_id: push for push in audience.pushes}
    for number in (1, 2):
        plan = plans[number]
        assert plan.dynamics == "sain" and not plan.fallback and plan.error_code == 1
        sent = pushes[plan.push_id]
        assert (sent.episode_id, sent.scene_id) == (1, number)
        planned, predicted = decode_plan(plan)
        assert planned[0] == pytest.approx(decode_push(sent))
        before = np.hypot(*(scene_at(TARGETS[number - 1])[TARGET, POSITION] - GOAL))
        assert plan.goal_distance == pytest.approx(float(before))
        assert np.hypot(*(predicted[-1, TARGET, POSITION] - GOAL)) < before
    assert len(pushes) == 2, "the recorded pushes are not played"
