"""Files that somebody else may have made: how much of them is read, and only regular ones.

An honest file is far below the limits. Above one of them a file is refused before it is read.
"""

import os
import re
import stat
import time
from collections.abc import Iterable
from contextlib import suppress
from io import BufferedReader
from pathlib import Path
from stat import S_IMODE, S_ISDIR
from typing import Final

from sain_core.errors import ConfigError, OutputError, UntrustedFileError

PARTIAL: Final = ".partial"  # suffix of what is not whole yet

MIB: Final = 1 << 20

# What is compressed: chunks of MCAP, files and messages of rosbag2, arrays of npz
FREE_BYTES: Final = 64 * MIB  # that any file may unpack to
RATIO: Final = 200  # and so many more for each byte of the file
PIECE_BYTES: Final = 128 * MIB  # of one chunk, record or message


# Bags
FREE_MESSAGES: Final = 500_000  # of any file
BYTES_A_MESSAGE: Final = 8  # of the file, for each more: its index alone has 16
SUMMARY_BYTES: Final = 64 * MIB
TOPICS: Final = 10_000
NAME_LENGTH: Final = 1_000  # characters of a topic or a type

# Definitions of messages (ros2msg), and messages that are decoded field by field
DEFINITION_BYTES: Final = MIB
DEFINITION_FIELDS: Final = 5_000
DEFINITION_DEPTH: Final = 32  # types inside each other
DEFINITION_LINE: Final = 4_000  # characters of a line without its comment
ARRAY_LENGTH: Final = 1_000_000  # that a definition fixes
DECODED_BYTES: Final = MIB
DECODING_SECONDS: Final = 3.0  # of processor time, for any file
DECODING_SECONDS_A_MIB: Final = 20.0  # and so much more for each MiB of the file

# Messages, and what they and data sets state of bodies
MOST_BODIES: Final = 32
LONGEST_NAME: Final = 64  # characters of a shape or a role
LONGEST_PATH: Final = 4096  # characters, as Linux has it
MOST_PARTS: Final = 24  # of one shape
MOST_CORNERS: Final = 64  # of one part
LEAST_RADIUS: Final = 0.001  # [m]
MOST_RADIUS: Final = 0.5  # [m]
TIP_RADII: Final = (0.001, 0.05)  # [m], of the tool

# Data sets
BODIES: Final = 100
LARGEST_NUMBER: Final = 1e6  # of a scene or an action, in SI units

# Weights of a network, and other files that are read whole
WHOLE_BYTES: Final = 256 * MIB


def unpacked_bytes(size: int) -> int:
    """Return how much a file of this size [bytes] may unpack to [bytes]."""
    return FREE_BYTES + RATIO * size


def most_messages(size: int) -> int:
    """Return how many messages a file of this size [bytes] may have."""
    return FREE_MESSAGES + size // BYTES_A_MESSAGE


def decoding_seconds(size: int) -> float:
    """Return the processor time for decoding what is in a file of this size [bytes]."""
    return DECODING_SECONDS + DECODING_SECONDS_A_MIB * size / MIB


def limit(what: str, count: int, allowed: int) -> None:
    """Raise `UntrustedFileError` where a file has more of something than is allowed."""
    if count > allowed:
        raise UntrustedFileError(f"it has more than {allowed:,} {what}")


def shown(value: object, most: int = 60) -> str:
    """Return a value of a file as an error shows it: on one line, its end cut off."""
    text = repr(value)
    return text if len(text) <= most else f"{text[:most]}..."


MOST_LISTED: Final = 20


def listed(names: Iterable[str]) -> str:
    """Return names as an error lists them: the first ones, and how many more there are."""
    names = list(names)
    more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    return ", ".join(shown(name)[1:-1] for name in names[:MOST_LISTED]) + more


def one_line(text: object, most: int = 800) -> str:
    """Return the text of an error on one line, its end cut off."""
    line = " ".join(str(text).split())
    return line if len(line) <= most else f"{line[:most]}..."


def check_ros_name(what: str, name: str) -> str:
    """Return a name of ROS that a user's file gives, or raise `ConfigError`."""
    if not ROS_NAME.fullmatch(name) or len(name) > LONGEST_ROS_NAME:
        raise ConfigError(
            f"{what} is {shown(name)}; a name in ROS has letters of a to z, digits and '_' in parts"
            f" that '/' divides and no digit begins, at most {LONGEST_ROS_NAME} characters"
        )
    return name


def check_frame(what: str, name: str) -> str:
    """Return the name of a frame on ``/tf``; raises `ConfigError` where tf2 allows none such."""
    if name.startswith("/") or any(sign.isspace() for sign in name):
        raise ConfigError(f"{what} is {shown(name)}; it must not have spaces or begin with '/'")
    return name


def user_path(text: str) -> Path:
    """Return the path that a user wrote; ``~name`` stays as it is where there is no such user."""
    return Path(os.path.expanduser(text))  # noqa: PTH111 - Path.expanduser raises RuntimeError


def reason_of(error: Exception) -> str:
    """Return why a file cannot be read, without its name."""
    return one_line(getattr(error, "strerror", None) or error)


