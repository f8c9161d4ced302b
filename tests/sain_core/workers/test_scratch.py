"""Temporary folders that end with their process, in whatever way it ends."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sain_core.workers import scratch

HOLD = (
    "from sain_core.workers.scratch import scratch_folder; import sys;"
    " held = scratch_folder('shape'); print(held.name, flush=True); sys.stdin.read()"
)
ENDS = {"at its end": True, "when it is killed": False}


def start(temporary: Path) -> tuple["subprocess.Popen[str]", Path]:
    """Return a process that holds a scratch folder, and that folder's process-wide parent."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD],
        env={**os.environ, "TMPDIR": str(temporary)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip()).parent


@pytest.mark.parametrize("how", ENDS)
def test_a_folder_goes_with_its_process(tmp_path: Path, how: str) -> None:
    process, folder = start(tmp_path)
    old = folder.stat().st_mtime - 2.0 * scratch.YOUNG
    os.utime(folder, (old, old))
    scratch._remove_abandoned(tmp_path)
    assert folder.is_dir(), "its process lives"
    if ENDS[how]:
        process.communicate("")
        assert not folder.exists()
    else:
        process.kill()
        process.wait()
        scratch._remove_abandoned(tmp_path)
        assert not folder.exists()


def test_a_folder_of_one_that_was_just_killed_stays_for_a_minute(tmp_path: Path) -> None:
    process, folder = start(tmp_path)
    process.kill()
    process.wait()
    scratch._remove_abandoned(tmp_path)
    assert folder.is_dir()


def test_a_folder_is_removed_with_the_object() -> None:
    folder = scratch.scratch_folder("shape")
    assert Path(folder.name).is_dir()
    folder.cleanup()
    assert not Path(folder.name).exists()
