"""Files that somebody else may have made: how much of them is read, and only regular ones.

An honest file is far below the limits. Above one of them a file is refused before it is read.
"""

import json
import os
import re
import stat
import time
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from io import BufferedReader
from itertools import islice
from math import isinf
from pathlib import Path
from stat import S_IMODE, S_ISDIR
from types import TracebackType
from typing import Any, Final

import yaml

from sain_core.errors import ConfigError, OutputError, UntrustedFileError

PARTIAL: Final = ".partial"  # suffix of what is not whole yet

MIB: Final = 1 << 20

# Documents: JSON and YAML
JSON_BYTES: Final = 64 * MIB
YAML_BYTES: Final = 2 * MIB
DEPTH: Final = 64  # lists and objects inside each other
JSON_ITEMS: Final = 4_000_000  # values, lists and objects
YAML_EVENTS: Final = 200_000
DIGITS: Final = 100  # of one number

# What is compressed: chunks of MCAP, files and messages of rosbag2, arrays of npz
FREE_BYTES: Final = 64 * MIB  # that any file may unpack to
RATIO: Final = 200  # and so many more for each byte of the file
PIECE_BYTES: Final = 128 * MIB  # of one chunk, record or message

PIECE_RECORDS: Final = 5_000_000  # the smallest messages of a piece are 4.3 million

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
MOST_PARTS: Final = 12  # of one shape
MOST_CORNERS: Final = 64  # of one part
LEAST_RADIUS: Final = 0.001  # [m]
MOST_RADIUS: Final = 0.5  # [m]

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


def too_deep() -> UntrustedFileError:
    """Return the error about a document that is nested too deep."""
    return UntrustedFileError(f"it is nested more than {DEPTH} deep")


def too_long(number: str) -> UntrustedFileError:
    """Return the error about a number with too many digits."""
    return UntrustedFileError(f"a number has {len(number):,} digits; allowed: {DIGITS}")


def shown(value: object, most: int = 60) -> str:
    """Return a value of a file as an error shows it: on one line, its end cut off."""
    text = repr(value)
    return text if len(text) <= most else f"{text[:most]}..."


def listed(names: Iterable[str], most: int = 20) -> str:
    """Return names as an error lists them: the first ones, and how many more there are."""
    names = list(names)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(shown(name)[1:-1] for name in names[:most]) + more


def one_line(text: object, most: int = 800) -> str:
    """Return the text of an error on one line, its end cut off."""
    line = " ".join(str(text).split())
    return line if len(line) <= most else f"{line[:most]}..."


def check_ros_name(what: str, name: str) -> str:
    """Return a name of a topic, a service or an action that a user's file gives.

    Raises:
        ConfigError: ROS does not allow it.
    """
    if not ROS_NAME.fullmatch(name) or len(name) > LONGEST_ROS_NAME:
        raise ConfigError(
            f"{what} is {shown(name)}; a name in ROS has letters of a to z, digits and '_' in parts"
            f" that '/' divides and no digit begins, at most {LONGEST_ROS_NAME} characters"
        )
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
    """Open a file for reading; nothing is waited for.

    Raises:
        UntrustedFileError: it is no regular file.
        OSError: it does not exist, or may not be read.
    """
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
        raise OutputError(f"{path} is {kind}, which is never replaced; name a file")
    return True


def read_regular(path: Path, limit: int = WHOLE_BYTES) -> bytes:
    """Return the content of a file.

    Raises:
        UntrustedFileError: it is no regular file, or larger than the limit [bytes].
        OSError: it does not exist, or cannot be read.
    """
    with open_regular(path) as file:
        size = os.fstat(file.fileno()).st_size
        content = b"" if size > limit else file.read(limit + 1)
    if max(size, len(content)) > limit:
        raise UntrustedFileError(f"it has {max(size, len(content)):,} bytes; allowed: {limit:,}")
    return content


def read_regular_text(path: Path, limit: int = WHOLE_BYTES) -> str:
    """Return the text of a file; raises as `read_regular`, and where it is not UTF-8."""
    content = read_regular(path, limit)
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise UntrustedFileError(
            f"it is not UTF-8: line {line} has the byte {content[error.start]:#04x};"
            " save it as UTF-8"
        ) from error


SURROGATE: Final = re.compile(r"\\u[dD][89a-fA-F]")


def read_json(path: Path) -> Any:
    """Return the content of a JSON file; raises as `parse_json` and `read_regular`."""
    return parse_json(read_regular_text(path, JSON_BYTES))