ROS_NAME: Final = re.compile(r"(~/|/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
LONGEST_ROS_NAME: Final = 200  # characters; 255 with what ROS adds
KINDS: Final = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a FIFO",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


def open_regular(path: Path) -> BufferedReader:
    """Open a regular file for reading, without waiting; raises `UntrustedFileError`, `OSError`."""
    refuse_special(path.stat().st_mode)  # opening a device may have effects
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
    try:
        refuse_special(os.fstat(descriptor).st_mode)
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def refuse_special(mode: int) -> None:
    """Raise `UntrustedFileError` where a file's mode is not that of a regular file."""
    if not stat.S_ISREG(mode):
        kind = KINDS.get(stat.S_IFMT(mode), "something else")
        raise UntrustedFileError(f"it is {kind}; only regular files are read")


def is_file(path: Path) -> bool:
    """Return True if a path is a regular file, False if it is free; else raise `OutputError`."""
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return False
    kind = "a symbolic link" if stat.S_ISLNK(mode) else KINDS.get(stat.S_IFMT(mode))
    if kind:
        raise OutputError(f"{path} is {kind}, which is never replaced or removed; name a file")
    return True


UNPACK: Final = "is compressed as a whole; {} unpacks it"
STAND_INS: Final = {  # how files begin that no reader of a whole file takes, whatever their name
    b"version https://git-lfs": "is a pointer of Git LFS, not the file; `git lfs pull` fetches it",
    b"\x28\xb5\x2f\xfd": UNPACK.format("`zstd -d FILE`"),
    b"\x1f\x8b": UNPACK.format("`gunzip FILE`, or `tar xzf FILE`"),
    b"BZh": UNPACK.format("`bunzip2 FILE`"),
    b"\xfd7zXZ": UNPACK.format("`unxz FILE`"),
    b"\x04\x22\x4d\x18": UNPACK.format("`lz4 -d FILE`"),
    b"7z\xbc\xaf": "is a 7z archive; unpack it first",
    b"Rar!": "is a RAR archive; unpack it first",
}
WEB_PAGE: Final = "is a web page, as failed downloads leave one; download the file itself"
HEAD: Final = 512  # [bytes], that are looked at


def stand_in(content: bytes) -> str:
    """Return what a file is in place of its content, and what to do; empty: it is none."""
    found = (text for magic, text in STAND_INS.items() if content.startswith(magic))
    begin = content[:HEAD].lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    is_page = begin.startswith((b"<!doctype html", b"<html"))
    return next(found, WEB_PAGE if is_page else "")


def read_regular(path: Path, limit: int = WHOLE_BYTES) -> bytes:
    """Return the content of a regular file of up to so many bytes.

    Raises `UntrustedFileError`, also for a pointer of Git LFS, a compressed file and a web page;
    `OSError`: it cannot be read.
    """
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        content = b"" if size > limit else file.read(limit + 1)
    if max(size, len(content)) > limit:
        raise UntrustedFileError(f"it has {max(size, len(content)):,} bytes; allowed: {limit:,}")
    if text := stand_in(content):
        raise UntrustedFileError(f"it {text}")
    return content


UTF_16: Final = (b"\xff\xfe", b"\xfe\xff")  # how such a text begins


def read_regular_text(path: Path, limit: int = WHOLE_BYTES) -> str:
    """Return the text of a file; raises as `read_regular`, and where it is not UTF-8."""
    content = read_regular(path, limit)
    if content.startswith(UTF_16) or b"\0" in content:
        raise UntrustedFileError("it is not UTF-8, but UTF-16 or no text; save it as UTF-8")
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise UntrustedFileError(
            f"it is not UTF-8: line {line} has the byte {content[error.start]:#04x};"
            " save it as UTF-8"
        ) from error


class TimeAllowance:
    """Adds up the processor time that is spent inside it, as a context manager."""

    def __init__(self, size: int) -> None:
        """Begin for a file of this size [bytes]."""
        self._allowed = self._left = decoding_seconds(size)
        self._began = 0.0

    def __enter__(self) -> None:
        """Begin to count."""
        self._began = time.thread_time()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Count; raises `UntrustedFileError`: it was more than is allowed."""
        self._left -= time.thread_time() - self._began
        if self._left < 0.0 and kind is None:
            raise UntrustedFileError(
                f"decoding takes more than {self._allowed:.0f} s, too long for its size"
            )


def private_folder() -> Path:
    """Return a folder of this user on this computer, the same in all his processes.

    Nobody else can put anything there, whatever the environment and the temporary folder hold.
    """
    user = os.getuid()
    own = Path.home() / ".cache" / "sain" / "own"
    tried = [Path(f"/run/user/{user}"), Path(f"/tmp/sain-{user}"), own]
    for folder in tried:
        with suppress(OSError):
            if folder != tried[0]:
                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if _is_private(folder, user):
                return folder
    raise OutputError(
        f"none of {', '.join(map(str, tried))} is a folder that only user {user} can write;"
        " remove one, or let it be made"
    )


def _is_private(folder: Path, user: int) -> bool:
    """Tell whether nobody but a user (and root) can write to a folder, which is no link."""
    status = folder.lstat()
    ours = S_ISDIR(status.st_mode) and status.st_uid == user and not S_IMODE(status.st_mode) & 0o022
    return ours and os.access(folder, os.W_OK)
