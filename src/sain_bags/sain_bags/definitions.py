"""Message definitions as recordings carry them: the ``.msg`` text and those of all it refers to.

A bag with its definitions inside can be read without ROS and without the packages that made it.
The texts come from the installed packages, found as the ament index does: under
``share/<package>/msg`` of every prefix in ``AMENT_PREFIX_PATH``.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from sain_core.errors import InvalidInputError

SEPARATOR: Final = "=" * 80
NUMBERS: Final = {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
BUILT_IN: Final = NUMBERS | {"bool", "byte", "char", "float32", "float64", "string", "wstring"}


class Definitions:
    """Finds message definitions under ament prefixes and joins them with their dependencies."""

    def __init__(self, prefixes: tuple[Path, ...] | None = None) -> None:
        """Search these prefixes, in this order; by default those of ``AMENT_PREFIX_PATH``."""
        if prefixes is None:
            named = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
            prefixes = tuple(Path(prefix) for prefix in named if prefix)
        self._prefixes = prefixes
        self._texts: dict[str, str] = {}

    def text(self, type_name: str) -> str:
        """Return one type's own definition.

        Args:
            type_name: full name, for example ``std_msgs/msg/Header``.

        Raises:
            InvalidInputError: not a message's name, or no such message is installed.
        """
        if type_name not in self._texts:
            self._texts[type_name] = self._find(type_name).read_text(encoding="utf-8")
        return self._texts[type_name]

    def joined(self, type_name: str) -> str:
        """Return a type's definition followed by those of everything it refers to.

        This is the schema encoding ``ros2msg`` of the MCAP registry.
        """
        parts = [self.text(type_name).rstrip("\n")]
        for name in sorted(self._dependencies(type_name, set())):
            parts.append(f"{SEPARATOR}\nMSG: {name}\n{self.text(name)}".rstrip("\n"))
        return "\n".join(parts) + "\n"

    def _dependencies(self, type_name: str, seen: set[str]) -> set[str]:
        for name in referred_types(type_name, self.text(type_name)):
            if name not in seen:
                seen.add(name)
                self._dependencies(name, seen)
        return seen

    def _find(self, type_name: str) -> Path:
        package, kind, name = _split(type_name)
        for prefix in self._prefixes:
            path = prefix / "share" / package / kind / f"{name}.msg"
            if path.is_file():
                return path
        searched = (
            os.pathsep.join(map(str, self._prefixes)) or "nothing (AMENT_PREFIX_PATH is empty)"
        )
        raise InvalidInputError(f"no definition of {type_name} is installed; searched {searched}")


def referred_types(type_name: str, text: str) -> Iterator[str]:
    """Yield the full names of the message types that a definition's fields have."""
    package = _split(type_name)[0]
    for line in text.splitlines():
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        field = words[0].split("[", 1)[0].split("<=", 1)[0]
        if field in BUILT_IN:
            continue
        yield f"{package}/msg/{field}" if "/" not in field else _full_name(field)


def _full_name(name: str) -> str:
    package, _, short = name.rpartition("/")
    return name if package.endswith("/msg") else f"{package}/msg/{short}"


def _split(type_name: str) -> tuple[str, str, str]:
    parts = type_name.split("/")
    if len(parts) != 3 or parts[1] != "msg" or not all(parts):
        raise InvalidInputError(f"{type_name!r} is not a message type; it must be package/msg/Name")
    return parts[0], parts[1], parts[2]
