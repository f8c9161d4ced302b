"""What a recorder says is what it has done."""

from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from sain_bags.bag.metadata import Topic
from sain_bags.writing.gaps import Gaps
from sain_bags.writing.recording_status import RecordingStatus, StatusDisplay
from sain_bags.writing.writer import BagConfig, BagWriter


def lost_two() -> Gaps:
    gaps = Gaps()
    for number in (1, 4):
        gaps.saw(number)
    return gaps


def test_a_line_says_all(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", BagConfig(split_duration=1e-6)) as writer:
        writer.add_topic(Topic("/a", "std_msgs/msg/Empty", "\n"))
        for number in range(1, 4):
            writer.write("/a", b"\x00\x01\x00\x00\x00", 10_000 * number)
        status = RecordingStatus.of(writer, {"/a": lost_two(), "/b": Gaps()}, 1, 61.2, {"/c"})
    line = status.line(1234.4)
    assert line.startswith("01:01  3 messages  1,234/s  0.0")
    assert line.endswith(" MB in 3 files  1 topics, 1 unusable, 2 silent  missing: 2 of /a")
    final = status.final(Path("bags/mine"), 2_340_000)
    assert final == (
        "Recorded 3 messages on 1 topics; 1 topics could not be in 61.2 s, missing: 2 of /a:"
        " bags/mine (2.34 MB in 3 files)\nNo message came on /b, /c"
    )


def test_a_recorder_that_heard_nothing_does_not_call_that_complete(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", BagConfig()) as writer:
        writer.add_topic(Topic("/a", "std_msgs/msg/Empty", "\n"))
        status = RecordingStatus.of(writer, {"/a": Gaps(), "/rosout": Gaps()}, 0, 5.0)
    assert status.final(Path("bags/mine"), 1000) == (
        "Recorded 0 messages on 1 topics in 5.0 s, nothing heard: bags/mine (0.00 MB)\n"
        "No message came on /a"
    )


def status(messages: int) -> RecordingStatus:
    return RecordingStatus(5.0, messages, 2, 0, 1_000_000, 1, ())


@pytest.mark.parametrize(("period", "lines"), [(1e-9, 2), (0.0, 0), (1000.0, 0)])
def test_off_a_terminal_a_line_comes_now_and_then(period: float, lines: int) -> None:
    out = StringIO()
    with StatusDisplay(Console(file=out, width=200), period) as display:
        for messages in (10, 20):
            display.show(lambda messages=messages: status(messages))
    assert out.getvalue().count("\n") == lines
    assert out.getvalue().count("none missing") == lines


def test_on_a_terminal_one_line_changes_and_goes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sain_bags.writing.recording_status.LIVE_PERIOD", 1e-9)
    out = StringIO()
    console = Console(file=out, width=100, force_terminal=True)
    with StatusDisplay(console, 0.0) as display:
        for messages in (10, 20):
            display.show(lambda messages=messages: status(messages))
    assert "10 messages" in out.getvalue()
    assert "20 messages" in out.getvalue()
    assert "\x1b[2K" in out.getvalue()  # what was there is erased
