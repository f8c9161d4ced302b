"""How large a message to a node may be: checked before anything is made of it.

One table for all topics, services and actions, by the names of fields. Bodies of an episode have
limits of their own (`sain_core.shapes.received`), and so has the work of a model (its parameters
``max_work`` and ``max_disks``).
"""

import re
from collections.abc import Sequence
from typing import Any, Final

from sain_core.errors import InvalidInputError, TooMuchWorkError
from sain_core.shapes.bodies import MOST_BODIES
from sain_core.shapes.polygon import MOST_CORNERS, MOST_PARTS
from sain_core.shapes.received import LONGEST_NAME

LONGEST_TEXT: Final = 256  # characters, of a frame, a source or the name of a world
LONGEST_PATH: Final = 4096  # as Linux has it
LONGEST_ERROR: Final = 4096  # characters
MOST_SUPPORTS: Final = 256  # of a body
MOST_NUMBERS: Final = 2**26  # of one array: half a gigabyte

TEXTS: Final = {
    "name": LONGEST_NAME,
    "role": LONGEST_NAME,
    "shapes": LONGEST_NAME,
    "roles": LONGEST_NAME,
    "model": LONGEST_PATH,
    "error_message": LONGEST_ERROR,
}
"""Characters of a text, or of each text of an array; all others: `LONGEST_TEXT`."""

COUNTS: Final = {
    "bodies": MOST_BODIES,
    "disks": MOST_BODIES,
    "shapes": 1024,  # what the parameter max_disks may be
    "roles": 1024,
    "poses": MOST_BODIES,
    "keep": MOST_BODIES,
    "parts": MOST_PARTS,
    "points": MOST_CORNERS,
    "supports": MOST_SUPPORTS,
    "dimensions": 3,
}
"""Elements of an array; all others: `MOST_NUMBERS`."""

VALUES: Final = {"samples": 2**20, "batch": 2**20, "horizon": 1024, "past": 200}
"""Dimensions that a request states: K, B, H and P."""

SEQUENCE: Final = re.compile(r"sequence<(.+?)(?:, \d+)?>")
NUMERIC: Final = re.compile(r"u?int\d+|float|double|boolean|octet|char")
TEXT: Final = re.compile(r"w?string.*")

_known: dict[type, list[tuple[str, str, str]]] = {}  # by class of message


def check_sizes(message: Any) -> None:
    """Check every text, array and stated dimension of a message, also of those within it.

    Raises:
        InvalidInputError: a text that is too long, or an array with too many elements.
        TooMuchWorkError: a dimension of a request that is too large.
    """
    for name, kind, element in _sized_fields(message):
        value = getattr(message, name)
        if kind == "value":
            _check_value(name, value)
        elif kind == "text":
            _check_text(name, value)
        elif kind == "message":
            check_sizes(value)
        else:
            _check_array(name, value, element)


def emptied(message: Any) -> Any:
    """Return a message with every text and array emptied that is too large, in place."""
    for name, kind, _ in _sized_fields(message):
        value = getattr(message, name)
        if kind == "message":
            emptied(value)
            continue
        try:
            if kind == "text":
                _check_text(name, value)
            elif kind != "value":
                _check_array(name, value, kind)
        except InvalidInputError:
            setattr(message, name, "" if kind == "text" else [])
    return message


def shortened(text: str) -> str:
    """Return an error's text, or the beginning of one that is too long and how long it was."""
    if len(text) <= LONGEST_ERROR:
        return text
    end = f" ... ({len(text)} characters)"
    return text[: LONGEST_ERROR - len(end)] + end


def _sized_fields(message: Any) -> Sequence[tuple[str, str, str]]:
    """Return name, kind and kind of the elements of the fields that have a size."""
    known = _known.get(type(message))
    if known is not None:
        return known
    found = _known[type(message)] = []
    for name, kind in message.get_fields_and_field_types().items():
        if match := SEQUENCE.fullmatch(kind):
            found.append((name, "array", _kind(match[1])))
        elif TEXT.fullmatch(kind):
            found.append((name, "text", ""))
        elif name in VALUES:
            found.append((name, "value", ""))
        elif _kind(kind) == "message":
            found.append((name, "message", ""))
    return found


def _kind(kind: str) -> str:
    if TEXT.fullmatch(kind):
        return "text"
    return "number" if NUMERIC.match(kind) else "message"


def _check_value(name: str, value: int) -> None:
    if value > VALUES[name]:
        raise TooMuchWorkError(f"{name} is {value}; at most {VALUES[name]} are accepted")


def _check_text(name: str, value: str) -> None:
    most = TEXTS.get(name, LONGEST_TEXT)
    if len(value) > most:
        raise InvalidInputError(f"{name} has {len(value)} characters; at most {most} are accepted")


def _check_array(name: str, values: Any, element: str) -> None:
    most = COUNTS.get(name, MOST_NUMBERS)
    if len(values) > most:
        raise InvalidInputError(f"{name} has {len(values)} elements; at most {most} are accepted")
    if element == "text":
        for value in values:
            _check_text(name, value)
    elif element == "message":
        for value in values:
            check_sizes(value)
