"""Lost messages, counted from the publishers' sequence numbers."""

import json
from collections.abc import Callable, Mapping
from typing import Final

from sain_core.guarding.documents import parse_json

MISSING_KEY: Final = "missing_messages"  # in a bag's custom data
SILENT_KEY: Final = "silent_topics"  # likewise: those published or asked for, and never heard
UNRECORDED_KEY: Final = "unrecorded_topics"  # likewise: those that could not be recorded


class Gaps:
    """Counts the lost messages of one topic.

    Each publisher numbers its messages from 1, and a message does not tell whose it is. What one
    publisher's numbers leave out is missing for certain. Numbers of several run side by side; a
    message is taken for the next of whoever it can be the next of, and only where it can be
    nobody's something is missing, at least as much as to the nearest number before.
    """

    def __init__(self, count_publishers: Callable[[], int] = lambda: 1) -> None:
        """Store the function that returns the number of publishers so far."""
        self.missing = 0
        self.is_known = True  # the middleware does give numbers
        self._count_publishers = count_publishers
        self._last: list[int] = []  # of each publisher
        self._publishers = 1

    @property
    def is_exact(self) -> bool:
        """Whether the count is exact, not a lower bound."""
        return self._publishers == 1

    def saw(self, sequence: int) -> None:
        """Count a message by its sequence number; 0: it has none."""
        last = self._last
        if len(last) == 1 and sequence == last[0] + 1:
            last[0] = sequence
        elif not sequence:
            self.is_known = False
        else:
            self._place(sequence)

    def text(self) -> str:
        """Return the count of missing messages as text."""
        if not self.is_known:
            return "?"
        return str(self.missing) if self.is_exact else f">= {self.missing}"

    def _place(self, sequence: int) -> None:
        last = self._last
        if sequence - 1 in last:
            last[last.index(sequence - 1)] = sequence
            return
        self._publishers = max(self._publishers, self._count_publishers())
        before = [number for number in last if number < sequence]
        if not before or len(last) < self._publishers:
            last.append(sequence)  # the first of a publisher, which may be numbered already
            self._publishers = max(self._publishers, len(last))
            return
        nearest = max(before)
        self.missing += sequence - nearest - 1
        last[last.index(nearest)] = sequence


def describe_gaps(gaps: Mapping[str, Gaps]) -> str:
    """Return the missing messages as a recording stores them: topics and counts, in JSON."""
    missing = {name: gap.text() for name, gap in gaps.items() if gap.missing or not gap.is_known}
    return json.dumps(dict(sorted(missing.items())))


def read_gaps(custom_data: Mapping[str, str]) -> dict[str, str] | None:
    """Return the missing messages of each topic that a recording states; None: it states none."""
    try:
        return {str(k): str(v) for k, v in parse_json(custom_data[MISSING_KEY]).items()}
    except (KeyError, ValueError, AttributeError):
        return None


def read_names(custom_data: Mapping[str, str], key: str) -> tuple[str, ...]:
    """Return the topics that a recording lists under a key; none where it lists none."""
    try:
        return tuple(map(str, parse_json(custom_data[key])))
    except (KeyError, ValueError, TypeError):
        return ()
