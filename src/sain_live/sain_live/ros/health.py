"""How the nodes say they are: changes of it become lines of the log."""

from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray

from sain_core.ros.node_main import OK, node_of
from sain_live.state import Level, LiveState

PLAIN: Final = {
    "mppi_node": "planner",
    "model_node": "model",
    "sim_node": "simulator",
    "poses_to_scene": "poses",
}


class Health:
    """Follows ``/diagnostics``."""

    def __init__(self, known: LiveState) -> None:
        """Begin with nobody."""
        self._known = known
        self._levels: dict[str, tuple[bytes, str]] = {}

    def hear(self, message: DiagnosticArray) -> None:
        """Tell what is new; while the graph starts, no trouble of a node is a fault."""
        for status in message.status:
            values: dict[str, Any] = {pair.key: pair.value for pair in status.values}
            engine = values.get("engine", self._known.engine)
            if engine != self._known.engine:
                self._known.update(engine=engine)
            level, before = bytes(status.level), self._levels.get(status.name, (OK, ""))
            if (level, status.message) == before or status.message == "starting":
                continue
            if level != OK:
                first, starting = status.name not in self._levels, self._known.starting
                if first or not starting:  # else the page says all the time what it waits for
                    kind = Level.NOTE if first or starting else Level.FAULT
                    self._known.tell(kind, f"{plain_name(node_of(status))}: {status.message}")
            elif before[0] != OK:
                self._known.tell(Level.NOTE, f"{plain_name(node_of(status))}: {status.message}")
            self._levels[status.name] = level, status.message


def plain_name(node: str) -> str:
    """Return what a reader calls a node."""
    name = node.rpartition("/")[2]
    return PLAIN.get(name, name)
