"""A recording that was cut off, and the one that goes on with it."""

from pathlib import Path

import pytest
from rich.console import Console

from sain_bags.bag.metadata import Topic, TopicQos
from sain_bags.bag.parts import set_aside
from sain_bags.cli import recover
from sain_bags.cli.info import show
from sain_bags.reading.reader import Bag
from sain_bags.recovery import join
from sain_bags.writing.writer import BagWriter
from sain_core.errors import DatasetError, OutputError

TEXT = Topic("/text", "std_msgs/msg/String", "string data\n", "", (TopicQos(),))
CDR = b"\x00\x01\x00\x00\x02\x00\x00\x00a\x00\x00\x00"


def record(folder: Path, first: int, count: int, whole: bool, is_part: bool = False) -> None:
    writer = BagWriter(folder, custom_data={"part": str(first)}, is_part=is_part)
    writer.add_topic(TEXT)
    for number in range(first, first + count):
        writer.write("/text", CDR, number)
    if whole:
        writer.close()
    else:
        writer.flush()  # and the process is killed


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.mark.parametrize("place", ["bag", "bag.cut_off"])
@pytest.mark.parametrize(
    "name",
    ["thesis.tex", ".ssh/id_rsa", "bag_1.mcap", "metadata.yaml", "photos.mcap", "bag_x.mcap"],
)
def test_what_no_recorder_wrote_is_never_moved_or_removed(
    name: str, place: str, tmp_path: Path
) -> None:
    folder = tmp_path / "bag"
    record(folder, 1, 10, whole=False)
    strange = tmp_path / place / name
    strange.parent.mkdir(parents=True, exist_ok=True)
    strange.write_text("the only copy")
    before = contents(tmp_path)
    with pytest.raises(OutputError, match="is no recording that was cut off: it holds '"):
        set_aside(folder)
    assert contents(tmp_path) == before


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis").write_text("the only copy")
    (tmp_path / "bag").symlink_to(tmp_path / "home")
    with pytest.raises(OutputError, match="it is no folder"):
        set_aside(tmp_path / "bag")
    assert (tmp_path / "home" / "thesis").exists() and (tmp_path / "bag").is_symlink()


def test_what_a_recorder_leaves_is_taken_whenever_it_was_killed(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    record(folder, 1, 10, whole=False)
    whole = (folder / "bag_0.mcap").read_bytes()
    for number, size in enumerate((0, 1, 20), start=1):
        (folder / f"bag_{number}.mcap").write_bytes(whole[:size])
    (folder / ".bag_3.mcap.reserve").write_text("")
    aside = set_aside(folder)
    assert aside is not None and not folder.exists()
    record(folder, 11, 10, whole=True, is_part=True)
    join(aside, folder)
    assert [found.log_time for found in Bag(folder).messages(["/text"])] == list(range(1, 21))


@pytest.mark.parametrize("stopped", ["recording", "closed", "joining"])
def test_the_advice_about_a_recording_in_parts_saves_all(
    stopped: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = Path("bag")
    for number in range(4):
        set_aside(folder)
        last = number == 3
        record(folder, 1 + 100 * number, 100, last and stopped != "recording", is_part=number > 0)
    if stopped == "joining":  # was killed
        set_aside(folder)
        Path(".bag.4711.partial").mkdir()
    with pytest.raises(DatasetError, match=r"bag\.cut_off were not joined") as caught:
        show(folder, Console())
    command = str(caught.value).split("`")[1].split()
    assert command[:4] == ["ros2", "run", "sain_bags", "recover"] and command[5] == "--out"
    recover.run(recover.RecoverOptions(Path(command[4]), Path(command[6])), Console())
    assert "Saved 400 messages" in capsys.readouterr().out
    saved = Bag(Path(command[6]))
    assert [found.log_time for found in saved.messages(["/text"])] == list(range(1, 401))


def test_all_that_was_flushed_becomes_one_bag(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    for number, whole in enumerate((False, False, True)):
        aside = set_aside(folder)
        assert (aside is None) == (number == 0)
        record(folder, 1 + 100 * number, 100, whole, is_part=number > 0)
    join(aside, folder)
    bag = Bag(folder)
    bag.check()
    assert [received.log_time for received in bag.messages(["/text"])] == list(range(1, 301))
    assert not aside.exists()
    assert [path.name for path in folder.glob("*.mcap")] == ["bag_0.mcap"]
