"""Definitions of messages, looked at before anything parses them.

What passes has a bounded size and depth, refers to nothing that refers back to it, and each of its
fields takes at least one byte of a message.
"""

import re
from functools import lru_cache
from typing import Final

from sain_bags.bag.definitions import BUILT_IN, Definitions
from sain_bags.bag.layouts import read_types
from sain_core.errors import DatasetError, InvalidInputError
from sain_core.guarding.untrusted import (
    ARRAY_LENGTH,
    DEFINITION_BYTES,
    DEFINITION_DEPTH,
    DEFINITION_FIELDS,
    DEFINITION_LINE,
)

OWN_TYPES: Final = "sain_interfaces/"
SECTION: Final = re.compile(r"={80,}\s*")
TITLE: Final = re.compile(r"MSG:\s*(\S+)\s*")
LINE: Final = re.compile(
    r"(?P<type>[A-Za-z]\w*(?:/[A-Za-z]\w*){0,2})(?:<=\d{1,9})?"
    r"(?P<array>\[(?:<=)?(?P<count>\d{0,9})\])?\s+[A-Za-z]\w*\s*(?P<rest>.*)",
    re.DOTALL,
)
NAME: Final = re.compile(r"[A-Za-z]\w*/(?:msg|srv|action)/[A-Za-z]\w*")

References = dict[str, set[str]]  # the types that a type refers to, all by their short names


def check_definition(name: str, text: str) -> None:
    """Check the definition of a type, with those of all it refers to."""
    where = f"the definition of {name[:100]}"
    if not NAME.fullmatch(name):
        raise DatasetError(f"{name[:100]!r} is not the name of a type: package/msg/Name")
    if len(text) > DEFINITION_BYTES:
        raise DatasetError(f"{where} has {len(text):,} characters; allowed: {DEFINITION_BYTES:,}")
    references: References = {}
    current, fields, begun = _short(name), 0, False
    for line in text.split("\n"):
        if SECTION.fullmatch(line):
            begun = True
        elif begun and (title := TITLE.fullmatch(line)):
            current, begun = _short(title[1]), False
        elif content := _content(line):
            fields += 1
            if fields > DEFINITION_FIELDS:
                raise DatasetError(f"{where} has more than {DEFINITION_FIELDS:,} fields")
            kind = _type_of(content, where)
            if kind not in BUILT_IN:
                package = current.partition("/")[0]
                found = kind if "/" in kind else f"{package}/{kind}"
                references.setdefault(current, set()).add(_short(found))
    _check_depth(_short(name), references, where)


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


def _content(line: str) -> str:
    """Return a line without what can only be a comment."""
    content = line.strip()
    return "" if content.startswith("#") else content


def _type_of(line: str, where: str) -> str:
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
    return found["type"]


def _short(name: str) -> str:
    """Return package and name of a type, without what is between."""
    package, _, rest = name.partition("/")
    return f"{package}/{rest.rpartition('/')[2]}"


def _check_depth(name: str, references: References, where: str) -> None:
    depths: dict[str, int] = {}

    def depth(kind: str, path: tuple[str, ...]) -> int:
        if kind in path:
            raise DatasetError(f"{where} contains itself: {kind[:100]}")
        if len(path) + depths.get(kind, 1) > DEFINITION_DEPTH:
            raise DatasetError(f"{where} is nested more than {DEFINITION_DEPTH} deep")
        if kind not in depths:
            inner = [depth(other, (*path, kind)) for other in references.get(kind, ())]
            depths[kind] = 1 + max(inner, default=0)
        return depths[kind]

    depth(name, ())
