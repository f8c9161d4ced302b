"""Texts and values that are hostile, as YAML or JSON."""

import json
import math
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

Random = np.random.Generator
LARGEST: Final = (1 << 64) - 1

BOMB: Final = "\n".join(
    [
        "a0: &a0 [x, x, x, x, x, x, x, x, x, x]",
        *(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 9)),
    ]
)
DEEP: Final = "[" * 5000 + "]" * 5000
DEEP_BLOCK: Final = "\n".join(f"{' ' * n}a:" for n in range(1500))
DIGITS: Final = "9" * 10_000
VALUES: Final[Mapping[str, Any]] = {
    "null": None, "list": [], "object": {}, "text": "\x1b[31m" + "x" * 5000, "nan": math.nan,
    "inf": math.inf, "huge": 10**90, "negative": -1, "many": 10**9, "zero": 0, "true": True,
    "deep": json.loads("[" * 60 + "]" * 60),
}  # fmt: skip


def documents(set_text: Callable[[str], Any]) -> dict[str, Any]:
    """Return what puts a hostile text somewhere, by the name of its family."""
    return {
        "aliases": set_text(BOMB),
        "deep": set_text(DEEP),
        "deep blocks": set_text(DEEP_BLOCK),
        "digits": set_text(DIGITS),
        "hexadecimal": set_text("0x" + DIGITS),
        "base 60": set_text("1" + ":59" * 5000),
        "not UTF-8": set_text("\udcff\udcfe"),
        "empty": set_text(""),
    }


def change_values(about: Any, random: Random) -> None:
    """Put hostile values in the place of some, anywhere in a document."""
    places: list[tuple[Any, Any]] = []
    waiting = [about]
    while waiting:
        item = waiting.pop()
        for key in list(item) if isinstance(item, dict) else range(len(item)):
            places.append((item, key))
            if isinstance(item[key], dict | list):
                waiting.append(item[key])
    names = sorted(VALUES)
    for _ in range(int(random.integers(1, 4))):
        item, key = places[int(random.integers(len(places)))]
        item[key] = VALUES[names[int(random.integers(len(names)))]]


def mutate(content: bytes, random: Random) -> bytes:
    """Return a content with one to eight random changes."""
    changed = bytearray(content)
    for _ in range(int(random.integers(1, 9))):
        place = int(random.integers(len(changed) + 1))
        size = int(random.integers(1, 64))
        kind = int(random.integers(5))
        if kind == 0:
            del changed[place:]
            changed += b"\0"
        elif kind == 1:
            changed[place : place + size] = random.bytes(size)
        elif kind == 2:
            changed[place : place + 8] = LARGEST.to_bytes(8, "little")
        elif kind == 3:
            changed[place:place] = random.bytes(size)
        else:
            del changed[place : place + size]
    return bytes(changed)
