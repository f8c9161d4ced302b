"""A recording that was cut off, and the one that goes on with it."""

from pathlib import Path

import pytest

from sain_bags.bag.metadata import Topic, TopicQos
from sain_bags.reading.reader import Bag
from sain_bags.recovery.resumption import join, set_aside
from sain_bags.writing.writer import BagWriter
from sain_core.errors import OutputError

TEXT = Topic("/text", "std_msgs/msg/String", "string data\n", "", (TopicQos(),))
CDR = b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00\x00\x00"


def record(folder: Path, first: int, count: int, whole: bool) -> None:
    writer = BagWriter(folder, custom_data={"part": str(first)})
    writer.add_topic(TEXT)
    for number in range(first, first + count):
        writer.write("/text", CDR, number)
    if whole:
        writer.close()
    else:
        writer.flush()  # and the process is killed


def test_all_that_was_flushed_becomes_one_bag(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    for number, whole in enumerate((False, False, True)):
        aside = set_aside(folder)
        assert (aside is None) == (number == 0)
        record(folder, 1 + 100 * number, 100, whole)
    join(aside, folder)
    bag = Bag(folder)
    bag.check()
    assert [received.log_time for received in bag.messages(["/text"])] == list(range(1, 301))
    assert not aside.exists()
    assert [path.name for path in folder.glob("*.mcap")] == ["bag_0.mcap"]


def test_nothing_was_recorded_before(tmp_path: Path) -> None:
    assert set_aside(tmp_path / "bag") is None


def test_a_whole_bag_is_never_touched(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    record(folder, 1, 10, whole=True)
    with pytest.raises(OutputError, match="is no recording that was cut off"):
        set_aside(folder)
    assert Bag(folder).check() is None
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="is no recording that was cut off"):
        set_aside(tmp_path / "file")
