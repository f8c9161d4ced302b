"""Definitions of messages (``ros2msg``), read into the fields of each type.

What passes has a bounded size and depth, refers to nothing that refers back to it, and each of its
fields takes at least one byte of a message.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from sain_bags.bag.definitions import BUILT_IN, Definitions
from sain_core.errors import DatasetError, InvalidInputError
from sain_core.guarding.untrusted import (
    ARRAY_LENGTH,
    DEFINITION_BYTES,
    DEFINITION_DEPTH,
    DEFINITION_FIELDS,
    DEFINITION_LINE,
)

SCALAR: Final = -1  # in place of a count
SEQUENCE: Final = -2
OWN_TYPES: Final = "sain_interfaces/"
SECTION: Final = re.compile(r"={80,}\s*")
TITLE: Final = re.compile(r"MSG:\s*(\S+)\s*")
LINE: Final = re.compile(
    r"(?P<type>[A-Za-z]\w*(?:/[A-Za-z]\w*){0,2})(?:<=\d{1,9})?"
    r"(?P<array>\[(?P<most><=)?(?P<count>\d{0,9})\])?\s+(?P<name>[A-Za-z]\w*)\s*(?P<rest>.*)",
    re.DOTALL,
)
NAME: Final = re.compile(r"[A-Za-z]\w*/(?:msg|srv|action)/[A-Za-z]\w*")


@dataclass(frozen=True)
class Field:
    """One field of a message."""

    name: str
    type: str  # a built-in one, or a message's full name
    count: int  # of an array, or `SCALAR`, or `SEQUENCE`


NO_FIELD: Final = Field("structure_needs_at_least_one_member", "uint8", SCALAR)  # rosidl adds it
MessageTypes = dict[str, tuple[Field, ...]]  # by full name


@lru_cache(maxsize=16)
def read_types(name: str, text: str) -> MessageTypes:
    """Return the fields of a message type and of all that it refers to.

    Args:
        name: full, for example ``std_msgs/msg/Header``.
        text: its definition, followed by those of what it refers to (``ros2msg``).
    """
    where = f"the definition of {name[:100]}"
    if not NAME.fullmatch(name):
        raise DatasetError(f"{name[:100]!r} is not the name of a type: package/msg/Name")
    if len(text) > DEFINITION_BYTES:
        raise DatasetError(f"{where} has {len(text):,} characters; allowed: {DEFINITION_BYTES:,}")
    types: dict[str, list[Field]] = {}
    for number, (kind, field) in enumerate(_fields(name, text, where), start=1):
        if number > DEFINITION_FIELDS:
            raise DatasetError(f"{where} has more than {DEFINITION_FIELDS:,} fields")
        types.setdefault(kind, []).extend(filter(None, [field]))
    found = {kind: tuple(fields) or (NO_FIELD,) for kind, fields in types.items()}
    _check_depth(full_name(name), found, where)
    return found


@lru_cache(maxsize=64)
def check_version(name: str, text: str) -> None:
    """Check that a message of the graph has the fields of this version, and no others."""
    if not name.startswith(OWN_TYPES):
        return
    try:
        today = read_types(name, Definitions().joined(name))
    except InvalidInputError:  # it is not installed: nothing here reads it
        return
    recorded = read_types(name, text)
    for kind in today.keys() & recorded.keys():
        now, then = ({field.name for field in types[kind]} for types in (today, recorded))
        if kind.startswith(OWN_TYPES) and now != then:
            has = [f"no {name}" for name in sorted(now - then)] or sorted(then - now)
            raise DatasetError(
                f"{kind} has {', '.join(has)}: it is of another version of"
                f" {OWN_TYPES[:-1]} than the installed one; record it again"
            )


def full_name(name: str, package: str = "") -> str:
    """Return the name of a type as `MessageTypes` have it, also of one in this package."""
    package, _, rest = name.partition("/") if "/" in name else (package, "", name)
    return f"{package}/msg/{rest.rpartition('/')[2]}"


def _fields(name: str, text: str, where: str) -> Iterator[tuple[str, Field | None]]:
    """Yield each type as it begins, then its fields."""
    current, begun = full_name(name), False
    yield current, None
    for line in text.split("\n"):
        if SECTION.fullmatch(line):
            begun = True
        elif begun and (title := TITLE.fullmatch(line)):
            current, begun = full_name(title[1]), False
            yield current, None
        elif (content := line.strip()) and not content.startswith("#"):
            yield current, _field(content, current.partition("/")[0], where)


def _field(line: str, package: str, where: str) -> Field | None:
    """Return the field of a line; None: it is a constant."""
    found = LINE.fullmatch(line)
    if found is None:
        raise DatasetError(f"{where} has a line that is no field: {line[:60]!r}")
    if len(found["rest"].partition("#")[0]) > DEFINITION_LINE:
        raise DatasetError(f"{where} has a line of more than {DEFINITION_LINE:,} characters")
    if found["count"] and not 0 < int(found["count"]) <= ARRAY_LENGTH:
        raise DatasetError(
            f"{where} has an array of {int(found['count']):,} elements; allowed: 1 to"
            f" {ARRAY_LENGTH:,}"
        )
    if found["rest"].startswith("="):
        return None
    is_array = found["count"] and not found["most"]
    count = int(found["count"]) if is_array else SEQUENCE if found["array"] else SCALAR
    kind = found["type"]
    return Field(found["name"], kind if kind in BUILT_IN else full_name(kind, package), count)


def _check_depth(name: str, types: MessageTypes, where: str) -> None:
    depths: dict[str, int] = {}

    def depth(kind: str, path: tuple[str, ...]) -> int:
        if kind in path:
            raise DatasetError(f"{where} contains itself: {kind[:100]}")
        if len(path) + depths.get(kind, 1) > DEFINITION_DEPTH:
            raise DatasetError(f"{where} is nested more than {DEFINITION_DEPTH} deep")
        for field in types[kind] if kind not in depths else ():
            if field.type not in BUILT_IN and field.type not in types:
                raise DatasetError(f"{field.type}, of {field.name} in {kind}, is not described")
        if kind not in depths:
            inner = {field.type for field in types[kind]} - BUILT_IN
            depths[kind] = 1 + max((depth(one, (*path, kind)) for one in inner), default=0)
        return depths[kind]

    depth(name, ())
