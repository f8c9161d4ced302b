"""Types that are not installed where the recorder runs are recorded as senders define them."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader

from sain_bags.reading.reader import Bag
from sain_bags.ros.type_support_stub import type_support_stub
from sain_bringup.graph import executable
from sain_core.errors import InvalidInputError
from sain_interfaces.msg import DiskState, Scene

pytestmark = pytest.mark.ros
HASH = "RIHS01_" + "ab" * 32


def without_interfaces(domain: int) -> dict[str, str]:
    """An environment in which the messages of the graph are not installed."""
    paths = ("PYTHONPATH", "AMENT_PREFIX_PATH", "LD_LIBRARY_PATH")
    stripped = {
        name: os.pathsep.join(
            path
            for path in os.environ.get(name, "").split(os.pathsep)
            if "sain_interfaces" not in path
        )
        for name in paths
    }
    return {**os.environ, **stripped, "ROS_DOMAIN_ID": str(domain)}


@pytest.fixture
def recorded(graph: Any, ros_domain: int, tmp_path: Path) -> Path:
    """A bag of scenes by a recorder that has never seen one."""
    environment = without_interfaces(ros_domain)
    probe = "import sain_interfaces"
    assert subprocess.run([sys.executable, "-c", probe], env=environment, check=False).returncode
    speaking = graph.bystander.create_publisher(Scene, "/unseen", 1000)
    command = [str(executable("sain_bags", "record")), "--out", str(tmp_path / "bag")]
    process = subprocess.Popen(
        [*command, "--topics", "/unseen"], env=environment, stdout=subprocess.PIPE, text=True
    )
    try:
        graph.wait(lambda: speaking.get_subscription_count() > 0, "the recorder")
        for number in range(1, 301):
            speaking.publish(Scene(scene_id=number, disks=[DiskState(x=0.25)]))
            graph.executor.spin_once(timeout_sec=0.01)
        end = threading.Timer(1.0, lambda: process.send_signal(signal.SIGTERM))
        end.start()
        while process.poll() is None:
            graph.executor.spin_once(timeout_sec=0.01)
        assert "Recorded 300 messages on 1 topics in" in process.communicate()[0]
    finally:
        process.kill()
    return tmp_path / "bag"


def test_they_are_recorded_and_decoded_as_any_other(recorded: Path) -> None:
    messages = [received.message for received in Bag(recorded).messages(["/unseen"])]
    assert [message.scene_id for message in messages] == [*range(1, 301)]
    assert messages[0].disks[0].x == 0.25
    with AnyReader([recorded]) as reader:  # compares the definition with the publisher's hash
        (connection,) = reader.connections
        scenes = [reader.deserialize(raw, connection.msgtype) for _, _, raw in reader.messages()]
    assert [scene.scene_id for scene in scenes] == [*range(1, 301)]


def test_what_cannot_be_stood_in_for_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidInputError, match="its hash is 'RIHS01_ab'"):
        type_support_stub("a/msg/Thing", "RIHS01_ab")
    monkeypatch.setattr(
        "sain_bags.ros.type_support_stub.get_rmw_implementation_identifier", lambda: "rmw_other"
    )
    with pytest.raises(InvalidInputError, match="not installed; rmw_other cannot do without"):
        type_support_stub("a/msg/Thing", HASH)
