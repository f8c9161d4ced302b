"""JSON of a limited size and depth."""

import json
import re
from math import isinf
from pathlib import Path
from typing import Any, Final

from sain_core.errors import UntrustedFileError
from sain_core.untrusted.files import read_regular_text
from sain_core.untrusted.limits import (
    DEPTH,
    DIGITS,
    JSON_BYTES,
    JSON_ITEMS,
    limit,
    too_deep,
    too_long,
)

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
    try:
        content = json.loads(text, parse_int=_integer, parse_float=_number)
    except RecursionError:
        raise too_deep() from None
    except UntrustedFileError:
        raise
    except ValueError as error:
        raise UntrustedFileError(str(error)) from error
    _limit_depth(content)
    if SURROGATE.search(text):
        _refuse_half_characters(content)
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
