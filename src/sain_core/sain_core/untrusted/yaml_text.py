"""YAML of a limited size and depth, without anchors, aliases and tags."""

from pathlib import Path
from typing import Any, Final

import yaml

from sain_core.errors import UntrustedFileError
from sain_core.untrusted.files import read_regular_text
from sain_core.untrusted.limits import (
    DEPTH,
    DIGITS,
    YAML_BYTES,
    YAML_EVENTS,
    limit,
    too_deep,
    too_long,
)

NUMBERS: Final = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
LOADER: Final[Any] = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def read_yaml(path: Path) -> Any:
    """Return the content of a YAML file; raises as `parse_yaml` and `read_regular`."""
    return parse_yaml(read_regular_text(path, YAML_BYTES))


def parse_yaml(text: str) -> Any:
    """Return the content of a YAML text.

    Raises:
        UntrustedFileError: it is no YAML, has anchors, aliases or tags, or exceeds a limit.
    """
    limit("bytes", len(text), YAML_BYTES)
    try:
        _check_events(text)
        return yaml.load(text, LOADER)  # it is a safe one
    except UntrustedFileError:
        raise
    except yaml.YAMLError as error:
        raise UntrustedFileError(" ".join(str(error).split())) from error
    except RecursionError:
        raise too_deep() from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise UntrustedFileError(f"a value cannot be read ({error})") from error


def _check_events(text: str) -> None:
    depth = 0
    for count, event in enumerate(yaml.parse(text, LOADER), 1):
        limit("values", count, YAML_EVENTS)
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            raise UntrustedFileError("it has an anchor or an alias; neither is read")
        if (tag := getattr(event, "tag", None)) not in (None, "!"):
            raise UntrustedFileError(f"it has the tag {str(tag)[:40]!r}; tags are not read")
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
            if depth > DEPTH:
                raise too_deep()
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        elif isinstance(event, yaml.ScalarEvent) and _is_long_number(event):
            raise too_long(event.value)


def _is_long_number(event: yaml.ScalarEvent) -> bool:
    if len(event.value) <= DIGITS:
        return False
    resolver = yaml.resolver.Resolver()
    return resolver.resolve(yaml.ScalarNode, event.value, event.implicit) in NUMBERS
