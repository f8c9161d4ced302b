"""Whether a listener hears that follows one which was killed.

Each try starts a listener, kills it at a random moment of its first second, starts another one and
waits until that one hears a publisher. The machine is kept busy meanwhile.
"""

import random
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from typing import Final

import tyro

from benchmarks.faults.running import own_domain
from sain_core.guarding.lifetime import stay_on_this_host

TALK: Final = """
import time
from rclpy.node import Node
from std_msgs.msg import Header
from sain_core.ros.node_main import ros_context
with ros_context():
    node = Node("talker")
    publisher = node.create_publisher(Header, "said", 10)
    while True:
        publisher.publish(Header())
        time.sleep(0.02)
"""
LISTEN: Final = """
import sys
import rclpy
from rclpy.node import Node
from std_msgs.msg import Header
from sain_core.ros.node_main import ros_context
with ros_context():
    node, heard = Node("listener"), []
    node.create_subscription(Header, "said", heard.append, 10)
    print("up", flush=True)
    while not heard:
        rclpy.spin_once(node, timeout_sec=0.05)
    print("heard", flush=True)
    rclpy.spin(node)
"""
BUSY: Final = "while True: pass"


@dataclass(frozen=True)
class Options:
    """How often."""

    tries: int = 300
    busy: int = 2
    """processes that keep the machine busy"""
    patience: float = 10.0
    """time until a listener counts as deaf [s]"""
    seed: int = 0


def started(code: str) -> "subprocess.Popen[str]":
    """Start a process that runs this."""
    command = [sys.executable, "-c", code]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)


def main() -> int:
    """Try, and print how many were deaf."""
    options = tyro.cli(Options, description=__doc__)
    chance, deaf, longest = random.Random(options.seed), 0, 0.0
    with own_domain():
        stay_on_this_host()
        others = [started(TALK), *(started(BUSY) for _ in range(options.busy))]
        try:
            for number in range(1, options.tries + 1):
                first = started(LISTEN)
                assert first.stdout is not None
                first.stdout.readline()
                time.sleep(chance.uniform(0.0, 1.0))
                first.send_signal(signal.SIGKILL)
                first.wait()
                seconds = heard_after(options.patience)
                deaf += seconds is None
                longest = max(longest, seconds or 0.0)
                if number % 25 == 0:
                    print(f"{number} tries, {deaf} deaf, longest {longest:.2f} s", flush=True)
        finally:
            for process in others:
                process.kill()
    return min(deaf, 1)


def heard_after(patience: float) -> float | None:
    """Start a listener; return when it heard [s] after it was up; None: not in time."""
    listener = started(LISTEN)
    assert listener.stdout is not None
    listener.stdout.readline()
    begun = time.monotonic()
    # A thread waits for the line: `select` would not see what is in Python's own buffer.
    waiting = threading.Thread(target=listener.stdout.readline, daemon=True)
    waiting.start()
    waiting.join(patience)
    seconds = None if waiting.is_alive() else time.monotonic() - begun
    listener.kill()
    listener.wait()
    return seconds


if __name__ == "__main__":
    sys.exit(main())
