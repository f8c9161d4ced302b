"""Nothing is ever deleted or replaced that is not ours."""

import os
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from sain_core import output
from sain_core.errors import OutputError
from sain_core.output import (
    MANIFEST,
    append_json,
    claim_file,
    claim_folder,
    remove,
    sign,
    write_json,
    write_whole,
)

MINE = "the only copy"


def next_run() -> None:
    """Forget what this process wrote, as another process does not know it."""
    output._ours.clear()
    output._claimed.clear()


@pytest.fixture
def ours(tmp_path):
    """A folder that a run of ours made: a file, a file that grows, and a folder below."""
    folder = claim_folder(tmp_path / "ours", ["a.json"])
    write_json(folder / "a.json", 1)
    append_json(folder / "log.jsonl", 1)
    write_json(folder / "below" / "b.json", 2)
    next_run()
    return folder


def test_a_second_run_replaces_what_the_first_one_wrote(ours):
    append_json(ours / "log.jsonl", 2)
    next_run()
    claim_folder(ours, ["a.json", "log.jsonl", "below/b.json"])
    write_json(ours / "a.json", 3)
    assert (ours / "a.json").read_text() == "3\n"
    assert (ours / "log.jsonl").read_text() == "1\n2\n"


@pytest.mark.parametrize("name", ["a.json", "below/b.json", "new.json"])
def test_what_a_user_wrote_or_changed_needs_overwrite(ours, name):
    (ours / name).write_text(MINE)
    new = name == "new.json"
    reason = "exists, and no list of SAIN names" if new else "was changed since SAIN wrote"
    for refused in (
        lambda: claim_folder(ours, [name]),
        lambda: claim_file(ours / name),
        lambda: write_json(ours / name, 4),
        lambda: append_json(ours / name, 4),
    ):
        with pytest.raises(OutputError, match=rf"{name} {reason} it; --overwrite"):
            refused()
    assert (ours / name).read_text() == MINE
    claim_folder(ours, [name], overwrite=True)
    assert (ours / name).read_text() == MINE, "claiming alone writes nothing"
    write_json(ours / name, 4)
    next_run()
    claim_folder(ours, [name])


def test_a_folder_is_made_with_the_first_file_and_a_manifest(tmp_path):
    folder = claim_folder(tmp_path / "new" / "below", ["a.json"])
    assert not folder.exists()
    write_json(folder / "a.json", 1)
    assert {one.name for one in folder.iterdir()} == {"a.json", MANIFEST}
    write_whole(claim_file(tmp_path / "page.html"), b"1")  # in a folder of the user, none
    assert {one.name for one in tmp_path.iterdir()} == {"page.html", "new"}
    next_run()
    claim_folder(folder, ["a.json"])
    with pytest.raises(OutputError, match="--overwrite"):
        claim_file(tmp_path / "page.html")


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("place", ["/", tempfile.gettempdir(), "strangers"])
def test_a_folder_of_others_is_no_place_for_results(place, overwrite, tmp_path):
    (tmp_path / "strangers").mkdir()
    (tmp_path / "strangers" / "notes.txt").write_text(MINE)
    folder = tmp_path / place
    refused = rf"^{folder} has \S+, and SAIN did not make this folder; choose a new or an empty"
    with pytest.raises(OutputError, match=refused):
        claim_folder(folder, ["a.json"], overwrite)
    with pytest.raises(OutputError, match=r"SAIN did not make .*strangers"):
        remove(tmp_path / "strangers")
    assert [one.name for one in (tmp_path / "strangers").iterdir()] == ["notes.txt"]


def device(path: Path) -> None:
    """Make one like /dev/null; the real one is never touched."""
    if os.geteuid() != 0:
        pytest.skip("only root makes devices")
    os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 3))


SPECIAL: dict[str, Callable[[Path], object]] = {
    "a FIFO": os.mkfifo,
    "a device": device,
    "a folder": Path.mkdir,
    "a symbolic link": lambda path: path.symlink_to(path.parent / "victim"),
}


@pytest.mark.parametrize("kind", SPECIAL)
@pytest.mark.parametrize("overwrite", [False, True])
def test_devices_links_and_folders_are_never_replaced(kind, overwrite, tmp_path):
    (tmp_path / "victim").write_text(MINE)
    SPECIAL[kind](tmp_path / "x")
    before = (tmp_path / "x").lstat()
    for refused in (
        lambda: claim_file(tmp_path / "x", overwrite),
        lambda: claim_folder(tmp_path, ["x*"], overwrite),
        lambda: write_whole(tmp_path / "x", b"new"),
        lambda: append_json(tmp_path / "x", 1),
    ):
        with pytest.raises(OutputError, match=rf"x is {kind}, which is never replaced"):
            refused()
    after = (tmp_path / "x").lstat()
    assert (after.st_ino, after.st_mode) == (before.st_ino, before.st_mode)
    assert (tmp_path / "victim").read_text() == MINE


def test_what_is_no_folder_is_no_place_for_results(tmp_path):
    (tmp_path / "file").write_text(MINE)
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    os.mkfifo(tmp_path / "fifo")
    for name in ("file", "dangling", "fifo"):
        with pytest.raises(OutputError, match=f"{name} is not a folder; choose another"):
            claim_folder(tmp_path / name)
        with pytest.raises(OutputError, match=f"{name}"):
            claim_file(tmp_path / name / "results.json")
    assert not (tmp_path / "nowhere").exists()


def test_a_folder_of_ours_is_removed_whole(ours):
    (ours / ".a.json.77.partial").write_text("half")  # of a run that was killed
    sign(ours / "logs" / "*.log", grows=True)  # what child processes write
    (ours / "logs").mkdir()
    (ours / "logs" / "node.log").write_text("1")
    remove(ours)
    assert not ours.exists()
    remove(ours)  # nothing is there


@pytest.mark.parametrize(
    "name", ["notes.txt", "below/notes.txt", "a.json", "mine/notes.txt", "logs/x.txt"]
)
def test_a_folder_with_something_else_stays_whole(ours, name):
    sign(ours / "logs" / "*.log", grows=True)  # of all that child processes write there
    (ours / name).parent.mkdir(exist_ok=True)
    (ours / name).write_text(MINE)
    strange = "mine" if name == "mine/notes.txt" else name
    with pytest.raises(OutputError, match=rf"nothing is removed: SAIN did not .*{strange}"):
        remove(ours)
    assert (ours / name).read_text() == MINE
    assert (ours / "log.jsonl").exists() and (ours / "below" / "b.json").exists()


def test_links_are_not_followed_when_something_is_removed(ours, tmp_path):
    (tmp_path / "link").symlink_to(ours)
    for path in (tmp_path / "link", tmp_path / "link" / "a.json"):
        with pytest.raises(OutputError, match=r"link is a symbolic link; give the path without"):
            remove(path)
    (tmp_path / "victim").write_text(MINE)
    (ours / "to_victim").symlink_to(tmp_path / "victim")
    with pytest.raises(OutputError, match=r"nothing is removed: .*to_victim is a symbolic link"):
        remove(ours)
    assert (ours / "a.json").exists() and (tmp_path / "victim").read_text() == MINE


def test_a_manifest_that_is_a_link_is_not_followed(tmp_path):
    (tmp_path / "victim").write_text(MINE)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / MANIFEST).symlink_to(tmp_path / "victim")
    with pytest.raises(OutputError, match="is a symbolic link"):
        claim_folder(tmp_path / "out", ["a.json"])
    assert (tmp_path / "victim").read_text() == MINE
