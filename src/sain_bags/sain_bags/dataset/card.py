"""The card of a data set: counts, ranges, sources, and the pushes that were dropped."""

import math
from collections import Counter
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_bags.dataset.rows import Dropped
from sain_core.push import PUSH_NAMES, PUSH_SIZE
from sain_core.scene import MID, TARGET
from sain_core.transitions import SHARD_SIZE, Column, Columns, centres, describe_fields

UNITS: Final = {  # of the quantities of which ranges are stated
    "location": "rad",
    "angle": "rad",
    "length": "m",
    "speed": "m/s",
    **dict.fromkeys(("target_x", "target_y", "mid_travel", "target_travel", "physics_error"), "m"),
}
COUNTED: Final = (Column.SOURCE, Column.PHYSICS_SOURCE, Column.BAG_SHA256)
COUNTED_BODIES: Final = (Column.SHAPES, Column.ROLES)  # where a data set has them
DISKS: Final = "disks"
EXAMPLES: Final = 3  # of what was dropped, for each reason


class DatasetCard:
    """Counts rows and dropped pushes during a conversion."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.transitions = 0
        self.dropped: Counter[str] = Counter()
        self._details: dict[str, list[str]] = {}
        self._counts: dict[str, Counter[str]] = {
            key: Counter() for key in (*COUNTED, *COUNTED_BODIES, DISKS)
        }
        self._moved = 0
        self._shards: list[int] = []
        self._fields: dict[str, list[int]] = {}
        self._ranges = dict.fromkeys(UNITS, (math.inf, 0.0, -math.inf))  # with the sum

    def drop(self, bag: Path, push: Dropped) -> None:
        """Count a push that is no row."""
        self.dropped[push.reason] += 1
        details = self._details.setdefault(push.reason, [])
        if len(details) < EXAMPLES:
            details.append(f"{bag}: {push.detail}")

    def add(self, shard: Columns) -> None:
        """Count the rows of a shard."""
        rows = len(shard[Column.ACTION])
        self.transitions += rows
        self._shards.append(rows)
        self._moved += int(shard[Column.MOVED].sum())
        for key in (*COUNTED, *COUNTED_BODIES):
            if key in shard:
                self._counts[key].update(_occurrences(shard[key]))
        self._counts[DISKS][str(shard[Column.MASSES].shape[1])] += rows
        for name, values in _quantities(shard).items():
            least, total, most = self._ranges[name]
            low, added, high = (float(one) for one in (values.min(), values.sum(), values.max()))
            self._ranges[name] = min(least, low), total + added, max(most, high)
        self._fields = describe_fields(shard)

    def left_out(self) -> tuple[str, ...]:
        """Return how many pushes are no row for each reason, with the first of them."""
        return tuple(
            f"{count} {reason} ({self._details[reason][0]})"
            for reason, count in self.dropped.most_common()
        )

    def content(self, identity: dict[str, Any], sources: list[dict[str, Any]]) -> dict[str, Any]:
        """Return the content of ``card.json``."""
        by_bag = self._counts[Column.BAG_SHA256]
        return {
            **identity,
            "transitions": self.transitions,
            "moved": self._moved,
            "shard_size": SHARD_SIZE,
            "shards": self._shards,
            DISKS: dict(self._counts[DISKS]),
            **{str(k): dict(self._counts[k]) for k in COUNTED_BODIES if self._counts[k]},
            "scenes_from": dict(self._counts[Column.SOURCE]),
            "physics_from": dict(self._counts[Column.PHYSICS_SOURCE]),
            "dropped": {
                reason: {"pushes": count, "for_example": self._details[reason]}
                for reason, count in self.dropped.most_common()
            },
            "sources": [{**source, "transitions": by_bag[source["sha256"]]} for source in sources],
            "ranges": {
                name: {
                    "unit": UNITS[name],
                    "minimum": least,
                    "mean": total / self.transitions,
                    "maximum": most,
                }
                for name, (least, total, most) in self._ranges.items()
            },
            "fields": self._fields,
        }


def _occurrences(texts: ndarray) -> dict[str, int]:
    """Return how often each text (M,) occurs, in the order of first occurrence."""
    if (texts == texts[0]).all():
        return {str(texts[0]): len(texts)}
    return Counter(texts.tolist())


def _quantities(shard: Columns) -> dict[str, ndarray]:
    """Return the values (M,) of each quantity."""
    states = (Column.STATE, Column.NEXT_STATE, Column.PHYSICS_NEXT)
    before, after, physics = (centres(shard[column]) for column in states)  # each (M, N, 2)
    travel = np.linalg.norm(after - before, axis=-1)
    target = min(TARGET, before.shape[1] - 1)  # or the only body
    return {
        **dict(zip(PUSH_NAMES[1:], shard[Column.ACTION].T[1:PUSH_SIZE], strict=True)),
        "target_x": before[:, target, 0],
        "target_y": before[:, target, 1],
        "mid_travel": travel[:, MID],
        "target_travel": travel[:, target],
        "physics_error": np.linalg.norm(physics - after, axis=-1)[:, target],
    }
