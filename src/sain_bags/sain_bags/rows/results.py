"""The one reader of rows: the results of a recording's pushes, in the order of their receipt.

Data set, report page and summaries read pushes here.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy import ndarray

from sain_bags.reading.bag_files import Batch
from sain_bags.reading.reader import Bag
from sain_bags.rows.message_fields import DISKS, FIELDS, PREDICTION, PUSH_RESULT, topics_of
from sain_bags.rows.recorded_push import RecordedPush
from sain_bags.rows.tables import Disks, MessageTable, TableReader
from sain_core.errors import DatasetError, ErrorCode
from sain_core.push import PUSH_NAMES, pushed_bodies
from sain_core.scene import STATE_NAMES
from sain_core.types import Scene, Scenes
from sain_core.wire import as_sent, check_disks, check_fields

OK: Final = int(ErrorCode.OK)
SECOND: Final = 1_000_000_000  # [ns]


@dataclass(frozen=True)
class RecordedScenes:
    """One scene for each of K pushes, of any number of bodies each."""

    disks: Disks
    counts: ndarray  # (K,) of bodies
    settled: ndarray  # (K,)
    numbers: ndarray  # (K,) scene ids
    stamps: ndarray  # (K,) [ns] simulated time
    frames: ndarray  # (K,) names; empty: the world

    def take(self, chosen: ndarray, count: int) -> Scenes:
        """Return those of some pushes that have so many bodies, (len(chosen), count, 8)."""
        return self.disks.scenes(chosen, count)

    def one(self, push: int) -> Scene | None:
        """Return the scene of one push, whatever it holds; None: it is empty."""
        count = int(self.counts[push])
        return self.take(np.array([push]), count)[0] if count else None


@dataclass(frozen=True)
class Results:
    """K results as columns."""

    table: MessageTable
    log_times: ndarray  # (K,) [ns since the epoch]

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.log_times)

    @property
    def push_ids(self) -> ndarray:
        """The ids of the pushes (K,)."""
        return self.table.columns["push_id"]

    @property
    def codes(self) -> ndarray:
        """The error codes (K,): `OK` where a push was executed."""
        return self.table.columns["error_code"]

    @property
    def messages(self) -> ndarray:
        """The error messages (K,)."""
        return self.table.columns["error_message"]

    @cached_property
    def episodes(self) -> ndarray:
        """The episodes (K,): as the results have them, else as the pushes."""
        return self.table.columns["episode_id"]

    @cached_property
    def ids(self) -> list[tuple[str, str, ndarray]]:
        """The ids inside of results, the result's own that each repeats, and where so (K,).

        Ids count from 1: one that is 0 is not stated.
        """
        pairs = [("push.push_id", "push_id")]
        pairs += [(f"{part}.episode_id", "episode_id") for part in ("push", "before", "after")]
        columns = self.table.columns
        return [
            (one, own, (columns[one] == columns[own]) | (columns[one] == 0)) for one, own in pairs
        ]

    @cached_property
    def before(self) -> RecordedScenes:
        """The scenes before the pushes."""
        return self._scenes("before.")

    @cached_property
    def after(self) -> RecordedScenes:
        """The scenes after the pushes."""
        return self._scenes("after.")

    @cached_property
    def actions(self) -> ndarray:
        """The pushes (K, 5)."""
        columns = self.table.columns
        return as_sent(np.stack([columns[f"push.{name}"] for name in PUSH_NAMES], -1, dtype=float))

    @cached_property
    def bodies(self) -> ndarray:
        """The body that each push is against (K,)."""
        return pushed_bodies(self.actions)

    @property
    def durations(self) -> ndarray:
        """How long the pushes took (K,) [s], simulated."""
        return self.table.columns["duration"]

    @cached_property
    def predicted(self) -> ndarray:
        """Which pushes have a prediction without an error (K,)."""
        return np.asarray(self.table.columns[f"{PREDICTION}.error_code"] == OK)

    @cached_property
    def models(self) -> ndarray:
        """What predicted each push (K,); empty: nothing did."""
        return np.where(self.predicted, self.table.columns[f"{PREDICTION}.model"], "")

    @property
    def predicted_counts(self) -> ndarray:
        """The number of bodies in each prediction (K,)."""
        return self._predictions.counts

    @property
    def _predictions(self) -> Disks:
        return self.table.disks[f"{PREDICTION}.{DISKS}"]

    def physics(self, chosen: ndarray, count: int) -> Scenes:
        """Return f_p(s, a) of pushes, (len(chosen), count, 8); NaN: not as many bodies, or none."""
        scenes = np.full((len(chosen), count, len(STATE_NAMES)), np.nan)
        fitting = self.predicted[chosen] & (self.predicted_counts[chosen] == count)
        scenes[fitting] = self._predictions.scenes(chosen[fitting], count)
        return scenes

    def pushes(self) -> Iterator[RecordedPush]:
        """Yield the pushes one by one.

        Raises:
            InvalidInputError: NaN or Inf in a scene, or in a push that was not refused.
        """
        columns = self.table.columns
        names = ("push_id", "episode_id", "error_code", "duration", "wall_time")
        numbers = zip(*(columns[name].tolist() for name in names), strict=True)
        for row, (push_id, episode, code, duration, wall_time) in enumerate(numbers):
            scenes = self.before.one(row), self.after.one(row)
            for scene in scenes:
                if scene is not None:
                    check_disks(scene)
            if code == OK:
                check_fields(self.actions[row], PUSH_NAMES, "push")
            count = int(self.predicted_counts[row]) if self.predicted[row] else 0
            yield RecordedPush(
                push_id,
                self.actions[row],
                *scenes,
                code,
                columns["error_message"][row],
                columns["push.source"][row],
                duration,
                wall_time,
                physics=self.physics(np.array([row]), count)[0] if count else None,
                physics_model=self.models[row],
                episode_id=episode,
                scene_ids=(int(self.before.numbers[row]), int(self.after.numbers[row])),
                stamps=(int(self.before.stamps[row]), int(self.after.stamps[row])),
                log_time=int(self.log_times[row]),
            )

    def _scenes(self, prefix: str) -> RecordedScenes:
        columns, disks = self.table.columns, self.table.disks[prefix + DISKS]
        seconds = columns[f"{prefix}header.stamp.sec"].astype(np.int64)
        return RecordedScenes(
            disks,
            disks.counts,
            columns[f"{prefix}settled"] != 0,
            columns[f"{prefix}scene_id"],
            seconds * SECOND + columns[f"{prefix}header.stamp.nanosec"].astype(np.int64),
            columns[f"{prefix}header.frame_id"],
        )


def read_results(
    bag: Bag, namespace: str, batches: Iterable[Batch] | None = None
) -> Iterator[Results]:
    """Read the results of one graph, a batch at a time, in the order of their receipt.

    `batches` are those of the results, if they were read before.

    Raises:
        DatasetError: damage, or messages that lack what a row needs.
    """
    readers: dict[int, TableReader] = {}
    if batches is None:
        batches = bag.batches(topics_of(bag, namespace, PUSH_RESULT), types=(PUSH_RESULT,))
    for batch in batches:
        ends = np.flatnonzero(np.diff(batch.channels)) + 1  # each file of a bag has its own channel
        for rows in np.split(np.arange(len(batch)), ends):
            number = int(batch.channels[rows[0]])
            part = batch[rows]
            with naming(bag):
                if number not in readers:
                    readers[number] = TableReader(bag.channels[number], bag.decoding, FIELDS)
                table = readers[number].read(part)
            yield Results(table, part.log_times)


@contextmanager
def naming(bag: Bag) -> Iterator[None]:
    """Name the bag in the error when a message in it is not as it should be."""
    try:
        yield
    except DatasetError as error:
        raise DatasetError(
            f"{bag.path} holds messages of another definition than this graph's: {error}"
        ) from error
