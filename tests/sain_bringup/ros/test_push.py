"""One push by hand, also while the graph still starts: it is not lost, and says what it awaits."""

from io import StringIO
from threading import Event, Thread
from time import monotonic

import numpy as np
import pytest
from rclpy.node import Node
from rich.console import Console

from sain_bringup.ros.listener import SilentError
from sain_bringup.ros.push import PushSender
from sain_core.errors import ErrorCode
from sain_core.push import make_push
from sain_core.ros import codec
from sain_core.ros.node_main import command_node
from sain_core.ros.qos import RELIABLE
from sain_core.scene import make_scene
from sain_interfaces.msg import Push, PushResult, Scene

pytestmark = pytest.mark.ros
DISKS = make_scene(np.array([(0.4, 0.0), (0.6, 0.0)]), np.array([2.0, 1.0]), np.full(2, 0.08))


@pytest.fixture
def sender(ros_domain):
    with command_node("push") as node:
        yield PushSender(node, 3.0, Console(file=StringIO(), width=200))


def printed(sender):
    return sender._wait.line._console.file.getvalue()


@pytest.fixture
def simulator(graph):
    """Return a function that starts scenes and the execution of pushes after some time [s].

    The graph's bystander takes pushes from the beginning on, as a recorder does.
    """
    ended, threads, results = Event(), [], []

    def execute(push):
        results[0].publish(PushResult(push_id=push.push_id, error_code=int(ErrorCode.OK)))

    def run(scene_s, push_s):
        node = graph.add(Node("sim_node", namespace="sain", context=graph.context))
        scenes, begun = node.create_publisher(Scene, "scene", RELIABLE), monotonic()
        stamp = codec.encode_time(1)
        while not ended.is_set():
            if monotonic() - begun > scene_s:
                scenes.publish(
                    codec.encode_scene(DISKS, stamp=stamp, episode_id=1, scene_id=1, settled=True)
                )
            if monotonic() - begun > push_s and not results:
                results.append(node.create_publisher(PushResult, "push_result", RELIABLE))
                node.create_subscription(Push, "push", execute, RELIABLE)
            graph.spin()

    def start(*times):
        threads.append(Thread(target=run, args=times))
        threads[0].start()

    yield start
    ended.set()
    threads[0].join()


@pytest.mark.parametrize(
    ("scene_s", "push_s", "awaited"),
    [
        (0.0, 1.5, "a node that executes pushes on /sain/push, at most 3 s"),
        (1.5, 0.0, "a settled scene on /sain/scene, at most 3 s"),
    ],
)
def test_a_push_waits_for_who_executes_it_and_for_a_scene(
    sender, graph, simulator, scene_s, push_s, awaited
):
    simulator(scene_s, push_s)
    assert sender.send(make_push(0.0, 0.0, 0.1)).error_code == ErrorCode.OK
    assert f"waiting for {awaited}" in printed(sender)
    assert len(graph.heard["push"]) <= 1


def test_without_a_simulator_it_says_what_is_missing(sender):
    with pytest.raises(SilentError, match=r"no source of scenes in namespace /sain.*3 s"):
        sender.send(make_push(0.0, 0.0, 0.1))
    assert "waiting for a node that executes pushes on /sain/push, at most 3 s" in printed(sender)
