"""Pushes whose scenes are all from results, or all from scenes, as columns."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.pairing import OK, Paired, Where
from sain_bags.tables import DISKS, Disks, gather
from sain_core.errors import InvalidInputError
from sain_core.push import PUSH_NAMES
from sain_core.scene import MASS, RADIUS, STATE_NAMES
from sain_core.types import Scene
from sain_core.wire import check_disks, check_fields

FROM_RESULT: Final = "push_result"  # where the scenes of a row are from
FROM_SCENES: Final = "scenes"
GOAL_FIELDS: Final = ("x", "y", "tolerance")
SECOND: Final = 1_000_000_000  # [ns]


class Scenes(NamedTuple):
    """One scene for each of K pushes."""

    disks: Disks
    rows: ndarray  # (K,) where in `disks`
    counts: ndarray  # (K,) of disks
    settled: ndarray  # (K,)
    numbers: ndarray  # (K,) scene ids
    stamps: ndarray  # (K,) [ns] simulated time

    def take(self, chosen: ndarray, count: int) -> ndarray:
        """Return those of some pushes that have so many disks, (len(chosen), count, 8)."""
        return self.disks.scenes(self.rows[chosen], count)

    def one(self, push: int) -> Scene:
        """Return the scene of one push, whatever it holds."""
        return self.take(np.array([push]), int(self.counts[push]))[0]


class PushGroup:
    """K pushes with the scenes before and after them."""

    def __init__(self, pushes: Sequence[Paired], places: Sequence[int], source: str) -> None:
        """Look up what is known of pushes that have scenes from this source."""
        self.pushes, self.source = [pushes[place] for place in places], source
        self.places = np.array(places)
        if source == FROM_RESULT:
            results, rows = gather(_there([paired.result for paired in self.pushes]))
            self.before = _scenes(results.columns, results.disks, rows, "before.")
            self.after = _scenes(results.columns, results.disks, rows, "after.")
            self.actions = _numbers(results.columns, rows, [f"push.{n}" for n in PUSH_NAMES])
            self.durations = results.columns["duration"][rows]
        else:
            self.before = _settled_scenes([paired.before for paired in self.pushes])
            self.after = _settled_scenes([paired.after for paired in self.pushes])
            table, rows = gather(_there([paired.push for paired in self.pushes]))
            self.actions = _numbers(table.columns, rows, PUSH_NAMES)
            self.durations = 1e-9 * (self.after.stamps - self.before.stamps)
        self.goals = self._goals()  # (K, 3) x, y, tolerance; NaN: none was given
        self.predicted = np.zeros(len(self.pushes), dtype=bool)
        self.models = np.full(len(self.pushes), "", dtype=object)
        self._predictions = self._find_predictions()

    def predictions(self, chosen: ndarray, count: int) -> ndarray:
        """Return f_p(s, a) of pushes, (len(chosen), count, 8); NaN: not as many disks, or none."""
        scenes = np.full((len(chosen), count, len(STATE_NAMES)), np.nan)
        if self._predictions is not None:
            disks, rows = self._predictions
            fitting = self.predicted[chosen] & (disks.counts[rows[chosen]] == count)
            scenes[fitting] = disks.scenes(rows[chosen[fitting]], count)
        return scenes

    def about(self, push: int) -> str:
        """Return in words which push it is."""
        return about(self.pushes[push])

    def why_senseless(self, push: int) -> str:
        """Return what is wrong with the scenes, the push or the prediction."""
        try:
            before = _possible(self.before.one(push), "scene before")
            after = _possible(self.after.one(push), "scene after")
            if len(before) != len(after):
                raise InvalidInputError(f"{len(before)} disks before the push, {len(after)} after")
            check_fields(self.actions[push], PUSH_NAMES, "push")
            if self._predictions is not None and self.predicted[push]:
                disks, rows = self._predictions
                count = int(disks.counts[rows[push]])
                check_disks(disks.scenes(rows[[push]], count)[0], "prediction")
                raise InvalidInputError(f"{len(before)} disks, {count} in the prediction")
        except InvalidInputError as error:
            return str(error)
        raise AssertionError(f"nothing is wrong with {self.about(push)}")

    def why_no_goal(self, push: int) -> str:
        """Return what is wrong with the goal."""
        try:
            check_fields(self.goals[push], GOAL_FIELDS, "goal")
        except InvalidInputError as error:
            return str(error)
        raise AssertionError(f"nothing is wrong with the goal of {self.about(push)}")

    def _goals(self) -> ndarray:
        goals = np.full((len(self.pushes), len(GOAL_FIELDS)), np.nan)
        self.given = np.array([paired.goal is not None for paired in self.pushes])
        if self.given.any():
            table, rows = gather([p.goal for p in self.pushes if p.goal is not None])
            goals[self.given] = _numbers(table.columns, rows, GOAL_FIELDS)
        return goals

    def _find_predictions(self) -> tuple[Disks, ndarray] | None:
        there = np.array([paired.prediction is not None for paired in self.pushes])
        if not there.any():
            return None
        table, found = gather([p.prediction for p in self.pushes if p.prediction is not None])
        rows = np.zeros(len(self.pushes), dtype=np.int64)
        rows[there] = found
        self.predicted[there] = table.columns["error_code"][found] == OK
        self.models[there] = table.columns["model"][found]
        return table.disks[DISKS], rows


def about(paired: Paired) -> str:
    """Return in words which push it is."""
    return f"push {paired.push_id} of episode {paired.place[0]}"


def _there(wheres: Sequence[Where | None]) -> list[Where]:
    """Return the same; all of them are there."""
    return [where for where in wheres if where is not None]


def _settled_scenes(wheres: Sequence[Where | None]) -> Scenes:
    table, rows = gather(_there(wheres))
    return _scenes(table.columns, table.disks, rows, "")


def _scenes(
    columns: dict[str, ndarray], disks: dict[str, Disks], rows: ndarray, prefix: str
) -> Scenes:
    seconds = columns[f"{prefix}header.stamp.sec"][rows].astype(np.int64)
    return Scenes(
        disks[prefix + DISKS],
        rows,
        disks[prefix + DISKS].counts[rows],
        columns[f"{prefix}settled"][rows] != 0,
        columns[f"{prefix}scene_id"][rows],
        seconds * SECOND + columns[f"{prefix}header.stamp.nanosec"][rows].astype(np.int64),
    )


def _numbers(columns: dict[str, ndarray], rows: ndarray, names: Sequence[str]) -> ndarray:
    return np.stack([columns[name][rows].astype(np.float64) for name in names], axis=-1)


def _possible(scene: Scene, name: str) -> Scene:
    check_disks(scene, name)
    for column in (MASS, RADIUS):
        if (scene[:, column] <= 0.0).any():
            raise InvalidInputError(f"{name}: a {STATE_NAMES[column]} is not positive")
    return scene