def parse_json(text: str) -> Any:
    """Return the content of a JSON text.

    Raises:
        UntrustedFileError: it is no JSON, or exceeds a limit.
    """
    limit("bytes", len(text), JSON_BYTES)
    limit("values", sum(text.count(sign) for sign in ",[{"), JSON_ITEMS)
    text = text.removeprefix("\ufeff")  # some editors begin a file with it
    try:
        content = json.loads(
            text, parse_int=_integer, parse_float=_number, object_pairs_hook=_object
        )
    except RecursionError:
        raise too_deep() from None
    except _TwiceError as error:
        raise UntrustedFileError(error.text(text)) from None
    except UntrustedFileError:
        raise
    except ValueError as error:
        raise UntrustedFileError(str(error)) from error
    _limit_depth(content)
    if SURROGATE.search(text):
        _refuse_half_characters(content)
    return content


class _TwiceError(Exception):
    """A key of a JSON object that is given twice; json does not say where."""

    def text(self, text: str) -> str:
        """Return the error, with the lines of a document that have such a key."""
        (key,) = self.args
        found = re.finditer(re.escape(json.dumps(key, ensure_ascii=False)) + r"\s*:", text)
        lines = [str(text.count("\n", 0, one.start()) + 1) for one in islice(found, 9)]
        where = f" (lines with it: {', '.join(dict.fromkeys(lines))})" if lines else ""
        return f"the key {shown(key)} is given twice{where}; remove one"


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) != len(pairs):
        raise _TwiceError(Counter(key for key, _ in pairs).most_common(1)[0][0])
    return content


def _integer(digits: str) -> int:
    if len(digits) > DIGITS:
        raise too_long(digits)
    return int(digits)


def _number(digits: str) -> float:
    number = float(digits)
    if isinf(number):
        raise UntrustedFileError(f"the number {digits[:DIGITS]} is too large for a double")
    return number


def _limit_depth(content: Any) -> None:
    level = [content]
    for _ in range(DEPTH):
        level = [
            value
            for item in level
            if isinstance(item, dict | list)
            for value in (item.values() if isinstance(item, dict) else item)
            if isinstance(value, dict | list)
        ]
        if not level:
            return
    raise too_deep()


def _refuse_half_characters(content: Any) -> None:
    try:
        json.dumps(content, ensure_ascii=False).encode()
    except UnicodeEncodeError as error:
        raise UntrustedFileError("a text is no Unicode: it has half a character") from error


TAG: Final = "tag:yaml.org,2002:"
NUMBERS: Final = {  # as in YAML 1.2 and JSON: 1e0 is a number, 010 is ten, 1:30 and 1_000 are none
    f"{TAG}int": r"[-+]?[0-9]+|0x[0-9a-fA-F]+",
    f"{TAG}float": r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
    r"|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN|Nan)",
}
OPENCV: Final = "%YAML:1.0", f"{TAG}opencv-matrix"  # how OpenCV begins a file, and tags a matrix
LOADER: Final[Any] = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
DUMPER: Final[Any] = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # ten times as fast


