"""Rates, gaps and missing messages are those that were recorded."""

from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from sain_bags.bag.metadata import Topic
from sain_bags.cli.info import show
from sain_bags.reading.reader import Bag
from sain_bags.reading.timing import read_timings
from sain_bags.writing.writer import BagWriter
from sain_core.errors import DatasetError

MILLISECOND = 1_000_000


def record(folder: Path, numbers: dict[str, list[tuple[int, int]]]) -> Bag:
    """Record empty messages, given by topic as their times [ms] and sequence numbers."""
    with BagWriter(folder) as writer:
        for name in numbers:
            writer.add_topic(Topic(name, "std_msgs/msg/Empty", "\n"))
        for name, messages in numbers.items():
            for time, sequence in messages:
                received = (1000 + time) * MILLISECOND
                writer.write(name, b"\x00\x01\x00\x00\x00", received, sequence=sequence)
    return Bag(folder)


def test_rate_longest_gap_and_missing_messages(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", {"/a": [(0, 5), (100, 6), (400, 9), (500, 10)], "/b": [(3, 1)]})
    timings = {name: timing for (name, _), timing in read_timings(bag).items()}
    assert timings["/a"].rate == pytest.approx(6.0)
    assert timings["/a"].longest_gap == pytest.approx(0.3)
    assert timings["/a"].missing == 2
    assert (timings["/b"].rate, timings["/b"].longest_gap, timings["/b"].missing) == (0.0, 0.0, 0)


def test_the_latest_message_is_shown_but_not_one_from_before_the_recording(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic(Topic("/a", "std_msgs/msg/Empty", "\n"))
        for number, (published, received) in enumerate([(100, 900), (910, 912), (905, 950)], 1):
            times = received * MILLISECOND, published * MILLISECOND
            writer.write("/a", b"\x00\x01\x00\x00\x00", *times, number)
    (timing,) = read_timings(Bag(tmp_path / "bag")).values()
    assert timing.latest == pytest.approx(0.045)
    out = StringIO()
    show(tmp_path / "bag", Console(file=out, width=120))
    assert "45.0 ms" in next(line for line in out.getvalue().splitlines() if line.startswith("/a"))


def test_info_shows_them_and_checks_only_when_asked(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", {"/a": [(0, 5), (100, 6), (400, 12)]})
    content = bytearray(bag.file.read_bytes())
    out = StringIO()
    show(bag.path, Console(file=out, width=120))
    (row,) = [line.split() for line in out.getvalue().splitlines() if line.startswith("/a")]
    assert row == ["/a", "std_msgs/msg/Empty", "3", "5.0", "Hz", "0.30", "s", "5", "-"]
    content[80] ^= 1  # in the chunk
    bag.file.write_bytes(content)
    with pytest.raises(DatasetError, match="damaged or not whole"):
        show(bag.path, Console(file=out, width=120))
    out = StringIO()
    show(bag.path, Console(file=out, width=120), check=False)
    assert "only its summary was checked" in out.getvalue()
