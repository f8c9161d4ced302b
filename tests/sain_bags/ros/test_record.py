"""The recorder as a process: stopped, killed, and out of space, while messages keep coming."""

import os
import resource
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rich.console import Console
from std_msgs.msg import String

from sain_bags.reading.reader import Bag
from sain_bags.recovery import recover
from sain_bags.ros.record import end_parts
from sain_bags.writing.gaps import read_gaps
from sain_bringup.graph import executable
from sain_core.errors import OutputError
from sain_core.guarding import lifetime

pytestmark = pytest.mark.ros
TOPIC = "/numbers"
RATE = 500.0  # [1/s]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Speaker:
    """Publishes numbers on a thread, and a latched word once."""

    def __init__(self, domain: int) -> None:
        self.domain = domain
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node("speaker", context=self.context)
        self.numbers = self.node.create_publisher(String, TOPIC, 1000)
        self.goal = self.node.create_publisher(String, "/goal", LATCHED)
        self.goal.publish(String(data="the goal"))
        self.said = 0
        self.stopped = False
        self.thread = threading.Thread(target=self.speak)
        self.thread.start()

    def speak(self) -> None:
        while not self.stopped:
            self.said += 1
            self.numbers.publish(String(data=f"{self.said:08d}" + 64 * "."))
            time.sleep(1 / RATE)

    def close(self) -> None:
        self.stopped = True
        self.thread.join()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


@pytest.fixture
def speaker(ros_domain: int) -> Iterator[Speaker]:
    speaker = Speaker(ros_domain)
    yield speaker
    speaker.close()


def start(speaker: Speaker, out: Path, *options: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [str(executable("sain_bags", "record")), "--out", str(out), *options],
        env={**os.environ, "ROS_DOMAIN_ID": str(speaker.domain)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def has_messages(file: Path) -> bool:
    return file.exists() and file.stat().st_size > 4000


def numbers(bag: Bag) -> list[int]:
    return [int(received.message.data[:8]) for received in bag.messages([TOPIC])]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_makes_the_bag_whole(
    number: signal.Signals, speaker: Speaker, tmp_path: Path
) -> None:
    process = start(speaker, tmp_path / "bag", "--bag.split-duration", "1", "--status-period", "1")
    wait(lambda: has_messages(tmp_path / "bag" / "bag_2.mcap"))
    process.send_signal(number)
    said, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (0, "")
    bag = Bag(tmp_path / "bag")
    bag.check()
    found = numbers(bag)
    assert found == [*range(found[0], found[-1] + 1)]  # none missing, also between files
    assert read_gaps(bag.custom_data) == {}
    words = [message.message.data for message in bag.messages(["/goal"])]
    assert words == ["the goal"] * len(bag.files)
    *status, last = said.strip().splitlines()
    assert "messages" in status[0]
    assert "none missing" in status[-1]
    assert last.startswith("Recorded ")
    assert f"in {len(bag.files)} files" in last


@pytest.mark.parametrize("delay", [0.13, 0.71])
def test_a_recorder_that_is_killed_loses_at_most_its_flush_period(
    delay: float, speaker: Speaker, tmp_path: Path
) -> None:
    process = start(speaker, tmp_path / "bag", "--custom-data", "seed=7")
    wait(lambda: has_messages(tmp_path / "bag" / "bag_0.mcap"))
    time.sleep(delay)
    killed = time.time()
    process.kill()
    process.communicate()
    report = recover(tmp_path / "bag", tmp_path / "saved")
    assert "the file has no end" in report.losses[0]
    assert killed - 1e-9 * report.span.end <= 1.0
    saved = Bag(tmp_path / "saved")
    assert saved.custom_data["seed"] == "7"
    found = numbers(saved)
    assert found == [*range(found[0], found[-1] + 1)]


def test_a_write_that_fails_is_an_error_at_once_and_nothing_of_before_is_lost(
    speaker: Speaker, tmp_path: Path
) -> None:
    process = start(speaker, tmp_path / "bag", "--bag.compression", "none")
    file = tmp_path / "bag" / "bag_0.mcap"
    wait(lambda: has_messages(file))
    limit = file.stat().st_size + 10_000
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (limit, limit))
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "record: cannot write the bag" in errors
    assert "File too large" in errors
    assert "ros2 run sain_bags recover" in errors  # there is no room for the end of the file
    before = speaker.said
    recover(tmp_path / "bag", tmp_path / "saved")
    found = numbers(Bag(tmp_path / "saved"))
    assert found == [*range(found[0], found[-1] + 1)]
    wait(lambda: speaker.said > before + 50)  # who speaks goes on


def test_a_recorder_that_resumes_makes_one_bag_unless_a_second_signal_comes(
    speaker: Speaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "bag"
    for part in range(3):
        process = start(speaker, out, "--resume")
        wait(lambda part=part: has_messages(out / f"bag_{part}.mcap"))
        if part < 2:
            process.kill()
            process.communicate()
    shutil.copytree(out, tmp_path / "killed" / "bag")
    process.send_signal(signal.SIGINT)
    said, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (0, "")
    assert "ending the files that were cut off; Ctrl-C leaves them\n" in said
    found = numbers(Bag(out))
    assert found == sorted(set(found)) and len(found) > 30
    out = tmp_path / "killed" / "bag"
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    monkeypatch.setattr(lifetime, "alive", lambda: os.kill(os.getpid(), signal.SIGTERM))
    try:
        with pytest.raises(OutputError, match="a signal ended the recorder before its bag was w"):
            end_parts(out, Console())
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    recover(out, tmp_path / "saved")
    saved = numbers(Bag(tmp_path / "saved"))
    assert saved == found[: len(saved)] and len(saved) > 20
