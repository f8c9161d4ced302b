"""The fields of message types, from the text that a bag describes them with (``ros2msg``).

Format: https://mcap.dev/spec/registry, and https://docs.ros.org/en/jazzy/Concepts/Basic/About-Interfaces.html.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from sain_bags.bag.definitions import SEPARATOR
from sain_core.errors import DatasetError

NUMBERS: Final = {  # as numpy has them; their size is also what CDR aligns them to
    "bool": "u1",
    "byte": "u1",
    "char": "u1",
    **{f"int{8 * size}": f"i{size}" for size in (1, 2, 4, 8)},
    **{f"uint{8 * size}": f"u{size}" for size in (1, 2, 4, 8)},
    "float32": "f4",
    "float64": "f8",
}
TEXT: Final = "string"
SCALAR: Final = -1  # in place of a count
SEQUENCE: Final = -2

LINE: Final = re.compile(
    r"(?P<type>[A-Za-z][\w/]*)(<=\d+)?"
    r"(?P<array>\[(?P<bound><=)?(?P<count>\d*)\])?"
    r"\s+(?P<name>[A-Za-z]\w*)\s*(?P<constant>=)?"
)


@dataclass(frozen=True)
class Field:
    """One field of a message."""

    name: str
    type: str  # a key of `NUMBERS`, `TEXT`, or a message's full name
    count: int  # of an array, or `SCALAR`, or `SEQUENCE`


MessageTypes = dict[str, tuple[Field, ...]]  # by full name


def read_types(name: str, text: str) -> MessageTypes:
    """Return the fields of a message type and of all that it refers to.

    Args:
        name: full, for example ``std_msgs/msg/Header``.
        text: its definition, followed by those of what it refers to.

    Raises:
        DatasetError: a line that is no field, or a type that is not described.
    """
    types: MessageTypes = {}
    for part in re.split(rf"^{SEPARATOR}=*\s*$", text, flags=re.MULTILINE):
        first, _, rest = part.strip().partition("\n")
        if first.startswith("MSG:"):
            full, content = _full_name(first.removeprefix("MSG:").strip(), ""), rest
        else:
            full, content = name, part
        types[full] = tuple(_fields(full, content))
    for full, fields in types.items():
        for field in fields:
            if field.type not in NUMBERS and field.type != TEXT and field.type not in types:
                raise DatasetError(f"{field.type}, of {field.name} in {full}, is not described")
    return types


def _fields(full: str, text: str) -> Iterator[Field]:
    found = False
    for line in text.splitlines():
        words = line.split("#", 1)[0].strip()
        if not words:
            continue
        match = LINE.match(words)
        if match is None:
            raise DatasetError(f"{words!r} is no field of a message; it is in {full}")
        if match["constant"]:
            continue
        found = True
        count = SCALAR if match["array"] is None else SEQUENCE
        if match["count"] and not match["bound"]:
            count = int(match["count"])
        yield Field(match["name"], _full_name(match["type"], full), count)
    if not found:
        yield Field("structure_needs_at_least_one_member", "uint8", SCALAR)  # rosidl adds it


def _full_name(name: str, owner: str) -> str:
    if name in NUMBERS or name in (TEXT, "wstring"):
        return name
    package, _, short = name.rpartition("/")
    package = package.removesuffix("/msg") or owner.partition("/")[0]
    return f"{package}/msg/{short}"
