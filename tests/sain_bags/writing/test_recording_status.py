"""What a recorder says is what it has done."""

from pathlib import Path

from sain_bags.bag.metadata import Topic
from sain_bags.writing.gaps import Gaps
from sain_bags.writing.recording_status import RecordingStatus
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
        gaps = {"/a": lost_two(), "/b": Gaps()}
        status = RecordingStatus(writer, gaps, {"/d"}, {"/c"}, 61.2)
    line = status.line(1234.4)
    assert line.startswith("01:01  3 messages  1,234/s  0.0")
    assert line.endswith(" MB in 3 files  1 topics, 1 unusable, 2 silent  missing: 2 of /a")
    final = status.final(Path("bags/mine"), 2_340_000)
    assert final == (
        "Recorded 3 messages on 1 topics in 61.2 s, missing: 2 of /a:"
        " bags/mine (2.34 MB in 3 files)\nNo message came on /b, /c\nNot recorded: /d"
    )


def test_a_recorder_that_heard_nothing_does_not_call_that_complete(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", BagConfig()) as writer:
        writer.add_topic(Topic("/a", "std_msgs/msg/Empty", "\n"))
        gaps = {"/a": Gaps(), "/rosout": Gaps()}
        status = RecordingStatus(writer, gaps, (), (), 5.0)
    assert status.final(Path("bags/mine"), 1000) == (
        "Recorded 0 messages on 1 topics in 5.0 s, nothing heard: bags/mine (0.00 MB)\n"
        "No message came on /a"
    )
