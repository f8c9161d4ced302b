"""Commands of README in a terminal: a graph is started, looked at, driven and recorded."""

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sain_bags.reading.reader import Bag
from sain_bringup.graph import executable

pytestmark = pytest.mark.system
PATIENCE = 90.0  # [s]
HEARS_ALL = 50  # messages, with which a recorder hears the simulator, too
Run = Callable[..., str]


@contextmanager
def started(folder: Path, log: str, package: str, name: str, *words: str) -> Iterator[Path]:
    """Start a command in a folder, and end it as Ctrl-C does; its output is in a file."""
    path = folder / log
    with path.open("w") as output:
        process = subprocess.Popen(
            [executable(package, name), *words], cwd=folder, stdout=output, stderr=output
        )
        try:
            yield path
        finally:
            process.send_signal(signal.SIGINT)
            code = process.wait(PATIENCE)
    assert code in (0, 130), path.read_text()


@pytest.fixture(scope="module")
def place(ros_domain, tmp_path_factory):
    """A folder in which a graph runs."""
    folder = tmp_path_factory.mktemp("terminal")
    with started(folder, "graph.log", "sain_bringup", "graph", "--model", "planar"):
        yield folder
    assert all(Bag(path).message_count for path in (folder / "bags").iterdir())


@pytest.fixture(scope="module")
def run(place):
    """Runs a command to its end and returns what it prints."""

    def run(package: str, name: str, *words: str) -> str:
        done = subprocess.run(
            [executable(package, name), *words], cwd=place, capture_output=True, text=True,
            timeout=PATIENCE, env={**os.environ, "COLUMNS": "200"},
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return run


def test_a_topic_is_printed(run):
    assert "settled" in run("sain_bringup", "watch", "scene", "--count", "1", "--timeout", "60")


def test_a_push_is_sent_and_its_result_printed(run):
    said = run("sain_bringup", "push", "--location", "0", "--length", "0.10", "--timeout", "60")
    assert "mm" in said


def test_another_episode_is_begun_and_its_bodies_printed(run):
    def begun() -> tuple[int, str]:
        said = run("sain_bringup", "reset", "--seed", "7", "--timeout", "60")
        found = re.fullmatch(r"episode (\d+): (body 0 at \(0\.350, 0\.000\) m, body 1 .*\n)", said)
        assert found, said
        return int(found[1]), found[2]

    (first, there), (second, again) = begun(), begun()
    assert (second, again) == (first + 1, there)


def most_messages(log: str) -> int:
    """How many messages a recorder has, by what it says from time to time."""
    counts = re.findall(r"([\d,]+) messages", log)
    return max((int(count.replace(",", "")) for count in counts), default=0)


def test_a_goal_is_reached_and_recorded(run, place):
    recording = place / "bags" / "mine"
    record = ("record", "--out", str(recording), "--status-period", "0.5")
    with (
        started(place, "record.log", "sain_bags", *record) as log,
        started(place, "watch.log", "sain_bringup", "watch", "plan"),
    ):
        deadline = time.monotonic() + PATIENCE
        while most_messages(log.read_text()) < HEARS_ALL:
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.05)
        said = run("sain_bringup", "goal", "0.6", "0.1", "--timeout", "60")
    assert "reached" in said
    assert "/sain/scene" in {topic.name for topic in Bag(recording).topics}
