"""No file imports itself by way of others: what `tools/circles.py` sees, and what it prints."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.paths import ROOT

TOOL = ROOT / "tools" / "circles.py"
AT_THE_TOP = "from planted.second import two\n"
IN_A_FUNCTION = "def one():\n    from planted.second import two\n    return two\n"
FOR_TYPES = f"from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    {AT_THE_TOP}"


def circles(folder: Path, **sources: str) -> subprocess.CompletedProcess[str]:
    package = folder / "planted"
    package.mkdir()
    for name, source in {"__init__": "", **sources}.items():
        (package / f"{name}.py").write_text(source)
    command = [sys.executable, TOOL, "planted"]
    return subprocess.run(
        command, cwd=folder, env={"PYTHONPATH": str(folder)}, capture_output=True, text=True
    )


@pytest.mark.parametrize(("first", "line"), [(AT_THE_TOP, 1), (IN_A_FUNCTION, 2)])
def test_a_circle_fails_and_its_files_are_named(tmp_path: Path, first: str, line: int) -> None:
    done = circles(
        tmp_path, first=first, second="from planted import third\n", third="import planted.first\n"
    )
    assert done.returncode == 1, done.stderr
    told = done.stdout.splitlines()
    folder = tmp_path / "planted"
    assert told[:4] == [
        "a circle between files:",
        f"  {folder / 'first.py'}:{line} imports planted.second",
        f"  {folder / 'second.py'}:1 imports planted.third",
        f"  {folder / 'third.py'}:1 imports planted.first",
    ]
    assert len(told) == 5 and "move what both need" in told[4]


def test_imports_for_types_alone_close_no_circle(tmp_path: Path) -> None:
    done = circles(tmp_path, first=FOR_TYPES, second="import planted.first\n")
    assert (done.returncode, done.stdout) == (0, "circles: none between 3 files\n"), done.stderr


def test_there_is_none_here() -> None:
    done = subprocess.run([sys.executable, TOOL], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
