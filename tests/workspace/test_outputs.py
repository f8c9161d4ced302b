"""No command that writes replaces what is not ours, and each says so before its work."""

import os
import stat
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Final

import pytest

from sain_core import output
from sain_core.cli.command_line import Command
from sain_core.cli.program import find_commands
from sain_core.config import MOST_SEED, Config
from sain_core.errors import OutputError

NEW_ONLY: Final = (
    "sain_bags record",
    "sain_bags recover",
    "sain_bags from_dataset",
)  # a folder that must not exist
NEEDED: Final[dict[str, tuple[str, ...]]] = {  # positional arguments of each command
    "sain_bags record": (),
    "sain_bags from_dataset": ("nowhere",),
    "sain_bags recover": ("nowhere",),
    "sain_bags report": ("nowhere",),
    "sain_bags to_dataset": ("nowhere",),
    "sain_bringup closed_loop": (),
    "sain_eval evaluate": (),
    "sain_eval results": ("nowhere",),
    "sain_eval verify": (),
    "sain_lab lab": ("replay", "nowhere"),
    "sain_model evaluate": ("nowhere",),
    "sain_model identify": ("nowhere",),
    "sain_model real_import": ("nowhere",),
    "sain_model train": ("nowhere",),
    "sain_sim collect": (),
    "sain_vision calibrate_camera": (),
    "sain_vision new_shape": ("a_new_shape",),
    "sain_vision print": (),
}
COMMANDS: Final = {
    command.name: command
    for command in find_commands().values()
    if isinstance(command, Command) and "out" in {item.name for item in fields(command.options())}
}
MINE: Final = "the only copy"


def refusal(name: str, out: Path, capsys: pytest.CaptureFixture[str], *more: str) -> str:
    """Run a command that must refuse its --out; return the one line that it prints."""
    code = COMMANDS[name]([*NEEDED[name], "--out", str(out), *more])
    said = capsys.readouterr().err.strip()
    assert code == 1, said
    assert len(said.splitlines()) == 1, said
    return said


def test_every_command_that_writes_is_here():
    assert sorted(COMMANDS) == sorted(NEEDED)


@pytest.mark.parametrize("name", COMMANDS)
def test_overwrite_is_an_option_where_something_may_be_replaced(name):
    options = {item.name for item in fields(COMMANDS[name].options())}
    assert ("overwrite" in options) == (name not in NEW_ONLY)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_file_of_the_user_at_out_is_refused_before_the_work(name, tmp_path, capsys):
    (tmp_path / "mine").write_text(MINE)
    said = refusal(name, tmp_path / "mine", capsys)
    assert "mine exists" in said or "mine is not a folder; choose another" in said
    assert (tmp_path / "mine").read_text() == MINE
    assert [one.name for one in tmp_path.iterdir()] == ["mine"]


def null(path: Path) -> None:
    """Make a device like /dev/null."""
    if os.geteuid() != 0:
        pytest.skip("only root makes devices")
    os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 3))


SPECIAL: Final[dict[str, Callable[[Path], object]]] = {
    "FIFO": os.mkfifo,
    "device": null,
    "link to a file": lambda path: path.symlink_to(path.parent / "victim"),
    "link to nothing": lambda path: path.symlink_to(path.parent / "nowhere"),
}


@pytest.mark.parametrize("kind", SPECIAL)
@pytest.mark.parametrize("name", COMMANDS)
def test_links_and_devices_stay_what_they_are(name, kind, tmp_path, capsys):
    (tmp_path / "victim").write_text(MINE)
    SPECIAL[kind](tmp_path / "out")
    before = (tmp_path / "out").lstat()
    refusal(name, tmp_path / "out", capsys, *(() if name in NEW_ONLY else ("--overwrite",)))
    after = (tmp_path / "out").lstat()
    assert (after.st_ino, after.st_mode) == (before.st_ino, before.st_mode)
    assert (tmp_path / "victim").read_text() == MINE


@pytest.mark.parametrize("name", sorted({*COMMANDS} - {*NEW_ONLY}))
def test_files_of_the_user_in_the_folder_are_refused_before_the_work(
    name, tmp_path, capsys, monkeypatch
):
    """Each file that the command claims is in the way once."""
    out, claim = tmp_path / "out", output._claim
    claimed: list[Path] = []

    def note(path: Path, overwrite: bool = False) -> None:
        claimed.append(path)
        claim(path, overwrite)

    def stop_after_names(folder: Path) -> None:
        raise OutputError("stopped before the work")

    with monkeypatch.context() as patch:
        patch.setattr(output, "_claim", note)
        patch.setattr(output, "_probe", stop_after_names)
        out.mkdir()
        COMMANDS[name]([*NEEDED[name], "--out", str(out)])
    capsys.readouterr()
    inside = [path for path in claimed if path.parent == out]
    for path in inside:
        path.write_text(MINE)
        said = refusal(name, out, capsys)
        assert f"{path} exists, and no list of SAIN names it; --overwrite" in said or (
            name == "sain_bringup closed_loop" and path.name in said
        )
        assert path.read_text() == MINE
        path.unlink()
    assert inside or claimed or name in ("sain_bringup closed_loop", "sain_bags to_dataset")


@pytest.mark.parametrize("name", COMMANDS)
def test_a_folder_of_the_user_is_refused_before_the_work(name, tmp_path, capsys):
    (tmp_path / "notes.txt").write_text(MINE)
    refusal(name, tmp_path, capsys, *(() if name in NEW_ONLY else ("--overwrite",)))
    assert [one.name for one in tmp_path.iterdir()] == ["notes.txt"]


@pytest.mark.parametrize("name", [name for name in COMMANDS if "nowhere" in NEEDED[name]])
def test_a_command_that_is_refused_makes_no_folder(name, tmp_path):
    """What it should read is missing."""
    COMMANDS[name]([*NEEDED[name], "--out", str(tmp_path / "below" / "out")])
    assert [*tmp_path.iterdir()] == []


def configs(kind: type[Config] = Config) -> "list[type[Config]]":
    """Return all classes of settings that are imported."""
    return [kind, *(one for child in kind.__subclasses__() for one in configs(child))]


def test_every_seed_has_an_upper_limit():
    for command in find_commands().values():
        if isinstance(command, Command):
            command.options()  # imports it
    seeds = [
        (kind.__name__, item.metadata.get("maximum"))
        for kind in configs()
        if kind.__module__.startswith("sain_")  # another test may have imported an example's
        for item in fields(kind)
        if item.name.endswith("seed")
    ]
    assert len(seeds) > 10
    assert [one for one in seeds if one[1] != MOST_SEED] == []


@pytest.mark.parametrize("seed", ["1000000000000000000000000000000", "2147483648", "-1"])
def test_a_seed_out_of_range_is_one_clear_line(seed, tmp_path, capsys):
    code = COMMANDS["sain_sim collect"](["--out", str(tmp_path / "out"), "--seed", seed])
    said = capsys.readouterr().err.strip()
    assert code == 2
    limit = "at least 0" if seed == "-1" else "at most 2147483647"
    assert said == f"collect: --seed is {seed}; it must be {limit}"
    assert not (tmp_path / "out").exists()
