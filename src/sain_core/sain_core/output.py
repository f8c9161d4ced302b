"""What commands write: nothing that is not ours is replaced or removed.

A folder that SAIN writes to has a manifest, ``.sain-files``. It names each file that SAIN wrote
there or below with its SHA-256, as ``sha256sum`` does; or, with the word ``grows``, a file or a
pattern of files that grow or that a child process writes. The nearest manifest above a file counts.
A file that is named, and was not changed since, is ours: it may be replaced and removed. All else
needs ``--overwrite`` to be replaced, and is never removed.

A command calls `claim_folder` or `claim_file` at its start, with all names that it will write. So
it is refused before the work, not after it. Folders are made with the first file in them.
"""

import hashlib
import json
import os
import re
import stat
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from fnmatch import fnmatchcase as fnmatch
from pathlib import Path
from typing import IO, Any, Final

from sain_core.errors import OutputError
from sain_core.guarding.untrusted import PARTIAL, is_file, read_regular

MANIFEST: Final = ".sain-files"
HEADER: Final = b"# What SAIN wrote here. Files that are not named, or were changed, it leaves.\n"
GROWS: Final = "grows"  # in place of a hash
LINE: Final = re.compile(rf"^([0-9a-f]{{64}}|{GROWS})  (.+)$", re.MULTILINE)
LEFT_OVER: Final = re.compile(rf"\..+\.\d+{re.escape(PARTIAL)}")  # by a killed `write_file`
PROBE_BYTES: Final = 1 << 16
OTHER: Final = "; choose another"
OVERWRITE_HELP: Final = "replace what others wrote there, or a run with other settings"

_ours: Final[dict[Path, str]] = {}  # hashes of what this process wrote; `GROWS`: it may overwrite
_claimed: Final[set[Path]] = set()  # folders that get a manifest with the first file


def claim_folder(folder: Path, names: Iterable[str] = (), overwrite: bool = False) -> Path:
    """Check that files can be written to a folder, which need not exist; return its path.

    The names of the files to come are below the folder, or patterns. Raises `OutputError`: it is no
    folder, holds other files and SAIN did not make it, or cannot be written; a name is taken by a
    file of others (which `overwrite` allows), a folder, a link or a device; the disk is full.
    """
    names = tuple(names)
    with _no_os_error(folder, "write to", OTHER):
        place = _nearest_folder(folder)
        for name in names:
            for path in [folder / name, *folder.glob(name)]:
                _claim(path, overwrite)
        if place == folder and not _is_our_folder(folder):
            _refuse_others(folder, names)
        _probe(place)
        for name in names:
            for path in folder.glob(f".{name}.[0-9]*{PARTIAL}"):
                remove(path.parent.resolve() / path.name)
    _claimed.add(folder.absolute())
    return folder


def _refuse_others(folder: Path, names: Iterable[str]) -> None:
    for entry in sorted(one.name for one in folder.iterdir()):
        if not LEFT_OVER.fullmatch(entry) and not any(fnmatch(entry, name) for name in names):
            raise OutputError(
                f"{folder} has {entry}, and SAIN did not make this folder;"
                " choose a new or an empty one"
            )


def make_folder(folder: Path) -> None:
    """Make a folder that only SAIN writes to, such as a cache, at once; raises `OutputError`."""
    _claimed.add(folder.absolute())
    with _no_os_error(folder):
        _make_folder(folder)
        _append(folder / MANIFEST)


def claim_file(path: Path, overwrite: bool = False) -> Path:
    """Check that a file can be written; its folder need not exist. Raises as `claim_folder`."""
    with _no_os_error(path, advice=OTHER):
        _claim(path, overwrite)
        _probe(_nearest_folder(path.parent))
    return path


def check_new(folder: Path) -> None:
    """Check that nothing is where a folder is to be made; raises `OutputError`."""
    if os.path.lexists(folder):
        raise OutputError(f"{folder} exists; a bag is never overwritten, choose another --out")


def write_file(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Let write fill a file of a temporary name, and rename it when it is safe on the disk.

    What was at the path before stays whole until then. Raises `OutputError`: it is not ours, the
    folder cannot be written, or the disk is full.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    with _no_os_error(path):
        _claim(path)
        _make_folder(path.parent)
        partial.unlink(missing_ok=True)
        try:
            with partial.open("xb") as file:
                write(file)
                file.flush()
                os.fsync(file.fileno())
            _sign(path, _digest(partial))  # first, so that a kill leaves no file without its line
            is_file(path)
            partial.replace(path)
        finally:
            with suppress(OSError):
                partial.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes) -> Path:
    """Write a file, as `write_file` does; return its path."""
    write_file(path, lambda file: file.write(content))
    return path


def write_json(path: Path, content: Any) -> Path:
    """Write what JSON can hold, as `write_file` does; return its path."""
    return write_whole(path, (json.dumps(content, indent=2) + "\n").encode())


def append_json(path: Path, content: Any) -> None:
    """Append a line of JSON to a file; raises `OutputError`."""
    with _no_os_error(path):
        _claim(path)
        _sign(path, GROWS)
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW
        with os.fdopen(os.open(path, flags, 0o666), "a", encoding="utf-8") as file:
            file.write(json.dumps(content) + "\n")


def sign(path: Path, grows: bool = False) -> None:
    """Name a file of ours, which another library writes, in the nearest manifest above.

    Of one that `grows` the content does not count, and its name may be a pattern.
    """
    with _no_os_error(path):
        _sign(path, GROWS if grows else _digest(path))


