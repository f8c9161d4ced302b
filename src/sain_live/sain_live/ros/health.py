"""How the nodes say they are: changes of it become lines of the log."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticArray

from sain_core.ros.diagnostics import OK
from sain_live.state import Kind, LiveState


class Health:
    """Follows ``/diagnostics``."""

    def __init__(self, known: LiveState) -> None:
        """Begin with nobody."""
        self._known = known
        self._levels: dict[str, tuple[bytes, str]] = {}

    def hear(self, message: DiagnosticArray) -> None:
        """Tell what is new."""
        for status in message.status:
            values: dict[str, Any] = {pair.key: pair.value for pair in status.values}
            engine = values.get("engine", self._known.engine)
            if engine != self._known.engine:
                self._known.update(engine=engine)
            level, before = bytes(status.level), self._levels.get(status.name, (OK, ""))
            if (level, status.message) == before or status.message == "starting":
                continue
            if level != OK:
                kind = Kind.FAULT if status.name in self._levels else Kind.NOTE  # it starts
                self._known.tell(kind, f"{status.name}: {status.message}")
            elif before[0] != OK:
                self._known.tell(Kind.NOTE, f"{status.name}: fine again")
            self._levels[status.name] = level, status.message
