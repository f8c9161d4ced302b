"""`| head` ends a command, and is no failure of it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sain_core.cli.program import main

PRINTS = """
from dataclasses import dataclass
import sys
from sain_core.cli.command_line import Command
from sain_core.config import Config

@dataclass(frozen=True)
class Options(Config):
    '''Print.'''

def rich(options: Options, console):
    for line in range(100_000):
        console.print(f"line {line}")

def plain(options: Options, console):
    for line in range(100_000):
        sys.stdout.write(f"line {line}\\n")

def another_pipe(options: Options, console):
    import os
    gone, pipe = os.pipe()
    os.close(gone)
    os.write(pipe, b"nobody reads this")

sys.modules["printing.file"] = sys.modules["printing"] = sys.modules["__main__"]
"""


@pytest.mark.parametrize(
    ("work", "code"), [("rich", 0), ("plain", 0), ("plain --help", 0), ("another_pipe", 1)]
)
def test_who_reads_no_further_ends_the_command_without_an_error(work: str, code: int) -> None:
    name, *arguments = work.split()
    text = f"{PRINTS}\nrun = {name}\nsys.exit(Command('printing x', 'file')())"
    reader, writer = os.pipe()
    process = subprocess.Popen(
        [sys.executable, "-c", text, *arguments], stdout=writer, stderr=subprocess.PIPE, text=True
    )
    os.close(writer)
    if name != "another_pipe" and not arguments:
        assert os.read(reader, 6) == b"line 0"
        os.close(reader)
    elif arguments:
        os.close(reader)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == code, errors
    assert errors == "" or (code and "BrokenPipeError" in errors)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("print", "--out", ""), "print: --out is ''; give a file or a folder"),
        (("print", "--out="), "print: --out is ''; give a file or a folder"),
        (("real_import", "a.csv", "--out", "x", "--shapes", ""), "real_import: --shapes is ''"),
        (("train", "", "--out", "x"), "train: a path is ''; give a file or a folder"),
    ],
)
def test_an_empty_path_is_not_the_folder_that_the_user_is_in(
    arguments: tuple[str, ...],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*arguments]) == 2
    assert capsys.readouterr().err.startswith(said)
    assert not [*tmp_path.iterdir()]


def test_the_home_folder_is_no_folder_called_tilde(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(["print", "--tags", "1", "--out=~/tags.pdf"]) == 0  # the shell leaves it as it is
    assert (tmp_path / "tags.pdf").exists()
    assert not [*(tmp_path / "here").iterdir()]
