"""What became of the pushes that a collection drew, counted episode by episode."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Final, Self

from sain_core.errors import BlockedError, SainError, UnreachableError
from sain_core.storage import append_json, write_whole
from sain_core.untrusted import parse_json, read_regular

JOURNAL_FILE: Final = "episodes.jsonl"


@dataclass
class PushCounts:
    """Counts of pushes; each push that was drawn is in one of the groups, and in one only."""

    episodes: int = 0
    unreachable: int = 0  # refused: the arm cannot take a pose on the way
    blocked: int = 0  # refused: the tool would touch another disk than the mid disk
    refused: int = 0  # for another reason
    edge: int = 0  # ended its episode: a disk over the table's edge, or not settled
    missed: int = 0  # the target did not move at all
    short: int = 0  # the target moved by less than 2 mm
    moved: int = 0  # the target moved by 2 mm or more
    stuck: int = 0  # episodes (not pushes) that ended early: no push that was tried was possible

    @property
    def drawn(self) -> int:
        """All pushes that were tried."""
        return self.unreachable + self.blocked + self.refused + self.edge + self.valid

    @property
    def valid(self) -> int:
        """The pushes that make a transition; the paper's filter keeps ``moved`` of them."""
        return self.missed + self.short + self.moved

    def refuse(self, error: SainError) -> None:
        """Count a push that was refused."""
        if isinstance(error, UnreachableError):
            self.unreachable += 1
        elif isinstance(error, BlockedError):
            self.blocked += 1
        else:
            self.refused += 1

    def __add__(self, other: Self) -> Self:
        """Return the counts of both."""
        names = [item.name for item in fields(self)]
        return type(self)(*(getattr(self, name) + getattr(other, name) for name in names))


class CollectionJournal:
    """A line for each episode in ``episodes.jsonl``, so that a killed collection knows its counts.

    A line is written when its episode is done, before the shards that hold its transitions are
    full: it never lags behind them.
    """

    def __init__(self, folder: Path, first: int) -> None:
        """Keep what is known of the episodes before the first one to come.

        Raises:
            OutputError: the folder cannot be written.
        """
        self._path = folder / JOURNAL_FILE
        known = [line for line in _lines(self._path) if line["episode"] < first]
        self.total = sum((_counts(line) for line in known), PushCounts())
        text = "".join(json.dumps(line) + "\n" for line in known)
        write_whole(self._path, text.encode())

    def add(self, episode: int, counts: PushCounts) -> None:
        """Write down what became of an episode's pushes; raises `OutputError`."""
        self.total += counts
        append_json(self._path, {"episode": episode, **asdict(counts)})


def _lines(path: Path) -> Iterable[dict[str, Any]]:
    """Return the whole lines of a journal; what a kill left half-written ends it."""
    for line in read_regular(path).decode(errors="replace").splitlines() if path.exists() else []:
        try:
            content = parse_json(line)
        except ValueError:
            return
        if not isinstance(content, dict) or not isinstance(content.get("episode"), int):
            return
        yield content


def _counts(line: dict[str, Any]) -> PushCounts:
    return PushCounts(**{item.name: int(line.get(item.name, 0)) for item in fields(PushCounts)})
