"""Messages of one channel, and what a `Pairing` is told of them."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import repeat
from typing import Any

import numpy as np
from numpy import ndarray

from sain_bags.transitions.episodes import GOAL, PREDICTION, SCENE
from sain_bags.transitions.push_run import GoalRun
from sain_bags.transitions.tables import Table
from sain_bags.transitions.wanted_fields import PUSH

Arguments = Iterator[tuple[Any, ...]]  # of a method of `Pairing`


@dataclass(frozen=True)
class Heard:
    """The messages of one channel in a batch."""

    kind: str
    table: Table
    spots: ndarray  # (M,) their places in the batch
    times: ndarray  # (M,) log times

    def column(self, name: str, rows: ndarray) -> list[Any]:
        """Return a column of some messages as Python's own numbers."""
        return self.table.columns[name][rows].tolist()

    def places(self, rows: ndarray, prefix: str = "") -> Iterator[tuple[int, int]]:
        """Yield the `Place` of some messages."""
        names = (f"{prefix}episode_id", f"{prefix}scene_id")
        return zip(*(self.column(name, rows) for name in names), strict=True)

    def wheres(self, rows: ndarray) -> Iterator[tuple[Table, int]]:
        """Yield where some messages stand."""
        return zip(repeat(self.table), rows.tolist(), strict=False)

    def arguments(self, rows: ndarray) -> Arguments:
        """Yield what a `Pairing` is told of some messages."""
        if self.kind == GOAL:
            return zip(self.column("episode_id", rows), self.wheres(rows), strict=True)
        if self.kind == SCENE:
            return zip(self.places(rows), self.wheres(rows), strict=True)
        numbers, wheres = self.column("push_id", rows), self.wheres(rows)
        if self.kind == PREDICTION:
            return zip(numbers, wheres, strict=True)
        times = self.times[rows].tolist()
        if self.kind == PUSH:
            return zip(numbers, self.places(rows), times, wheres, strict=True)
        names = ("episode_id", "error_code", "push.push_id")
        told = (self.column(name, rows) for name in names)
        return zip(numbers, *told, self.places(rows, "push."), times, wheres, strict=True)

    def run(self, chosen: slice) -> GoalRun:
        """Return some of them, which are goals."""
        spots = self.spots[chosen]
        return GoalRun(self.table, np.arange(len(self.spots))[chosen], spots)
