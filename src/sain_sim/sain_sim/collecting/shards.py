"""What a collection writes: rows in npz shards of 1,000, and what became of the drawn pushes."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Final, Self

import numpy as np

from sain_core.errors import BlockedError, DatasetError, SainError, UnreachableError
from sain_core.guarding.documents import parse_json
from sain_core.guarding.untrusted import read_regular
from sain_core.output import append_json, write_whole
from sain_core.scene import STATE_SIZE
from sain_core.storage import read_arrays, write_arrays
from sain_core.transitions import (
    MOVED,
    NEEDED,
    SHARD_PATTERN,
    SHARD_SIZE,
    Column,
    Columns,
    Row,
    shard_path,
)
from sain_core.world import ToppledError

JOURNAL_FILE: Final = "episodes.jsonl"
MISSED: Final = 1e-5  # [m]; an untouched target creeps by up to 3e-6 m in Bullet

Place = tuple[int, int]  # of a row: its episode and its step
PLACE: Final = (Column.EPISODE, Column.STEP)


@dataclass
class PushCounts:
    """Counts of pushes; each push that was drawn is in one of the groups, and in one only."""

    episodes: int = 0
    unreachable: int = 0  # refused: the arm cannot take a pose on the way
    blocked: int = 0  # refused: the tool would touch another disk than the mid disk
    refused: int = 0  # for another reason
    edge: int = 0  # ended its episode: a disk over the table's edge, or not settled
    toppled: int = 0  # ended its episode: a body tipped over
    missed: int = 0  # the target did not move at all
    short: int = 0  # the target moved by less than 2 mm
    moved: int = 0  # the target moved by 2 mm or more
    redrawn: int = 0  # draws of an episode's world in which a body would tip over
    stuck: int = 0  # episodes (not pushes) that ended early: no push that was tried was possible

    @property
    def drawn(self) -> int:
        """All pushes that were tried."""
        ended = self.edge + self.toppled
        return self.unreachable + self.blocked + self.refused + ended + self.valid

    @property
    def valid(self) -> int:
        """The pushes that make a transition; the paper's filter keeps ``moved`` of them."""
        return self.missed + self.short + self.moved

    def refuse(self, error: SainError) -> None:
        """Count a push that was refused, or that has no outcome in a plane."""
        if isinstance(error, ToppledError):
            self.toppled += 1
        elif isinstance(error, UnreachableError):
            self.unreachable += 1
        elif isinstance(error, BlockedError):
            self.blocked += 1
        else:
            self.refused += 1

    def carry_out(self, travel: float) -> None:
        """Count a valid push that moved the target so far [m]."""
        self.moved += travel >= MOVED
        self.missed += travel < MISSED
        self.short += MISSED <= travel < MOVED

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


def write_shard(folder: Path, index: int, rows: Sequence[Row]) -> None:
    """Write a shard: whole, or not at all.

    Raises:
        OutputError: when the folder cannot be written, or the disk is full.
    """
    known = [column for column in Column if column in rows[0]]
    columns: Columns = {
        str(column): np.array([row[column] for row in rows], dtype=column.dtype) for column in known
    }
    for name in rows[0]:
        if name not in columns:  # which shapes there are, and what is rough
            columns[name] = np.stack([np.asarray(row[name]) for row in rows])
    write_arrays(shard_path(folder, index), columns)


class ShardWriter:
    """Gathers rows into shards, each of scenes with one number of bodies.

    Goes on where the whole shards of a folder end: what they hold is not written again.
    """

    def __init__(self, folder: Path, counts: Sequence[int]) -> None:
        """Continue a folder of episodes with these numbers of bodies."""
        self._folder, self.shards = folder, 0
        self._last: dict[int, Place] = dict.fromkeys(counts, (0, -1))
        self._waiting: dict[int, list[Row]] = {count: [] for count in counts}
        while (path := shard_path(folder, self.shards)).exists():
            shard = _load(path)
            if len(shard[Column.EPISODE]) != SHARD_SIZE:
                break
            self._last[bodies_in(shard)] = _place({name: shard[name][-1] for name in PLACE})
            self.shards += 1

    @property
    def first(self) -> int:
        """The first episode that may have rows which are not written yet."""
        return min(self._last.values())[0]

    @property
    def rows(self) -> int:
        """How many rows there are, written or not."""
        return self.shards * SHARD_SIZE + sum(map(len, self._waiting.values()))

    def add(self, rows: Sequence[Row]) -> None:
        """Take the rows of the next episode; write the shard that they complete."""
        for row in rows:
            count = len(row[Column.MASSES])
            if _place(row) > self._last[count]:
                self._waiting[count].append(row)
        for count in self._waiting:
            while len(self._waiting[count]) >= SHARD_SIZE:
                write_shard(self._folder, self.shards, self._waiting[count][:SHARD_SIZE])
                self._waiting[count] = self._waiting[count][SHARD_SIZE:]
                self.shards += 1

    def finish(self) -> None:
        """Write the shards that are not full."""
        begun = [waiting for waiting in self._waiting.values() if waiting]
        for number, waiting in enumerate(begun):
            write_shard(self._folder, self.shards + number, waiting)


def _place(row: Row) -> Place:
    """Return the episode of a row and its step."""
    return int(row[Column.EPISODE]), int(row[Column.STEP])


def bodies_in(shard: Columns) -> int:
    """Return the number of bodies in the scenes of a shard."""
    return shard[Column.STATE][0].size // STATE_SIZE


def load_by_count(folder: Path) -> dict[int, Columns]:
    """Return all transitions of a folder by the number of bodies: an array (M, ...) a column.

    Raises:
        DatasetError: when there are none, or a shard is damaged.
    """
    paths = sorted(folder.glob(SHARD_PATTERN))
    if not paths:
        raise DatasetError(f"{folder} holds no shards; ros2 run sain_sim collect --out makes some")
    by_count: dict[int, list[Columns]] = {}
    for shard in map(_load, paths):
        by_count.setdefault(bodies_in(shard), []).append(shard)
    return {
        count: {name: np.concatenate([shard[name] for shard in shards]) for name in shards[0]}
        for count, shards in sorted(by_count.items())
    }


def load_shards(folder: Path) -> Columns:
    """Return all transitions of a folder with one number of bodies, as `load_by_count`."""
    by_count = load_by_count(folder)
    if len(by_count) > 1:
        numbers = ", ".join(map(str, by_count))
        raise DatasetError(f"{folder} has scenes of {numbers} bodies; read them one by one")
    return next(iter(by_count.values()))


def _load(path: Path) -> Columns:
    try:
        arrays = read_arrays(path)
    except DatasetError as error:
        raise DatasetError(f"{error}; delete it to have it made anew") from error
    missing = {Column.STEP, *NEEDED} - arrays.keys()
    if missing:
        raise DatasetError(f"{path} lacks {', '.join(sorted(missing))}; no collection made it")
    return arrays
