"""Definitions that would take a parser, or a decoder, forever are refused before."""

import pytest

from sain_bags.bag.definitions import SEPARATOR
from sain_bags.bag.message_types import read_types
from sain_core.errors import DatasetError

NAME = "a/msg/T"


def chain(depth: int) -> str:
    parts = ["a/T0 x"]
    for level in range(depth):
        inner = f"a/T{level + 1} x" if level + 1 < depth else "uint8 x"
        parts.append(f"{SEPARATOR}\nMSG: a/T{level}\n{inner}")
    return "\n".join(parts)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a/msg/T again", "contains itself: a/msg/T"),
        (f"U u\n{SEPARATOR}\nMSG: a/U\nT[] back", "contains itself"),
        (chain(40), "nested more than 32 deep"),
        ("uint8 x\n" * 5001, "more than 5,000 fields"),
        ("# " + "x" * (1 << 20), "1,048,578 characters; allowed"),
        ("uint8[0] x", "array of 0 elements; allowed: 1 to"),
        ("uint8[4000000] x", "array of 4,000,000 elements"),
        ("uint8[99999999999999999999] x", "a line that is no field"),
        ("int8[] x [" + "1," * 3000 + "1]", "a line of more than 4,000 characters"),
        ("\x00\x01", "a line that is no field"),
    ],
)
def test_what_is_refused(text: str, reason: str) -> None:
    with pytest.raises(DatasetError, match=reason):
        read_types(NAME, text)


def test_what_is_allowed() -> None:
    read_types(NAME, chain(31))
    read_types(NAME, f"U a\nU b\nV c\n{SEPARATOR}\nMSG: a/U\nV v\n{SEPARATOR}\nMSG: a/V\n")
    read_types(
        NAME, "string<=9[<=4] names\nstring S='#'  # a constant\nuint8 N = 3\n\nfloat64[2] xy\r\n"
    )
