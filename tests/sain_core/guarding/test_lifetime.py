"""Sockets, as the system lists them: what other computers can send to."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest

from sain_core.guarding import lifetime
from sain_core.guarding.lifetime import PROFILES, RANGE
from sain_sim.commands import sim_node

pytestmark = pytest.mark.ros

SPEAK = """
import sys, time
import rclpy
from std_msgs.msg import String
from sain_core.ros.node_main import ros_context
with ros_context():
    publisher = rclpy.create_node("speaker").create_publisher(String, "words", 10)
    while True:
        publisher.publish(String(data="heard"))
        time.sleep(0.05)
"""


LISTEN = """
import rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node("listener")
node.create_subscription(String, "words", lambda message: print(message.data, flush=True), 10)
rclpy.spin(node)
"""


@contextmanager
def running(code: str, discovery: str = "") -> Iterator[subprocess.Popen[str]]:
    """A process of its own, without what these tests set for the others."""
    variables = {k: v for k, v in os.environ.items() if k not in (RANGE, *PROFILES)}
    variables |= {RANGE: discovery} if discovery else {}
    command = [sys.executable, "-c", code]
    process = subprocess.Popen(command, env=variables, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def addresses(pid: int) -> set[str]:
    """The local addresses of a process's UDP sockets, once it has two."""
    end = time.monotonic() + 30.0
    while time.monotonic() < end:
        found = [one.laddr.ip for one in psutil.Process(pid).net_connections("udp") if one.laddr]
        if len(found) >= 2:
            time.sleep(0.5)  # for sockets that come later
            found = psutil.Process(pid).net_connections("udp")
            return {one.laddr.ip for one in found if one.laddr}
        time.sleep(0.05)
    raise AssertionError(f"process {pid} has fewer than 2 sockets")


@pytest.mark.parametrize("discovery", ["", "SUBNET"])
def test_all_sockets_of_a_node_are_on_this_computer(ros_domain, discovery):
    """But where the usual variable opens the network."""
    with running(SPEAK, discovery) as process:
        found = addresses(process.pid)
        shared = "/dev/shm/fastrtps" in Path(f"/proc/{process.pid}/maps").read_text()
    assert found == {"127.0.0.1"} if not discovery else "0.0.0.0" in found
    assert discovery or not shared  # a killed node leaves nothing there that deafens the next one


@pytest.mark.parametrize("discovery", ["", "LOCALHOST", "SUBNET"])
def test_the_usual_tools_of_ros_hear_our_nodes(ros_domain, discovery):
    """These have shared memory and all network cards, as nobody told them otherwise."""
    with running(SPEAK), running(LISTEN, discovery) as listener:
        assert listener.stdout.readline() == "heard\n"


def test_a_node_says_so_and_does_not_start(monkeypatch, capsys):
    monkeypatch.setattr(lifetime, "LEAST", 2**63)
    assert sim_node([]) == 1
    assert capsys.readouterr().err.startswith("sim_node: /dev/shm is full")


def test_without_a_network_a_command_says_at_once_what_to_do():
    isolated = ["unshare", "--user", "--map-root-user", "--net"]
    if subprocess.run([*isolated, "true"], capture_output=True).returncode:
        pytest.skip("this computer lets nobody make a network of his own")
    code = "from sain_bringup.commands import closed_loop; raise SystemExit(closed_loop([]))"
    command, closed = [*isolated, sys.executable, "-c", code], {**os.environ, RANGE: "LOCALHOST"}
    ended = subprocess.run(command, capture_output=True, text=True, env=closed)
    assert ended.returncode == 1 and ended.stdout == ""
    assert ended.stderr == (
        "closed_loop: nodes talk over 127.0.0.1, which cannot be used here: Network is unreachable;"
        " run `sudo ip link set lo up`, or start the container with a network\n"
    )


STUCK = "ctypes.PyDLL(None).sleep(60)"  # holds the interpreter: no thread of Python runs meanwhile
RECORD = f"""
import ctypes, sys
from sain_bags.commands import record
from sain_bags.ros.recorder import Recorder
Recorder.destroy_node = lambda self: {STUCK}
sys.argv = ["record", "--out", "bag"]
sys.exit(record())
"""


@pytest.mark.parametrize("code", [0, 1, 130])
def test_what_hangs_ends_with_the_exit_code_of_what_was_done(code):
    text = "import ctypes\nfrom sain_core.guarding.lifetime import ending_within\n"
    text += f"with ending_within(0.3, {code}):\n    {STUCK}\n"
    done = subprocess.run([sys.executable, "-c", text], timeout=30)  # it would sleep for 60
    assert done.returncode == code


def test_a_recording_is_whole_although_the_middleware_hangs(tmp_path, ros_domain):
    with subprocess.Popen([sys.executable, "-c", RECORD], cwd=tmp_path) as recorder:
        deadline = time.monotonic() + 30.0
        while not list(tmp_path.glob("bag/*.mcap")) and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(1.0)
        os.kill(recorder.pid, signal.SIGINT)
        start = time.monotonic()
        assert recorder.wait(timeout=20) == 0
    assert 3.0 < time.monotonic() - start < 10.0  # it did hang
    assert (tmp_path / "bag/metadata.yaml").exists()


STUCK_AT_EXIT = f"import ctypes, atexit\natexit.register(lambda: {STUCK})\n"


def test_a_command_ends_although_the_interpreter_cannot(tmp_path, ros_domain):
    code = "import sys\nfrom sain_bringup.commands import reset\n"
    code += "sys.argv = ['reset', '--timeout', '0.1']\nsys.exit(reset())\n"
    done = subprocess.run([sys.executable, "-c", STUCK_AT_EXIT + code], cwd=tmp_path, timeout=30)
    assert done.returncode == 1
