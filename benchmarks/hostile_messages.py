"""Messages that no honest sender sends, made from the fields that a message class declares.

``./env python -m benchmarks.hostile_messages`` floods each topic, service and action of the three
nodes with them, and with text of 10 MB. The table has what was sent, what a node's callback was
called with, what was answered, what was accepted, and the node's memory before and after.

`hostile` is for other tests, too: it needs a valid message and the names of the fields of which one
wrong value must be refused.
"""

import re
import sys
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import tyro

FLOATS: Final = (float("nan"), float("inf"), float("-inf"), 1e308, -1e308)
TEXTS: Final = ("../../etc/passwd", "%s%n", "\x1b[31m\n", "☠" * 30, "x" * 65, "x" * 100_000)
LENGTHS: Final = (11, 100, 1000, 20_000)
CHANCES: Final = (0.4, 0.4, 0.17, 0.03)  # of the lengths: long ones take long to send
INTEGERS: Final = {f"uint{bits}": 2**bits - 1 for bits in (8, 16, 32, 64)} | {
    f"int{bits}": 2 ** (bits - 1) - 1 for bits in (8, 16, 32, 64)
}
SEQUENCE: Final = re.compile(r"sequence<(.+?)(?:, (\d+))?>")


def hostile(valid: Any, fatal: Sequence[str], random: np.random.Generator) -> Any:
    """Return a copy of a message with one of the fatal fields spoilt, and up to two others."""
    message = deepcopy(valid)
    kinds = message.get_fields_and_field_types()
    names = list(kinds)
    chosen = [str(random.choice(list(fatal)))] if fatal else []
    chosen += [str(name) for name in random.choice(names, random.integers(3))] if names else []
    for name in dict.fromkeys(chosen):
        if name not in fatal and name.endswith("_id"):
            continue  # of the push or goal that the answer names
        setattr(message, name, spoilt(getattr(message, name), kinds[name], random))
    return message


def spoilt(value: Any, kind: str, random: np.random.Generator) -> Any:
    """Return another value for a field of this type, which should be refused."""
    if found := SEQUENCE.fullmatch(kind):
        return _spoilt_sequence(list(value), found[1], random)[: int(found[2] or LENGTHS[-1])]
    if kind in ("double", "float"):
        return float(random.choice(FLOATS if kind == "double" else FLOATS[:3]))
    if kind == "boolean":
        return not value
    if kind.startswith("string"):
        return TEXTS[random.integers(len(TEXTS))]
    if kind in INTEGERS:
        return INTEGERS[kind]
    if hasattr(value, "get_fields_and_field_types"):
        inner = value.get_fields_and_field_types()
        name = str(random.choice(list(inner)))
        setattr(value, name, spoilt(getattr(value, name), inner[name], random))
    return value


def _spoilt_sequence(values: list[Any], kind: str, random: np.random.Generator) -> list[Any]:
    """Return a sequence with one spoilt element, or one that is much too long."""
    if values and random.uniform() < 0.5:
        place = int(random.integers(len(values)))
        values[place] = spoilt(deepcopy(values[place]), kind, random)
        return values
    if kind in INTEGERS or kind.startswith("string"):
        element: Any = INTEGERS.get(kind, "disk")
    else:
        element = 0.5 if kind in ("double", "float") else None
    if element is None:
        element = values[0] if values else _default(kind)
    return [element] * int(random.choice(LENGTHS, p=CHANCES))


def _default(kind: str) -> Any:
    package, name = kind.split("/")
    return getattr(__import__(f"{package}.msg", fromlist=[name]), name)()


@dataclass(frozen=True)
class Options:
    """How many messages are sent."""

    count: int = 10_000
    """to each topic, service and action"""
    texts: int = 10
    """of 10 MB, to each node"""
    nodes: tuple[str, ...] = ("sim_node", "model_node", "mppi_node")
    seed: int = 0
    """of the messages"""


def main() -> None:
    """Flood each node and print what became of it."""
    options = tyro.cli(Options, description=__doc__)
    from benchmarks.hostile_table import flood_all  # needs the middleware

    sys.exit(0 if flood_all(options.nodes, options.count, options.texts, options.seed) else 1)


if __name__ == "__main__":
    main()
