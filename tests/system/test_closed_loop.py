"""The whole graph as a person runs it: real processes, real recording, real pictures."""

import json
import os
import signal
import subprocess
import time
import uuid
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import domain_coordinator
import numpy as np
import pytest
from PIL import Image, ImageSequence
from rosbags.highlevel import AnyReader

from sain_bags.reading.reader import Bag
from sain_bags.rows.episodes import read_episodes
from sain_bringup.graph import executable

pytestmark = pytest.mark.system

MARK = "SAIN_SYSTEM_TEST"  # a variable that every process of a run inherits
UP = "are up"
TOPICS = {
    "/clock", "/diagnostics", "/rosout", "/parameter_events", "/tf", "/tf_static",
    "/sain/goal", "/sain/joint_states", "/sain/markers", "/sain/plan",
    "/sain/plan_markers", "/sain/push", "/sain/push_result", "/sain/robot_description",
    "/sain/scene",
}  # fmt: skip


@dataclass
class Run:
    """One closed loop, started and not waited for."""

    process: "subprocess.Popen[str]"
    out: Path
    output: Path
    mark: str

    def text(self) -> str:
        return self.output.read_text(encoding="utf-8")

    def living(self) -> list[int]:
        """The ids of all processes of this run that still run."""
        found = []
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                environment = (folder / "environ").read_bytes()
                state = (folder / "stat").read_text().rpartition(")")[2].split()[0]
            except OSError:
                continue
            if f"{MARK}={self.mark}".encode() in environment and state != "Z":
                found.append(int(folder.name))
        return found

    def process_of(self, executable_name: str) -> int:
        """The id of the process that runs an executable of the graph."""
        for process_id in self.living():
            command = Path(f"/proc/{process_id}/cmdline").read_bytes().split(b"\0")
            if any(word.endswith(f"/{executable_name}".encode()) for word in command):
                return process_id
        raise AssertionError(f"no {executable_name} among the processes of the run")

    def until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 200.0
        while not condition():
            if time.monotonic() > deadline:
                self.kill()  # or it would disturb the next test in its domain
                raise AssertionError(f"waited in vain:\n{self.text()}")
            time.sleep(0.05)

    def wait_for(self, text: str) -> None:
        self.until(lambda: text in self.text() or self.process.poll() is not None)
        assert text in self.text(), self.text()

    def end(self) -> int:
        """Wait for the end; return the exit code. Nothing may be left running."""
        self.until(lambda: self.process.poll() is not None)
        code = self.process.wait()
        self.until(lambda: not self.living())
        return code

    def kill(self) -> None:
        """Leave nothing running, whatever became of the test."""
        while left := self.living():
            for process_id in left:
                with suppress(ProcessLookupError):
                    os.kill(process_id, signal.SIGKILL)


def start(folder: Path, domain: int, *arguments: str) -> Run:
    mark, output = uuid.uuid4().hex, folder / f"output-{uuid.uuid4().hex[:6]}.txt"
    out = folder / f"results-{mark[:6]}"
    command = [str(executable("sain_bringup", "closed_loop")), "--out", str(out), *arguments]
    environment = {**os.environ, MARK: mark, "ROS_DOMAIN_ID": str(domain), "PYTHONUTF8": "1"}
    with output.open("w") as stream:
        process = subprocess.Popen(
            command, env=environment, stdout=stream, stderr=subprocess.STDOUT, text=True
        )
    return Run(process, out, output, mark)


@pytest.fixture(scope="module")
def domains():
    with domain_coordinator.domain_id() as one, domain_coordinator.domain_id() as other:
        yield one, other


@pytest.fixture(scope="module")
def played(domains, tmp_path_factory):
    """A short run that is over."""
    folder = tmp_path_factory.mktemp("played")
    run = start(folder, domains[0], "--scenario", "anywhere", "--seed", "1")
    assert run.end() == 0, run.text()
    return run


@pytest.fixture
def endless(domains, tmp_path):
    """A run in the middle of its episodes; ended at the end if the test did not."""
    run = start(tmp_path, domains[1], "--episodes", "500", "--model", "planar")
    try:
        run.wait_for(UP)
        run.wait_for("1/500")
        yield run
    finally:
        run.kill()


def test_an_episode_succeeds_and_says_so(played):
    summary = json.loads((played.out / "summary.json").read_text())
    assert summary["successes"] == 1
    (episode,) = summary["episodes"]
    assert episode["scenario"] == "anywhere"
    assert episode["final_distance"] <= 0.02
    assert episode["model_error"] < 0.05
    assert summary["recording"]["episodes"] == "anywhere:1"
    assert "reached" in played.text()


