"""What a recovery saved and what it lost."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from sain_bags.bag.metadata import Span
from sain_bags.recovery.sidecar import Sidecar


class RecoveryOutcome(IntEnum):
    """How a recovery ended; the exit code."""

    LOSSLESS = 0
    NOTHING = 1
    LOSSY = 3


@dataclass
class Loss:
    """A stretch of a file from which nothing, or not everything, could be taken."""

    file: str
    start: int  # [bytes] from the beginning of the file
    end: int
    reason: str
    chunk: int | None = None  # its number in the file, from 1
    messages: int | None = None  # None: not known
    after: int | None = None  # [ns since the epoch], the last message that was saved before it
    before: int | None = None  # [ns since the epoch], the first message that was saved behind it

    def text(self, began: int) -> str:
        """Describe the loss; times count from the beginning of the bag [ns since the epoch]."""
        what = "bytes" if self.chunk is None else f"chunk {self.chunk}, bytes"
        after = "from the start" if self.after is None else f"after {_seconds(self.after, began)}"
        before = "to the end" if self.before is None else f"before {_seconds(self.before, began)}"
        count = "" if self.messages is None else f", {self.messages:,} messages"
        size = self.end - self.start
        return (
            f"{self.file}: {what} {self.start:,} to {self.end:,} ({size:,} bytes{count},"
            f" {after}, {before}): {self.reason}"
        )


@dataclass
class FileReport:
    """What was saved and lost of one MCAP file."""

    name: str
    size: int  # [bytes]
    chunks: int = 0  # saved
    losses: list[Loss] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)  # messages saved, by topic
    extras: int = 0  # attachments and metadata found whole, except metadata of its bag
    expected: Mapping[str, int] | None = None  # messages it once had, from an undamaged summary
    expected_extras: int = 0
    ended: bool = False  # the end of its data was found
    matches: bool | None = None  # the CRC of all its data; None: there is none to compare
    unchecked: int = 0  # messages saved that no CRC vouches for
    about: Mapping[str, Any] = field(default_factory=dict)  # metadata of its bag
    described_bag: bool = False  # whether it once had metadata of its bag

    @property
    def damaged(self) -> bool:
        """Whether its data is not as it was written."""
        return bool(self.losses) or self.matches is False or not self.ended

    @property
    def doubtful(self) -> int:
        """Messages that were saved though they may be damaged."""
        return self.unchecked if self.damaged else 0

    @property
    def lossless(self) -> bool:
        """Whether all that it had was saved, as far as it can tell."""
        if self.expected is None:
            return not self.damaged
        return self.counts == self.expected and self.extras == self.expected_extras


@dataclass(frozen=True)
class Report:
    """What a recovery saved and what it lost."""

    files: tuple[FileReport, ...]
    counts: Mapping[str, int]  # messages saved, by topic
    span: Span  # of the messages saved
    sidecar: Sidecar  # what stands beside the files

    @property
    def messages(self) -> int:
        """Messages saved."""
        return sum(self.counts.values())

    @property
    def losses(self) -> tuple[Loss, ...]:
        """All stretches that were lost."""
        return tuple(loss for file in self.files for loss in file.losses)

    @property
    def doubtful(self) -> int:
        """Messages that were saved though they may be damaged."""
        return sum(file.doubtful for file in self.files)

    @property
    def outcome(self) -> RecoveryOutcome:
        """Whether nothing was lost, something, or all."""
        all_there = all(file.lossless for file in self.files) or self.counts == self.sidecar.counts
        if all_there and not self.doubtful and not self.sidecar.lost:
            return RecoveryOutcome.LOSSLESS
        return RecoveryOutcome.LOSSY if self.messages else RecoveryOutcome.NOTHING

    @property
    def missing(self) -> dict[str, int] | None:
        """Messages that are lost, by topic; None where nothing tells how many there were."""
        expected: dict[str, int] = {}
        for file in self.files:
            if file.expected is None:
                listed = self.sidecar.counts
                return None if listed is None else self._missing(listed)
            for topic, count in file.expected.items():
                expected[topic] = expected.get(topic, 0) + count
        return self._missing(expected)

    def _missing(self, expected: Mapping[str, int]) -> dict[str, int]:
        lost = {topic: count - self.counts.get(topic, 0) for topic, count in expected.items()}
        return {topic: count for topic, count in lost.items() if count > 0}


def _seconds(time: int, began: int) -> str:
    return f"{1e-9 * (time - began):.3f} s"
