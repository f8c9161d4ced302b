"""A recording that was cut off, and the one that goes on with it."""

from pathlib import Path

import pytest

from sain_bags.bag.metadata import Topic, TopicQos
from sain_bags.bag.parts import check_parts
from sain_bags.reading.reader import Bag
from sain_bags.recovery import make_whole, recover
from sain_bags.writing.split_file import SplitFile
from sain_bags.writing.writer import BagConfig, BagWriter
from sain_core.errors import DatasetError, OutputError

TEXT = Topic("/text", "std_msgs/msg/String", "string data\n", "", (TopicQos(),))
CDR = b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00\x00\x00"


def record(folder: Path, part: int, whole: bool = False) -> None:
    """Record ten messages; unless it is made whole, the process is killed."""
    writer = BagWriter(folder, custom_data={"part": str(part)}, resumes=True)
    writer.add_topic(TEXT)
    for number in range(10 * part, 10 * part + 10):
        writer.write("/text", CDR, 1 + number)
    writer.close() if whole else writer.flush()


def times(bag: Path) -> list[int]:
    return [found.log_time for found in Bag(bag).messages(["/text"])]


@pytest.mark.parametrize(
    "name",
    ["thesis.tex", ".ssh/id_rsa", "bag_1.mcap", "metadata.yaml", "photos.mcap", "bag_x.mcap"],
)
def test_what_no_recorder_wrote_is_never_changed(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    record(folder, 0)
    strange = folder / name
    strange.parent.mkdir(exist_ok=True)
    strange.write_text("the only copy")
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    for end in (check_parts, make_whole):
        with pytest.raises(OutputError, match="is no recording that was cut off: it holds '"):
            end(folder)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "bag").symlink_to(tmp_path / "home")
    with pytest.raises(OutputError, match="it is no folder"):
        check_parts(tmp_path / "bag")


@pytest.mark.parametrize("killed", ["recording", "closed", "ending"])
def test_all_that_was_flushed_is_in_one_bag_whenever_it_was_killed(
    killed: str, tmp_path: Path
) -> None:
    """Also where `recover` does what the recorder could not any more."""
    folder = tmp_path / "bag"
    for part in range(4):
        record(folder, part, whole=part == 1 or (part == 3 and killed != "recording"))
    content = (folder / "bag_0.mcap").read_bytes()
    for number, size in enumerate((0, 1, 20), start=4):
        (folder / f"bag_{number}.mcap").write_bytes(content[:size])
    (folder / ".bag_6.mcap.reserve").write_text("")
    if killed == "ending":
        (folder / ".bag_0.mcap.whole").write_bytes(content[:50])
    with pytest.raises(DatasetError, match=r"was not closed.*`ros2 run sain_bags recover"):
        Bag(folder)
    recover(folder, tmp_path / "saved")
    make_whole(folder)
    for bag in (tmp_path / "saved", folder):
        Bag(bag).check()
        assert times(bag) == list(range(1, 41))
        assert Bag(bag).custom_data["part"] == "3"


def test_a_flush_hands_on_what_is_in_the_file_before_a_split(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process is killed before that file is ended, which another thread does."""
    monkeypatch.setattr(SplitFile, "close", lambda *_: None)
    writer = BagWriter(tmp_path / "bag", BagConfig(split_size=200))
    writer.add_topic(TEXT)
    for number in range(50):
        writer.write("/text", CDR, 1 + number)
    writer.flush()
    assert len(writer.files) > 1
    recover(tmp_path / "bag", tmp_path / "saved")
    assert times(tmp_path / "saved") == list(range(1, 51))
