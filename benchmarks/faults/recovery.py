"""What is saved of a bag that is cut or damaged at random.

The bag's file is cut at random bytes; then single random bits of it are flipped; then random
stretches of 4 KiB, a sector of a disk, are zeroed. Each time it is recovered, and what was saved is
compared with the original, read by `mcap` alone. Wrong is: a whole chunk before the cut that is not
saved whole, a message that is not byte for byte one of the original's in its place, an exit code
that does not tell the truth, or an exception.
"""

import shutil
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from mcap.reader import make_reader
from mcap.records import Chunk, DataEnd, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from sain_bags.recovery.recovery import recover
from sain_bags.recovery.recovery_report import RecoveryOutcome
from sain_core.seeding import generator

SECTOR = 4096  # [bytes]
DATA_END_SIZE = 13  # [bytes], of the record that ends the data


@dataclass(frozen=True)
class Options:
    """What to spoil, and how often."""

    bag: tyro.conf.Positional[Path]
    """a whole MCAP file"""
    count: int = 1000
    """of cuts, of flips and of zeroed stretches"""
    seed: int = 0
    """of where they are"""


class Original:
    """A whole file: its messages, and where in it they are whole."""

    def __init__(self, path: Path) -> None:
        """Read the file."""
        self.content = path.read_bytes()
        self.messages = messages_of(path)
        self.whole = [(0, 0)]  # where a chunk ends, and how many messages are whole there
        self.data_end = 0
        with path.open("rb") as stream:
            for record in StreamReader(stream, emit_chunks=True).records:
                if isinstance(record, Chunk):
                    found = breakup_chunk(record, validate_crc=True)
                    count = sum(isinstance(inner, Message) for inner in found)
                    # The reader reads no further than the record: here it ends.
                    self.whole.append((stream.tell(), self.whole[-1][1] + count))
                elif isinstance(record, DataEnd):
                    self.data_end = stream.tell()

    def before(self, cut: int) -> int:
        """Return how many messages are in whole chunks before a cut."""
        return max(count for end, count in self.whole if end <= cut)


def messages_of(path: Path) -> list[tuple[Any, ...]]:
    """Return all that a file's messages are, in its order."""
    found = []
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            kind = schema and (schema.name, schema.encoding, schema.data)
            about = (kind, channel.topic, channel.message_encoding, channel.metadata)
            times = (message.log_time, message.publish_time)
            found.append((*about, *times, message.sequence, message.data))
    return found


def cut(content: bytearray, random: np.random.Generator) -> int:
    """Cut a file off; return where."""
    place = int(random.integers(len(content)))
    del content[place:]
    return place


def flip(content: bytearray, random: np.random.Generator) -> int:
    """Flip one bit; return in which byte."""
    place = int(random.integers(len(content)))
    content[place] ^= 1 << int(random.integers(8))
    return place


def zero(content: bytearray, random: np.random.Generator) -> int:
    """Zero a sector; return where it begins."""
    place = int(random.integers(len(content) // SECTOR)) * SECTOR
    content[place : place + SECTOR] = bytes(len(content[place : place + SECTOR]))
    return place


def attempt(original: Original, damage: Callable[..., int], random: Any, folder: Path) -> Any:
    """Damage and recover once.

    Returns:
        the outcome, the share of messages saved, and whether something is wrong.
    """
    content = bytearray(original.content)
    place = damage(content, random)
    file, out = folder / "damaged.mcap", folder / "out"
    file.write_bytes(content)
    try:
        report = recover(file, out)
    except Exception as error:  # noqa: BLE001  # none is right here
        print(f"{damage.__name__} at {place}: {error!r}")
        return RecoveryOutcome.NOTHING, 0.0, True
    saved = messages_of(out / "out_0.mcap") if report.messages else []
    shutil.rmtree(out, ignore_errors=True)
    rest = iter(original.messages)
    wrong = report.outcome not in truthful(original, content, saved)
    wrong |= not all(message in rest for message in saved)
    wrong |= damage is cut and saved != original.messages[: original.before(place)]
    if wrong:
        print(f"{damage.__name__} at {place}: {report.outcome.name}, {len(saved)} messages")
    return report.outcome, len(saved) / len(original.messages), wrong


def truthful(original: Original, content: bytearray, saved: list[Any]) -> set[RecoveryOutcome]:
    """Return the outcomes that are true of what was saved."""
    if saved != original.messages:
        return {RecoveryOutcome.LOSSY if saved else RecoveryOutcome.NOTHING}
    end = slice(original.data_end - DATA_END_SIZE, original.data_end)
    if content[end] == original.content[end]:
        return {RecoveryOutcome.LOSSLESS}
    if len(content) < original.data_end:
        return {RecoveryOutcome.LOSSY}  # nothing tells any more that this was all
    return {
        RecoveryOutcome.LOSSLESS,
        RecoveryOutcome.LOSSY,
    }  # the summary may tell, or be damaged too


def main() -> None:
    """Run from the command line."""
    options = tyro.cli(Options, description=__doc__)
    original = Original(options.bag)
    print(
        f"{options.bag.name}: {len(original.content):,} bytes, {len(original.messages):,} messages"
        f" in {len(original.whole) - 1} chunks; {options.count} times each, seed {options.seed}"
    )
    for number, damage in enumerate((cut, flip, zero)):
        random = generator(options.seed, number)
        with tempfile.TemporaryDirectory() as folder:
            tries = [attempt(original, damage, random, Path(folder)) for _ in range(options.count)]
        outcomes = Counter(outcome.name.lower() for outcome, _, _ in tries)
        shares = [share for _, share, _ in tries]
        print(
            f"{damage.__name__:5} wrong {sum(wrong for _, _, wrong in tries)},"
            f" {', '.join(f'{name} {count}' for name, count in sorted(outcomes.items()))};"
            f" messages saved: mean {np.mean(shares):.1%}, least {min(shares):.1%}"
        )


if __name__ == "__main__":
    main()
