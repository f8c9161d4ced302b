"""Writes messages as CDR, by their definition: the counterpart of `sain_bags.bag.layouts`."""

import struct
from typing import Any, Final

from sain_bags.bag.layouts import HEADER, NUMBERS, SCALAR, SEQUENCE, TEXT, MessageTypes

LITTLE: Final = b"\0\1\0\0"  # the encapsulation header of CDR version 1, little endian
CODES: Final = {
    name: {"u1": "B", "u2": "H", "u4": "I", "u8": "Q", "i1": "b", "i2": "h", "i4": "i",
           "i8": "q", "f4": "f", "f8": "d"}[kind]
    for name, kind in NUMBERS.items()
}  # fmt: skip


def write_cdr(types: MessageTypes, name: str, message: Any) -> bytes:
    """Return a message, which has its definition's fields as attributes.

    Raises:
        AttributeError: it lacks a field.
        struct.error: a number does not fit its field.
    """
    written = bytearray(LITTLE)
    _message(written, types, name, message)
    return bytes(written)


def _message(written: bytearray, types: MessageTypes, name: str, message: Any) -> None:
    for field in types[name]:
        found = getattr(message, field.name)
        if field.count == SEQUENCE:
            _number(written, "I", len(found))
        for value in (found,) if field.count == SCALAR else found:
            if field.type in NUMBERS:
                _number(written, CODES[field.type], value)
            elif field.type == TEXT:
                text = value.encode() + b"\0"
                _number(written, "I", len(text))
                written += text
            else:
                _message(written, types, field.type, value)


def _number(written: bytearray, code: str, value: float) -> None:
    size = struct.calcsize(code)
    written += bytes((HEADER - len(written)) % size)
    written += struct.pack(f"<{code}", value)
