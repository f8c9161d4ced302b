"""A bag in the live page: one command serves the page and plays the bag."""

import signal
import subprocess
from pathlib import Path

import pytest

from benchmarks.live_viewer import Viewer
from sain_bags.writing.writer import BagWriter
from sain_core.cli.executables import executable
from tests.sain_bags.conftest import Messages, Recording, resting_scene
from tests.sain_live.straw import free_port

pytestmark = pytest.mark.system


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    recording = Recording(BagWriter(tmp_path / "bag"), Messages())
    for number in range(20):
        recording.scene(1, 1, resting_scene(0.6 + 0.001 * number))
    recording.writer.close()
    return tmp_path / "bag"


def start(*arguments: str) -> "subprocess.Popen[str]":
    command = [str(executable("sain_bags", "view")), *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def test_a_recording_is_seen_in_the_page(ros_domain: int, bag: Path) -> None:
    port = free_port()
    process = start(str(bag), "--port", str(port))
    said = ""
    while "the page is at" not in said:
        said = process.stdout.readline()
        assert said, process.wait()
    assert f"http://127.0.0.1:{port}" in said
    viewer = Viewer(port)
    viewer.wait(lambda: any(name.startswith("/bodies") for name in viewer.nodes), "the bodies")
    viewer.close()
    process.send_signal(signal.SIGINT)
    rest = process.communicate(timeout=30)[0]
    assert process.returncode == 0 and "Traceback" not in rest


def test_a_port_in_use_ends_it_in_words(ros_domain: int, bag: Path) -> None:
    port = free_port()
    first = start(str(bag), "--port", str(port))
    while "the page is at" not in first.stdout.readline():
        assert first.poll() is None
    second = start(str(bag), "--port", str(port))
    said = second.communicate(timeout=60)[0]
    first.send_signal(signal.SIGINT)
    first.communicate(timeout=30)
    assert second.returncode == 1
    assert f"port {port} of 127.0.0.1 is in use" in said