def test_rosbags_reads_every_topic_of_the_graph(played):
    counts = dict.fromkeys(TOPICS, 0)
    with AnyReader([played.out / "bag"]) as reader:
        assert {connection.topic for connection in reader.connections} >= TOPICS
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            counts[connection.topic] = counts.get(connection.topic, 0) + 1
    assert [topic for topic in TOPICS - {"/parameter_events"} if not counts[topic]] == []


def test_every_push_is_paired(played):
    (episode,) = [e for e in read_episodes(Bag(played.out / "bag")) if e.goal is not None]
    assert episode.success
    for push in episode.executed:
        assert push.plan is not None
        assert push.physics is not None
        assert push.predicted is not None


def test_simulated_time_never_goes_back(played):
    stamps = [
        received.message.clock.sec * 10**9 + received.message.clock.nanosec
        for received in Bag(played.out / "bag").messages(["/clock"])
    ]
    assert stamps == sorted(stamps)
    assert stamps[-1] > stamps[0]


def test_all_headers_have_the_simulator_s_time(played):
    """Wall time, of which there are 10^9 seconds, would stand out."""
    bag = Bag(played.out / "bag")
    last = max(received.message.clock.sec for received in bag.messages(["/clock"])) + 1
    stamps: dict[str, set[int]] = {}
    for received in bag.messages():
        if header := getattr(received.message, "header", None):
            stamps.setdefault(received.topic, set()).add(header.stamp.sec)
    assert {"/diagnostics", "/sain/push", "/sain/plan", "/sain/goal"} <= set(stamps)
    assert {topic: max(seen) for topic, seen in stamps.items() if max(seen) > last} == {}


def test_every_frame_of_the_film_shows_target_and_goal(played):
    with Image.open(played.out / "closed_loop.gif") as movie:
        for frame in ImageSequence.Iterator(movie):
            picture = np.array(frame.convert("RGB")).astype(int)[:320]  # above the caption
            red, green, blue = np.moveaxis(picture, -1, 0)
            target = (red > green + 60) & (green > blue + 20)
            goal = (green > red + 60) & (green > blue + 20)
            assert target.sum() > 50, f"the target is hidden in frame {movie.tell()}"
            assert goal.sum() > 10, f"the goal is hidden in frame {movie.tell()}"


def test_interrupt_leaves_no_process_and_a_whole_bag(endless, domains, tmp_path):
    assert len(endless.living()) == 5
    second = start(tmp_path, domains[1], "--scenario", "paper")
    assert second.end() == 1
    assert "already" in second.text()
    assert "ROS_DOMAIN_ID" in second.text()
    assert f"No episode was played, so {second.out} was removed." in second.text()
    assert not second.out.exists()
    endless.wait_for("✓ 1/")
    os.kill(endless.process.pid, signal.SIGINT)
    assert endless.end() == 128 + signal.SIGINT, endless.text()
    assert f"What was recorded is whole. It is in {endless.out}/bag/." in endless.text()
    bag = Bag(endless.out / "bag")
    bag.check()
    with AnyReader([endless.out / "bag"]) as reader:
        assert reader.message_count == bag.message_count > 0


def test_nothing_is_left_when_the_closed_loop_is_killed(endless):
    os.kill(endless.process_of("closed_loop"), signal.SIGKILL)
    assert endless.end() == -signal.SIGKILL
    Bag(endless.out / "bag").check()


def test_processes_that_are_killed_come_back_and_the_third_within_a_minute_ends_the_loop(endless):
    for victim, name in (("sim_node", "simulator"), ("record", "recorder")):
        os.kill(endless.process_of(victim), signal.SIGKILL)
        endless.wait_for(f"{name} was killed by SIGKILL; it was restarted, and is back after")
    os.kill(endless.process_of("mppi_node"), signal.SIGKILL)
    assert endless.end() == 1
    assert "planner was killed by SIGKILL, the last of 3 crashes within 60 s" in endless.text()
    bag = Bag(endless.out / "bag")
    bag.check()
    pushes = [push.push_id for one in read_episodes(bag) for push in one.executed]
    assert len(pushes) == len(set(pushes)) > 0, "a push was executed twice"
    clock = [received.message.clock for received in bag.messages(["/clock"])]
    times = [(time.sec, time.nanosec) for time in clock]
    assert times == sorted(times)
