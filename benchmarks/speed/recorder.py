"""What the recorder costs and what it loses.

The closed loop on the whole graph, its recorder and all, and numbered scenes at 1 kHz beside it:
messages that are not in the bag, and the recorder's processor time beside that of a node with the
same raw subscriptions and an empty callback, in the same run. Both of these are processes, as
``recorder bare`` and ``recorder scenes``.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from benchmarks.faults.running import own_domain
from benchmarks.report import Figure, ReportOptions, read_options, report
from sain_bags.reading.reader import Bag
from sain_bags.ros.endpoints import message_class, offered_qos, qos_profile
from sain_bags.ros.recorder import ENTITIES
from sain_bags.writing.gaps import read_gaps
from sain_bags.writing.selection import Selection, adapt
from sain_interfaces.msg import DiskState, Scene

TOPIC = "/load/scene"
DEPTH = 2000  # messages; what a listener that is late for a moment may still ask for
PATIENCE = 120.0  # [s]
TICKS = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Options(ReportOptions):
    """How much to measure."""

    seconds: float = 60.0
    """to record the whole graph for"""
    rate: float = 1000.0
    """of scenes [1/s]"""


class Bare(Node):
    """A raw subscription on every topic, with an empty callback."""

    def __init__(self) -> None:
        """Look for topics twice a second."""
        overrides = [Parameter(name, value=value) for name, value in ENTITIES.items()]
        super().__init__("bare", start_parameter_services=False, parameter_overrides=overrides)
        self.create_timer(0.5, self.discover)
        self._heard: set[str] = set()

    def discover(self) -> None:
        """Subscribe to what is new."""
        for name, types in self.get_topic_names_and_types():
            publishers = self.get_publishers_info_by_topic(name)
            if name in self._heard or not publishers or not Selection().wants(name):
                continue
            self._heard.add(name)
            profile = qos_profile(adapt([offered_qos(info) for info in publishers]))
            kind = message_class(types[0])
            self.create_subscription(kind, name, len, profile, raw=True)  # type: ignore[arg-type]


def publish_scenes(rate: float, listeners: int) -> None:
    """Publish until a signal comes, then print how many; begin once so many listen."""
    stopped: list[int] = []
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    signal.signal(signal.SIGTERM, lambda number, frame: stopped.append(number))
    node = Node("load")
    publisher = node.create_publisher(Scene, TOPIC, DEPTH)
    scene = Scene(disks=[DiskState(x=0.4), DiskState(x=0.5)])
    while publisher.get_subscription_count() < listeners and not stopped:
        time.sleep(0.01)
    begun = time.perf_counter()
    while not stopped:
        scene.scene_id += 1
        publisher.publish(scene)
        time.sleep(max(begun + scene.scene_id / rate - time.perf_counter(), 0.0))
    time.sleep(1.0)  # what was sent is still to be delivered
    print(scene.scene_id, flush=True)


@contextmanager
def running(*command: str) -> Iterator["subprocess.Popen[str]"]:
    """Run a process, and end it if it did not."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
            process.communicate(timeout=PATIENCE)


def end(process: "subprocess.Popen[str]", number: int = signal.SIGTERM) -> str:
    """End a process with a signal; return what it said."""
    process.send_signal(number)
    return process.communicate(timeout=PATIENCE)[0]


def wait_for(process: "subprocess.Popen[str]", text: str) -> None:
    """Wait until a process says something."""
    assert process.stdout is not None
    for line in process.stdout:
        if text in line:
            return
    sys.exit(f"the process ended before it said {text!r}")


def processor_time(process_id: int) -> float:
    """Return the processor time of a process so far, all threads together [s]."""
    words = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / TICKS


def recorder_of(parent: int) -> int:
    """Return the id of the recorder that a process started."""
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            ancestor = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            command = (folder / "cmdline").read_bytes()
        except OSError:
            continue
        if ancestor == parent and b"/sain_bags/record" in command:
            return int(folder.name)
    sys.exit("no recorder among the closed loop's processes")


def whole_graph(options: Options, folder: Path) -> list[Figure]:
    """Record the closed loop and scenes at a high rate; read losses and costs."""
    out = folder / "run"
    here = (sys.executable, "-m", "benchmarks.speed.recorder")
    graph = ("ros2", "run", "sain_bringup", "closed_loop", "--scenario", "anywhere", "--no-video")
    # Played without an end, it is stopped when the time is over.
    with running(*graph, "--episodes", "1000", "--out", str(out)) as loop:
        wait_for(loop, "are up")
        recorder = recorder_of(loop.pid)
        with (
            running(*here, "bare") as bare,
            running(*here, "scenes", str(options.rate)) as load,
        ):
            time.sleep(5.0)  # all have found each other
            before = [processor_time(recorder), processor_time(bare.pid)]
            begun = time.perf_counter()
            time.sleep(options.seconds)
            passed = time.perf_counter() - begun
            after = [processor_time(recorder), processor_time(bare.pid)]
            published = int(end(load).split()[-1])
        end(loop, signal.SIGINT)
    bag = Bag(out / "bag")
    recording, peer = (np.array(after) - before) / passed
    numbers = [received.message.scene_id for received in bag.messages([TOPIC])]
    if numbers != sorted(numbers):
        sys.exit("the scenes are not in their order")
    missing = read_gaps(bag.custom_data)
    if missing is None:
        sys.exit("the bag does not say what is missing")
    return [
        Figure(f"{published:,} scenes at {options.rate:g} Hz, lost", published - len(numbers), "",
               at_most=0),
        Figure("topics of which a sequence number is missing", len(missing), "", at_most=0),
        Figure("processor, recorder", 100 * recording, "% of a core"),
        Figure("processor, bare raw subscriptions", 100 * peer, "% of a core"),
        Figure("recorder / bare", recording / peer, "", at_most=0.15),
    ]  # fmt: skip


def main() -> None:
    """Measure what the recorder costs, and what it loses."""
    options = read_options(Options, __doc__)
    with tempfile.TemporaryDirectory(prefix="sain-bench-") as folder, own_domain():
        figures = whole_graph(options, Path(folder))
    report("The recorder", figures, options.out)


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["bare"]:
            rclpy.init()
            rclpy.spin(Bare())
        case ["scenes", rate]:
            publish_scenes(float(rate), listeners=2)
        case _:
            main()
