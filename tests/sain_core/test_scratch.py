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


@pytest.mark.parametrize("killed", [False, True])
def test_a_folder_goes_with_its_process(tmp_path, killed):
    """Nothing else does that has such a name."""
    (tmp_path / "victim").mkdir()
    (tmp_path / f"{scratch.PREFIX}link").symlink_to(tmp_path / "victim")
    os.mkfifo(tmp_path / f"{scratch.PREFIX}fifo")
    process, folder = start(tmp_path)
    for one in tmp_path.iterdir():
        os.utime(one, (0.0, 0.0), follow_symlinks=False)
    scratch._remove_abandoned(tmp_path)
    assert folder.is_dir(), "its process lives"
    if killed:
        process.kill()
        process.wait()
        scratch._remove_abandoned(tmp_path)
    else:
        process.communicate("")
    assert not folder.exists()
    assert len([*tmp_path.iterdir()]) == 3


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
