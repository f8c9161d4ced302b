"""Temporary folders that end with their process, in whatever way it ends."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from sain_core import scratch
from sain_core.guarding import untrusted

HOLD = (
    "from sain_core.scratch import scratch_folder; import sys;"
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
    return process, Path(process.stdout.readline().strip()).parent


@pytest.mark.parametrize("how", ENDS)
def test_a_folder_goes_with_its_process(tmp_path, how):
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


@pytest.mark.parametrize("what", ["FIFO", "link", "file"])
def test_what_others_put_among_the_temporary_folders_is_ignored(tmp_path, what):
    planted, victim = tmp_path / f"{scratch.PREFIX}x", tmp_path / "victim"
    victim.mkdir()
    {
        "FIFO": lambda: os.mkfifo(planted),
        "link": lambda: planted.symlink_to(victim),
        "file": lambda: planted.write_text("x"),
    }[what]()
    os.utime(planted, (0.0, 0.0), follow_symlinks=False)
    process, folder = start(tmp_path)  # its first folder looks for abandoned ones
    assert folder.is_dir()
    assert planted.is_symlink() or planted.exists()
    assert victim.is_dir()
    process.communicate("")


def test_the_private_folder_is_nobody_elses(tmp_path, monkeypatch):
    folder = untrusted.private_folder()
    assert folder.stat().st_uid == os.getuid()
    assert not folder.stat().st_mode & 0o022
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    assert untrusted.private_folder() == folder, "the same in all processes"
    mine = tmp_path / "mine"
    mine.mkdir(mode=0o700)
    assert untrusted._is_private(mine, os.getuid())
    assert not untrusted._is_private(mine, os.getuid() + 1)
    (tmp_path / "link").symlink_to(mine)
    assert not untrusted._is_private(tmp_path / "link", os.getuid())
    mine.chmod(0o777)
    assert not untrusted._is_private(mine, os.getuid())
