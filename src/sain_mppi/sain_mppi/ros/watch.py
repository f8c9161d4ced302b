"""What no message says: whether a model serves, who listens, and whether another planner plans."""

from collections.abc import Callable
from typing import Final

from rclpy.node import Node

from sain_core.guarding.ros.ownership import Ownership
from sain_core.ros.node_main import ERROR, OK, WARN, Diagnostics
from sain_core.ros.qos import Return, listeners, steady_timer
from sain_mppi.ros.remote import RemoteRollout
from sain_mppi.ros.resumption import Notes

LOOK_AGAIN: Final = 0.1  # [s] between looks for the model, and for messages that do not come
LOOK_AROUND: Final = 1.0  # [s] between looks for who listens
LOOK_FOR_RIVALS: Final = 0.5  # [s] between looks for other planners
NO_MODEL: Final = "no model is ready yet: plans use physics without learning"


class PeerWatch:
    """Looks about with timers, and reports what it sees as diagnostics."""

    def __init__(
        self, node: Node, diagnostics: Diagnostics, remote: RemoteRollout | None, notes: Notes
    ) -> None:
        """Take hold of what only one planner may publish."""
        self._node, self._diagnostics = node, diagnostics
        self._remote, self._notes = remote, notes
        self.ownership = Ownership(node, ("plan",))  # people and players send pushes, too
        self._back = Return(node, "plan", notes.listeners, anyone=notes.goal is not None)
        self._rival = ""
        self._starting = True  # until a model serves, or a plan says more
        diagnostics.set(WARN, NO_MODEL)

    def begin(self, look_again: Callable[[], None]) -> None:
        """Look from now on; `look_again` is called at each look."""
        steady_timer(self._node, LOOK_AGAIN, self._look)
        steady_timer(self._node, LOOK_AGAIN, look_again)
        steady_timer(self._node, LOOK_FOR_RIVALS, self._look_for_rivals)
        if self._notes.kept:
            steady_timer(self._node, LOOK_AROUND, self._look_around)

    @property
    def ready(self) -> bool:
        """Whether to act: those who listened before are back, and no model is about to serve."""
        return self._back.complete() and not (self._remote is not None and self._remote.starting)

    def report(self, level: bytes, message: str, **figures: object) -> None:
        """Report what became of a plan: it says more than the looks for a model."""
        self._starting = False
        self._diagnostics.set(level, message, **figures)

    def _look(self) -> None:
        if self._starting and (self._remote is None or self._remote.ready):
            self._starting = False
            self._diagnostics.set(OK, "ready")
        elif self._starting and self._remote is not None:
            doing = self._remote.starting
            self._diagnostics.set(WARN, f"waits for the model: {doing}" if doing else NO_MODEL)

    def _look_around(self) -> None:
        if self._back.complete():
            self._notes.heard_by(listeners(self._node, "plan"))

    def _look_for_rivals(self) -> None:
        before, self._rival = self._rival, self.ownership.rival()
        if self._rival:
            self._diagnostics.set(ERROR, self._rival)
        elif before:
            self._diagnostics.set(OK, "ready")
