"""Message definitions as recordings carry them: the ``.msg`` text and those of all it refers to.

A bag with its definitions inside can be read without ROS and without the packages that made it.
The texts come from the installed packages, found as the ament index does: under
``share/<package>/msg`` of every prefix in ``AMENT_PREFIX_PATH``. What service introspection
publishes has no text of its own: it is made of the service's.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from sain_core.errors import InvalidInputError

SEPARATOR: Final = "=" * 80
NUMBERS: Final = {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
EVENT: Final = """service_msgs/ServiceEventInfo info
{name}_Request[<=1] request
{name}_Response[<=1] response
"""
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
            type_name: full name, for example ``std_msgs/msg/Header``, or
                ``std_srvs/srv/Trigger_Event``.
        """
        if type_name not in self._texts:
            self._texts[type_name] = self._read(type_name)
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

    def _read(self, type_name: str) -> str:
        package, kind, name = _split(type_name)
        if kind == "msg":
            return self._find(type_name, f"{name}.msg")
        service, _, part = name.rpartition("_")
        if part == "Event":
            return EVENT.format(name=service)
        request, _, response = ("\n" + self._find(type_name, f"{service}.srv")).partition("\n---")
        return qualified((response if part == "Response" else request).strip("\n"), package)

    def _find(self, type_name: str, file_name: str) -> str:
        package, kind, _ = _split(type_name)
        for prefix in self._prefixes:
            path = prefix / "share" / package / kind / file_name
            if path.is_file():
                return path.read_text(encoding="utf-8")
        searched = (
            os.pathsep.join(map(str, self._prefixes)) or "nothing (AMENT_PREFIX_PATH is empty)"
        )
        raise InvalidInputError(
            f"no definition of {type_name} is installed; searched {searched}; run inside ./env"
        )


def referred_types(type_name: str, text: str) -> Iterator[str]:
    """Yield the full names of the message types that a definition's fields have."""
    package, kind, _ = _split(type_name)
    for line in text.splitlines():
        field = _field_type(line)
        if field not in BUILT_IN:
            yield f"{package}/{kind}/{field}" if "/" not in field else _full_name(field)


def qualified(text: str, package: str) -> str:
    """Return a definition whose fields name the package also of what is in their own."""
    lines = []
    for line in text.splitlines():
        field = _field_type(line)
        is_own = field not in BUILT_IN and "/" not in field
        lines.append(line.replace(field, f"{package}/{field}", 1) if is_own else line)
    return "\n".join(lines) + "\n"


def _field_type(line: str) -> str:
    """Return the type of a line's field or constant; of a line without one, a built-in one."""
    words = line.split("#", 1)[0].split()
    return words[0].split("[", 1)[0].split("<=", 1)[0] if words else "string"


def _full_name(name: str) -> str:
    package, _, short = name.rpartition("/")
    return name if package.endswith("/msg") else f"{package}/msg/{short}"


def _split(type_name: str) -> tuple[str, str, str]:
    parts = type_name.split("/")
    is_event = parts[1:2] == ["srv"] and parts[-1].endswith(("_Event", "_Request", "_Response"))
    if len(parts) != 3 or not (parts[1] == "msg" or is_event) or not all(parts):
        raise InvalidInputError(f"{type_name!r} is not a message type; it must be package/msg/Name")
    return parts[0], parts[1], parts[2]
