"""What sockets on loopback cost beside shared memory: ``./env python -m benchmarks.transport``.

Two processes for each transport, one after the other: messages that are lost at 1 kHz on four
topics and of 10 MB, and the processor time of both processes for them. The shared memory is that
of ROS's own LOCALHOST.
"""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import domain_coordinator
import tyro

from benchmarks.report import Figure, report
from sain_core.ros.network import PROFILES, RANGE

BEGIN = """
import array, json, sys, time
import rclpy
from std_msgs.msg import UInt64MultiArray
from sain_core.ros.network import stay_on_this_host
topics, rate, count, padding, ours = json.loads(sys.argv[1])
if ours:
    stay_on_this_host()
rclpy.init()
"""
SPEAK = """
node = rclpy.create_node("speaker")
publishers = [node.create_publisher(UInt64MultiArray, f"t{k}", 10) for k in range(topics)]
end = time.monotonic() + 30.0
while any(not one.get_subscription_count() for one in publishers) and time.monotonic() < end:
    time.sleep(0.02)
time.sleep(0.5)
body, begun, used = array.array("Q", [0] * (padding + 1)), time.perf_counter(), time.process_time()
for number in range(count):
    body[0] = number
    for publisher in publishers:
        publisher.publish(UInt64MultiArray(data=body))
    time.sleep(max(0.0, begun + (number + 1) / rate - time.perf_counter()))
print(json.dumps({"used": time.process_time() - used}))
time.sleep(2.0)
"""
LISTEN = """
node = rclpy.create_node("listener")
heard = [0] * topics
def count_one(topic):
    def hear(message):
        heard[topic] += 1
    return hear
for k in range(topics):
    node.create_subscription(UInt64MultiArray, f"t{k}", count_one(k), 10)
end, used = time.monotonic() + 40.0, time.process_time()
while sum(heard) < topics * count and time.monotonic() < end:
    before = sum(heard)
    rclpy.spin_once(node, timeout_sec=5.0)
    if before and sum(heard) == before:
        break
print(json.dumps({"heard": sum(heard), "used": time.process_time() - used}))
"""


@dataclass(frozen=True)
class Options:
    """How much is sent."""

    seconds: float = 5.0
    """at 1 kHz"""
    large: int = 20
    """messages of 10 MB"""
    out: Path | None = None
    """write the figures to this JSON file"""


def sent(case: tuple[int, float, int, int], ours: bool) -> tuple[int, float]:
    """Send messages between two processes; return those lost, and processor time [s]."""
    variables = {k: v for k, v in os.environ.items() if k not in (RANGE, *PROFILES)}
    variables[RANGE] = "LOCALHOST"
    with domain_coordinator.domain_id() as domain:
        variables["ROS_DOMAIN_ID"] = str(domain)
        words = json.dumps([*case, ours])
        processes = [
            subprocess.Popen(
                [sys.executable, "-c", BEGIN + code, words], env=variables, stdout=subprocess.PIPE
            )
            for code in (LISTEN, SPEAK)
        ]
        told: list[dict[str, Any]] = [json.loads(one.communicate()[0]) for one in processes]
    topics, _, count, _ = case
    return topics * count - told[0]["heard"], told[0]["used"] + told[1]["used"]


def main() -> None:
    """Measure and print."""
    options = tyro.cli(Options, description=__doc__)
    cases = {
        "4 topics at 1 kHz": (4, 1000.0, round(1000 * options.seconds), 8),
        "10 MB at 5 Hz": (1, 5.0, options.large, 1_250_000),
    }
    figures = []
    for name, case in cases.items():
        for transport, ours in (("shared memory", False), ("loopback", True)):
            lost, used = sent(case, ours)
            figures.append(Figure(f"{name}, {transport}: lost", lost, "", at_most=0))
            figures.append(Figure("... processor time of both", used, "s"))
    report("Transports", figures, options.out)


if __name__ == "__main__":
    main()
