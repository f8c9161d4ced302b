"""Files that are whole or not there: arrays as compressed npz, and how damage is told.

A shard is a zip archive: every array in it has a CRC-32, which is checked as it is read, and
nothing in it is ever unpickled. What zlib and the zip format raise when bits have flipped is many
things; here all of them become one `DatasetError` that names the file.
"""

import atexit
import contextlib
import fcntl
import json
import os
import platform
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from io import BytesIO
from math import prod
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
from numpy import ndarray

from sain_core.errors import DatasetError, OutputError, UntrustedFileError
from sain_core.guarding.kinds import describe
from sain_core.guarding.untrusted import (
    PARTIAL,
    limit,
    open_regular,
    private_folder,
    unpacked_bytes,
)

ZIP_MAGIC: Final = b"PK\x03\x04"
ZIP_END: Final = b"PK\x05\x06"  # begins the last record, which may have a comment
ZIP_COUNT: Final = 10  # from there to the number of entries, two bytes
ZIP_TAIL: Final = 22 + 65535  # the most bytes from there to the end
NPY_HEADERS: Final = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
DAMAGE: Final = (
    OSError,
    ValueError,
    EOFError,
    KeyError,
    OverflowError,
    NotImplementedError,  # a compression method that does not exist
    RuntimeError,  # "encrypted"
    MemoryError,
    SyntaxError,  # numpy's own header
    tokenize.TokenError,  # likewise
    RecursionError,
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
)


def read_arrays(path: Path) -> dict[str, ndarray]:
    """Read every array of an npz file.

    Raises:
        DatasetError: it does not exist, is truncated, or a bit of it has flipped.
    """
    try:
        with open_regular(path) as file:
            if file.read(len(ZIP_MAGIC)) != ZIP_MAGIC:  # numpy would take it for a pickle
                why = describe(path) or "does not begin as one"
                raise DatasetError(f"{path} is not a whole .npz file: it {why}")
            entries = _entries(file)
            file.seek(0)
            with np.load(file, allow_pickle=False) as archive:
                if len(archive.files) != entries:
                    raise DatasetError(f"{path} is not a whole .npz file: an array has got lost")
                _check_sizes(archive.zip, file)
                return {name: archive[name] for name in archive.files}
    except FileNotFoundError:
        raise DatasetError(f"{path} does not exist") from None
    except UntrustedFileError as error:
        raise DatasetError(f"{path} is not read: {error}") from error
    except DAMAGE as error:
        raise DatasetError(f"{path} is not a whole .npz file: {error}") from error


def _check_sizes(archive: zipfile.ZipFile, file: IO[bytes]) -> None:
    """Check that arrays are not larger than they may be, nor than what is stored of them."""
    size = file.seek(0, os.SEEK_END)
    infos = archive.infolist()
    limit("bytes in its arrays", sum(info.file_size for info in infos), unpacked_bytes(size))
    for info in infos:
        with archive.open(info) as member:
            read_header = NPY_HEADERS[np.lib.format.read_magic(member)]
            shape, _, dtype = read_header(member)
            if not 0 <= prod(shape) * max(dtype.itemsize, 1) <= info.file_size:
                raise UntrustedFileError(f"an array of shape {shape} is larger than its file")


def _entries(file: IO[bytes]) -> int:
    """Return how many files the end of a zip archive says are in it.

    Python's `zipfile` does not look: where the length of an entry's comment is damaged, it takes
    the entries after it for the comment.
    """
    size = file.seek(0, os.SEEK_END)
    file.seek(max(size - ZIP_TAIL, 0))
    tail = file.read()
    place = tail.rfind(ZIP_END)
    return int(struct.unpack_from("<H", tail, place + ZIP_COUNT)[0]) if place >= 0 else -1


def write_arrays(path: Path, arrays: Mapping[str, ndarray], deflate_numbers: bool = True) -> None:
    """Write arrays as an npz file: whole, or not at all.

    Args:
        path: of the file.
        arrays: by name.
        deflate_numbers: compress all; else only texts, which repeat themselves: many times faster.

    Raises:
        OutputError: the folder cannot be written, or the disk is full.
    """
    whole = BytesIO()  # a zip archive goes back and forth, which is slow in a file
    with zipfile.ZipFile(whole, "w", compresslevel=1) as archive:
        for name, array in arrays.items():
            deflate = deflate_numbers or array.dtype.kind == "U"
            archive.compression = zipfile.ZIP_DEFLATED if deflate else zipfile.ZIP_STORED
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)
    write_file(path, lambda file: file.write(whole.getbuffer()))


def append_json(path: Path, content: Any) -> None:
    """Append a line of JSON to a file; raises `OutputError`."""
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(content) + "\n")
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error


def make_folder(folder: Path) -> Path:
    """Return the folder of a command's results, made if need be, once a file was written there.

    Raises:
        OutputError: it is a file, cannot be made or cannot be written, or the disk is full.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(os.urandom(1 << 16))
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"cannot write to {folder}: {reason}; choose another --out") from error
    return folder


def write_json(path: Path, content: Any) -> Path:
    """Write what JSON can hold, as `write_whole` does."""
    return write_whole(path, (json.dumps(content, indent=2) + "\n").encode())


def write_whole(path: Path, content: bytes) -> Path:
    """Write a file: whole, or not at all; return its path; raises `OutputError`."""
    write_file(path, lambda file: file.write(content))
    return path


def remove_partial(folder: Path, name: str) -> None:
    """Remove what a killed `write_file` left of files of a name, or of a pattern of names.

    Raises:
        OSError: the folder cannot be written.
    """
    for path in folder.glob(f".{name}.[0-9]*{PARTIAL}"):
        path.unlink()


def write_file(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Let write fill a file of a temporary name, and rename it when it is safe on the disk.

    What was at the path before stays whole until then.

    Raises:
        OutputError: the folder cannot be made or written, or the disk is full.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error


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


UNKNOWN: Final = "unknown"


def provenance(package: str) -> dict[str, str]:
    """Return what a recording states about how it was made, and by which version of a package."""
    return {
        "command": command(),
        "commit": git_commit(),
        "version": _version(package),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
    }


def command() -> str:
    """Return the command line of this process, without the folder of the program."""
    return shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])


def ros2_command(package: str, executable: str) -> str:
    """Return the command line that starts this process again, by way of `ros2 run`."""
    return shlex.join(["ros2", "run", package, executable, *sys.argv[1:]])


def git_commit() -> str:
    """Return the commit of this source tree, "-dirty" added when files differ from it.

    "unknown" outside a repository, or without git.
    """
    commit = _git("rev-parse", "HEAD")
    if commit is None:
        return UNKNOWN
    return f"{commit}-dirty" if _git("status", "--porcelain", "-uno") else commit


def versions(*packages: str) -> dict[str, str]:
    """Return the version of Python and of packages; "unknown" for one that is not installed."""
    return {"python": platform.python_version(), **{name: _version(name) for name in packages}}


def system() -> str:
    """Return the operating system, its release and the machine's architecture."""
    return f"{platform.system()} {platform.release()} {platform.machine()}"


def processor() -> str:
    """Return the processor's model and the number of cores."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    name = names[0] if names else platform.processor() or UNKNOWN
    return f"{name}, {os.cpu_count()} cores"


def _git(*arguments: str) -> str | None:
    folder = str(Path(__file__).resolve().parent)
    try:
        done = subprocess.run(
            ["git", "-C", folder, *arguments],
            capture_output=True,
            text=True,
            timeout=5.0,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return UNKNOWN
