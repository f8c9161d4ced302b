"""Decisions of a learner, and what it noticed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Self

TRAINING, TRAINED, FAILED = "training", "trained", "training failed"
LOADED, DROPPED, CHANGED = "loaded", "dropped", "table changed"
JUMPED: Final = "friction changed"
NOT_LEARNED: Final = "not learned"
NOT_PREDICTED: Final = "not predicted"
LEFT_OUT: Final = "left out"
NOT_REMOVED: Final = "not removed"


@dataclass(frozen=True)
class Event:
    """A decision, or something that was noticed.

    Attributes:
        kind: one of those above.
        text: for people.
        pushes: learned from so far.
        time: seconds since 1970.
        about: more, by name.
    """

    kind: str
    text: str
    pushes: int = 0
    time: float = 0.0
    about: Mapping[str, Any] = field(default_factory=dict)

    def record(self) -> dict[str, Any]:
        """Return it as the log has it."""
        content = {name: value for name, value in vars(self).items() if name != "kind"}
        return {"kind": "event", "event": self.kind, **content, "about": dict(self.about)}

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> Self:
        """Return what `record` made."""
        own = {name: record[name] for name in ("text", "pushes", "time", "about")}
        if not isinstance(record["event"], str) or not isinstance(own["text"], str):
            raise TypeError(f"event is {record['event']!r}, text is {own['text']!r}")
        return cls(record["event"], **own)
