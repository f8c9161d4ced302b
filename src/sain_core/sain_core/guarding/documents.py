"""JSON and YAML that somebody else may have made: what of them is read, and how much."""

import json
import re
from collections import Counter
from math import isinf
from pathlib import Path
from typing import Any, Final

import yaml

from sain_core.errors import ConfigError, UntrustedFileError
from sain_core.guarding.untrusted import MIB, limit, one_line, read_regular_text, reason_of, shown

JSON_BYTES: Final = 64 * MIB
YAML_BYTES: Final = 2 * MIB
DEPTH: Final = 64  # lists and objects inside each other
JSON_ITEMS: Final = 4_000_000  # values, lists and objects
YAML_EVENTS: Final = 200_000
DIGITS: Final = 100  # of one whole number of YAML
TOO_DEEP: Final = f"it is nested more than {DEPTH} deep"
SURROGATE: Final = re.compile(r"\\u[dD][89a-fA-F]")


def read_json(path: Path) -> Any:
    """Return the content of a JSON file; raises as `parse_json` and `read_regular`."""
    return parse_json(read_regular_text(path, JSON_BYTES))


def parse_json(text: str) -> Any:
    """Return the content of a JSON text; raises `UntrustedFileError`: none, or beyond a limit."""
    limit("bytes", len(text), JSON_BYTES)
    limit("values", sum(text.count(sign) for sign in ",[{"), JSON_ITEMS)
    text = text.removeprefix("\ufeff")  # some editors begin a file with it
    try:
        content = json.loads(
            text, parse_int=_integer, parse_float=_number, object_pairs_hook=_object
        )
    except RecursionError:
        raise UntrustedFileError(TOO_DEEP) from None
    except UntrustedFileError:
        raise
    except ValueError as error:
        raise UntrustedFileError(str(error)) from error
    _limit_depth(content)
    if SURROGATE.search(text):
        _refuse_half_characters(content)
    return content


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) != len(pairs):
        key = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise UntrustedFileError(f"the key {shown(key)} is given twice; remove one")
    return content


def _integer(digits: str) -> int:
    return int(digits) if _number(digits) else 0


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
    raise UntrustedFileError(TOO_DEEP)


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
OPENCV: Final = "%YAML", f"{TAG}opencv-matrix"  # how OpenCV begins a file, and tags a matrix
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
                where = f"line {key_node.start_mark.line + 1}"
                raise UntrustedFileError(
                    f"{where}: the key {shown(key)} is given twice; remove one"
                )
            seen.add(key)
        raise UntrustedFileError("it has a merge key (<<); it is not read")

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        if len(node.value) > DIGITS:
            raise ValueError(f"it has {len(node.value):,} digits; allowed: {DIGITS}")
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

    Raises `ConfigError`, which names the file as `what`, and the problem. Where the file cannot be
    read, `known` follows: what could be given in its place.
    """
    try:
        content = read_yaml(path)
    except UntrustedFileError as error:
        raise ConfigError(f"{what} {path} is not read: {error}") from error
    except (OSError, ValueError) as error:  # the second: a zero byte in the path
        raise ConfigError(f"{what} {path}: {reason_of(error)}{known}") from error
    if not isinstance(content, dict):
        found = "it is empty" if content is None else f"it has {shown(content)}"
        if isinstance(content, str) and content.startswith("<"):
            found = "it is XML (a URDF goes under the key `urdf` of a robot file)"
        raise ConfigError(f"{what} {path} is not read: {found}; it must have keys and values")
    return content


def parse_yaml(text: str) -> Any:
    """Return the content of a YAML text without anchors, aliases and tags.

    Raises `UntrustedFileError`: it has one, is no YAML, or exceeds a limit.
    """
    limit("bytes", len(text), YAML_BYTES)
    if text.startswith(OPENCV[0]):
        text = f"#{text}"  # a comment: the version is wrong, and of every version we read the same
    try:
        _check_events(text)
        return yaml.load(text, _Loader)  # it is a safe one
    except UntrustedFileError:
        raise
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        problem = str(error.problem or error.context)
        if problem.startswith("but "):
            problem = f"{error.context} {problem}"
        line = "" if mark is None else f"line {mark.line + 1}, column {mark.column + 1}: "
        hint = "; indent with spaces, no tabs" if "\t" in text else ""
        raise UntrustedFileError(one_line(f"{line}{problem}{hint}")) from error
    except yaml.YAMLError as error:
        raise UntrustedFileError(one_line(error)) from error
    except RecursionError:
        raise UntrustedFileError(TOO_DEEP) from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise UntrustedFileError(f"a value cannot be read ({error})") from error


def _check_events(text: str) -> None:
    depth = 0
    for count, event in enumerate(yaml.parse(text, LOADER), 1):
        limit("values", count, YAML_EVENTS)
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            where = f"in line {_line_of(event)}"
            raise UntrustedFileError(f"it has an anchor or an alias {where}; neither is read")
        if (tag := getattr(event, "tag", None)) not in (None, "!", OPENCV[1]):
            where = f"in line {_line_of(event)}"
            raise UntrustedFileError(f"it has the tag {shown(tag)} {where}; tags are not read")
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > DEPTH:
                raise UntrustedFileError(TOO_DEEP)
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1


def _line_of(event: yaml.Event) -> int:
    return event.start_mark.line + 1 if event.start_mark else 0