def _sign(path: Path, digest: str) -> None:
    _ours[path.absolute()] = digest
    manifest, name = _manifest_of(path)
    if manifest is not None and digest not in _signatures(path):
        _make_folder(manifest.parent)
        _append(manifest, f"{digest}  {name}\n")


def is_ours(path: Path) -> bool:
    """Return True if SAIN wrote this regular file and it was not changed since."""
    signed = {*_signatures(path), _ours.get(path.absolute(), "")}
    if GROWS in signed or LEFT_OVER.fullmatch(path.name):
        return True
    return signed != {""} and _digest(path) in signed


def remove(path: Path) -> None:
    """Remove a file of ours, or a folder with a manifest in which all is ours, if it exists.

    Raises `OutputError`: a link leads there, or it is or holds something that SAIN did not write;
    then nothing is removed.
    """
    with _no_os_error(path, "remove"):
        _check_no_link(path)
        if os.path.lexists(path):
            for one in [*_removable(path)]:
                one.rmdir() if one.is_dir() else one.unlink()
                _ours.pop(one.absolute(), None)


def _removable(path: Path) -> Iterator[Path]:
    """Yield all that is removed with a path, in that order; raises `OutputError`."""
    mode = path.lstat().st_mode
    if not stat.S_ISDIR(mode):
        if not stat.S_ISREG(mode):
            kind = "a symbolic link" if stat.S_ISLNK(mode) else "no regular file"
            raise OutputError(f"nothing is removed: {path} is {kind}; remove it yourself")
        if path.name != MANIFEST and not is_ours(path):
            raise OutputError(
                f"nothing is removed: SAIN did not write {path}, or it was changed since;"
                " move it elsewhere, or remove it yourself"
            )
    elif not _is_our_folder(path):
        raise OutputError(
            f"nothing is removed: SAIN did not make {path}, no {MANIFEST} names it;"
            " move it elsewhere, or remove it yourself"
        )
    else:
        entries = sorted(path.iterdir(), key=lambda one: one.name == MANIFEST)  # that last
        for entry in entries:
            yield from _removable(entry)
    yield path


def _check_no_link(path: Path) -> None:
    whole = path.absolute()
    for one in [*reversed(whole.parents), whole]:
        if one.is_symlink():
            raise OutputError(
                f"{path} is not removed: {one} is a symbolic link; give the path without links"
            )


def _claim(path: Path, overwrite: bool = False) -> None:
    """Check that a path is free, or a regular file that may be replaced."""
    if not is_file(path):
        return
    if overwrite:
        _ours[path.absolute()] = GROWS
    elif not is_ours(path):
        reason = "exists, and no list of SAIN names it"
        if _signatures(path):
            reason = "was changed since SAIN wrote it"
        raise OutputError(f"{path} {reason}; --overwrite replaces it, or choose another --out")


def _is_folder(path: Path) -> bool:
    """Return True if a path is a folder, False if it is free; else raise `OutputError`."""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    if not path.is_dir():
        raise OutputError(f"{path} is not a folder; choose another")
    return True


def _nearest_folder(path: Path) -> Path:
    """Return a folder; or the one above it that exists, in which it can be made."""
    return path if _is_folder(path) else _nearest_folder(path.parent)


def _make_folder(folder: Path) -> None:
    """Make a folder, and those above it that are missing, each with a manifest."""
    if _is_folder(folder):
        return
    _make_folder(folder.parent)
    folder.mkdir(exist_ok=True)
    _append(folder / MANIFEST)


def _probe(folder: Path) -> None:
    with tempfile.TemporaryFile(dir=folder) as probe:
        probe.write(os.urandom(PROBE_BYTES))


def _append(manifest: Path, line: str = "") -> None:
    is_file(manifest)
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
    with os.fdopen(os.open(manifest, flags, 0o666), "ab") as file:
        file.write(line.encode() if file.tell() else HEADER + line.encode())


def _manifest_of(path: Path) -> tuple[Path | None, str]:
    """Return the nearest manifest above a path, and how it names the path."""
    whole = path.absolute()
    for folder in whole.parents:
        if is_file(folder / MANIFEST) or folder in _claimed:
            return folder / MANIFEST, whole.relative_to(folder).as_posix()
    return None, ""


def _signatures(path: Path) -> set[str]:
    """Return the hashes, or `GROWS`, with which the nearest manifest names a file."""
    manifest, name = _manifest_of(path)
    lines = _lines(manifest) if manifest else ()
    return {
        digest for digest, one in lines if one == name or (digest == GROWS and fnmatch(name, one))
    }


def _is_our_folder(path: Path) -> bool:
    """Return True if a folder has a manifest, or the nearest one above names something in it."""
    if is_file(path / MANIFEST):
        return True
    manifest, name = _manifest_of(path)
    return manifest is not None and any(
        one.startswith(f"{name}/") or (digest == GROWS and fnmatch(name, one))
        for digest, one in _lines(manifest)
    )


def _lines(manifest: Path) -> list[tuple[str, str]]:
    if not manifest.exists():  # its folder is claimed, and nothing was written yet
        return []
    return LINE.findall(read_regular(manifest).decode(errors="replace"))


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@contextmanager
def _no_os_error(path: Path, verb: str = "write", advice: str = "") -> Iterator[None]:
    try:
        yield
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot {verb} {path}: {error.strerror or error}{advice}") from error