class _Loader(LOADER):
    """Reads numbers as YAML 1.2 does, and refuses a key that is given twice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> Any:
        size = len(node.value)
        mapping = super().construct_mapping(node, deep=deep)
        if len(mapping) == size == len(node.value):
            return mapping
        seen = set[Any]()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                line = key_node.start_mark.line + 1
                raise UntrustedFileError(
                    f"line {line}: the key {shown(key)} is given twice; remove one"
                )
            seen.add(key)
        raise UntrustedFileError("it has a merge key (<<); it is not read")

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        return int(node.value, 16 if node.value.startswith("0x") else 10)


class _Dumper(DUMPER):
    """Quotes a text that `_Loader` would take for a number."""


for _kind in (_Loader, _Dumper):
    _kind.yaml_implicit_resolvers = {
        first: [one for one in pairs if one[0] not in NUMBERS]
        for first, pairs in LOADER.yaml_implicit_resolvers.items()
    }
    for _tag, _pattern in NUMBERS.items():
        _kind.add_implicit_resolver(_tag, re.compile(f"({_pattern})$"), list("-+.0123456789"))
_Loader.add_constructor(f"{TAG}int", _Loader.construct_yaml_int)
_Loader.add_constructor(OPENCV[1], _Loader.construct_yaml_map)


def dump_yaml(content: Any) -> str:
    """Return the YAML text of a content that `parse_yaml` reads as it was."""
    return str(yaml.dump(content, Dumper=_Dumper, sort_keys=False))


def read_yaml(path: Path) -> Any:
    """Return the content of a YAML file; raises as `parse_yaml` and `read_regular`."""
    return parse_yaml(read_regular_text(path, YAML_BYTES))


def read_user_yaml(path: Path, what: str, known: str = "") -> dict[Any, Any]:
    """Return the content of a YAML file that a user gives.

    Args:
        path: of the file.
        what: the file is called in errors.
        known: added where it cannot be read: what could be given in its place.

    Raises:
        ConfigError: naming the file and what is wrong; its content is no mapping.
    """
    try:
        content = read_yaml(path)
    except UntrustedFileError as error:
        raise ConfigError(f"{what} {path} is not read: {error}") from error
    except (OSError, ValueError) as error:  # the second: a zero byte in the path
        raise ConfigError(f"{what} {path}: {reason_of(error)}{known}") from error
    if not isinstance(content, dict):
        found = "it is empty" if content is None else f"it has {shown(content)}"
        raise ConfigError(f"{what} {path} is not read: {found}; it must have keys and values")
    return content


def parse_yaml(text: str) -> Any:
    """Return the content of a YAML text.

    Raises:
        UntrustedFileError: it is no YAML, has anchors, aliases or tags, or exceeds a limit.
    """
    limit("bytes", len(text), YAML_BYTES)
    if text.startswith(OPENCV[0]):
        text = f"#{text}"  # a comment: its version is wrong
    try:
        _check_events(text)
        return yaml.load(text, _Loader)  # it is a safe one
    except UntrustedFileError:
        raise
    except yaml.MarkedYAMLError as error:
        mark, problem = (
            error.problem_mark or error.context_mark,
            str(error.problem or error.context),
        )
        if problem.startswith("but "):
            problem = f"{error.context} {problem}"
        line = "" if mark is None else f"line {mark.line + 1}, column {mark.column + 1}: "
        hint = "; indent with spaces, no tabs" if "\t" in text else ""
        raise UntrustedFileError(one_line(f"{line}{problem}{hint}")) from error
    except yaml.YAMLError as error:
        raise UntrustedFileError(one_line(error)) from error
    except RecursionError:
        raise too_deep() from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise UntrustedFileError(f"a value cannot be read ({error})") from error


def _check_events(text: str) -> None:
    depth = 0
    for count, event in enumerate(yaml.parse(text, LOADER), 1):
        limit("values", count, YAML_EVENTS)
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            line = _line_of(event)
            raise UntrustedFileError(
                f"it has an anchor or an alias in line {line}; neither is read"
            )
        if (tag := getattr(event, "tag", None)) not in (None, "!", OPENCV[1]):
            line = _line_of(event)
            raise UntrustedFileError(
                f"it has the tag {shown(tag)} in line {line}; tags are not read"
            )
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > DEPTH:
                raise too_deep()
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        elif isinstance(event, yaml.ScalarEvent) and _is_long_number(event):
            raise too_long(event.value)


def _line_of(event: yaml.Event) -> int:
    return event.start_mark.line + 1 if event.start_mark else 0


def _is_long_number(event: yaml.ScalarEvent) -> bool:
    is_plain = event.implicit[0]
    if len(event.value) <= DIGITS or not is_plain:
        return False
    return any(re.fullmatch(pattern, event.value) for pattern in NUMBERS.values())


class TimeAllowance:
    """Adds up the processor time that is spent inside it, as a context manager."""

    def __init__(self, size: int) -> None:
        """Begin for a file of this size [bytes]."""
        self._allowed = self._left = decoding_seconds(size)
        self._began = 0.0

    def __enter__(self) -> None:
        """Begin to count."""
        self._began = time.thread_time()

    def __exit__(
        self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None
    ) -> None:
        """Count; raises `UntrustedFileError`: it was more than is allowed."""
        self._left -= time.thread_time() - self._began
        if self._left < 0.0 and kind is None:
            raise UntrustedFileError(
                f"decoding takes more than {self._allowed:.0f} s, too long for its size"
            )


def private_folder() -> Path:
    """Return a folder of this user on this computer, the same in all his processes.

    Nobody else can put anything there, whatever the environment and the temporary folder hold.

    Raises:
        OutputError: there is none, and none can be made.
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
