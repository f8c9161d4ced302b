"""Readers of others accept what the recorder writes; those that are not installed are skipped."""

import shutil
import subprocess
from pathlib import Path

import pytest
from mcap.reader import NonSeekingReader, make_reader

from sain_bags.bag.metadata import Topic
from sain_bags.writing.writer import BagConfig, BagWriter

COMMANDS = {"pymcap-cli": ["doctor"], "rerun": ["mcap", "check"]}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A recording in which topics are taken one after the other, each in bursts."""
    with BagWriter(tmp_path / "bag", BagConfig(chunk_size=1 << 20)) as writer:
        for name in ("/a", "/b"):
            writer.add_topic(Topic(name, "std_msgs/msg/String", "string data\n"))
        for burst in range(20):
            for topic, offset in (("/a", 0), ("/b", -7)):
                for number in range(10):
                    word = b"\0\1\0\0\2\0\0\0x\0"
                    time = 1_000_000 + 100 * burst + 10 * number + offset
                    writer.write(topic, word, time, time, burst * 10 + number + 1)
    return tmp_path / "bag" / "bag_0.mcap"


def test_messages_stand_in_the_order_of_their_times(file: Path) -> None:
    with file.open("rb") as stream:
        times = [m.log_time for _, _, m in NonSeekingReader(stream).iter_messages()]
    assert len(times) == 400
    assert times == sorted(times)
    with file.open("rb") as stream:
        indexed = [(c.topic, m.sequence) for _, c, m in make_reader(stream).iter_messages(["/b"])]
    assert indexed == [("/b", number) for number in range(1, 201)]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_of_others(command: str, file: Path) -> None:
    if shutil.which(command) is None:
        pytest.skip(f"{command} is not installed")
    done = subprocess.run([command, *COMMANDS[command], file], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "error" not in done.stdout.lower()
