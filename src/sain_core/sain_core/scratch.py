"""Folders for temporary files, which go with their process, and the user's cache folder."""

import atexit
import fcntl
import os
import shutil
import tempfile
import time
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Final

from sain_core.guarding.untrusted import private_folder

PREFIX: Final = "sain-scratch-"
MARK: Final = ".sain-scratch"  # a file in each folder that a process of ours made
YOUNG: Final = 60.0  # [s] in which a process may have made its folder and not locked it yet


def scratch_folder(purpose: str) -> "tempfile.TemporaryDirectory[str]":
    """Return a folder that is removed with the object, or else with the process.

    Where the process is killed, the next one of this user that needs a folder removes it.
    """
    return tempfile.TemporaryDirectory(
        prefix=f"{purpose}-", dir=_root(), ignore_cleanup_errors=True
    )


@cache
def cache_folder() -> Path:
    """Return the user's cache folder, or a temporary one where that cannot be written."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "sain"
    try:
        home.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=home):
            return home
    except OSError:
        return private_folder()


@cache
def _root() -> Path:
    """The folder of this process, which is locked while the process or a fork of it lives."""
    _remove_abandoned(Path(tempfile.gettempdir()))
    root = Path(tempfile.mkdtemp(prefix=PREFIX))
    (root / MARK).touch()
    fcntl.flock(os.open(root, os.O_RDONLY), fcntl.LOCK_SH)
    atexit.register(_remove, root, os.getpid())
    return root


def _remove(root: Path, owner: int) -> None:
    if os.getpid() == owner:  # a fork ends before the process whose folder it is
        shutil.rmtree(root, ignore_errors=True)


def _remove_abandoned(place: Path) -> None:
    for folder in place.glob(f"{PREFIX}*"):
        with suppress(OSError):  # another user's, still locked, or just removed by another process
            is_young = time.time() - folder.lstat().st_mtime < YOUNG
            if is_young or not (folder / MARK).is_file():
                continue
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(lock)
