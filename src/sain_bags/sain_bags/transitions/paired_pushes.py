"""Pushes with the messages about them, as columns."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.transitions.tables import Disks, Message, Table, gather
from sain_bags.transitions.wanted_fields import DISKS
from sain_core.errors import ErrorCode, InvalidInputError
from sain_core.push import PUSH_NAMES
from sain_core.scene import MASS, RADIUS, STATE_NAMES
from sain_core.types import Scene
from sain_core.wire import check_disks, check_fields

OK: Final = int(ErrorCode.OK)
NONE: Final = -1  # in place of a row
FROM_RESULT: Final = "push_result"  # where the scenes of a row are from
FROM_SCENES: Final = "scenes"
GOAL_FIELDS: Final = ("x", "y", "tolerance")
SECOND: Final = 1_000_000_000  # [ns]

Found = tuple[Table, ndarray]  # messages: the table that they are in, and their rows


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


@dataclass(frozen=True)
class PairedPushes:
    """K pushes; the scenes of all are from results, or of all from scene messages."""

    places: ndarray  # (K,) their order among all pushes that were paired at once
    push_ids: ndarray  # (K,)
    planned_in: ndarray  # (K,) episode that the push names
    planned_from: ndarray  # (K,) id of the scene that it names
    episodes: ndarray  # (K,) that the result names, if there is one
    codes: ndarray  # (K,) of the results; 0: there is none
    times: ndarray  # (K,) [ns since the epoch] of the first message about each
    predictions: Found | None  # rows (K,), `NONE` where there is none; None: there are none at all
    results: Found | None = None
    pushes: Found | None = None  # and the scenes before and after, where there are no results
    scenes: tuple[Found, Found] | None = None
    goals: Sequence[Message] = ()
    goal_of: ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))  # (K,) in goals

    def __len__(self) -> int:
        """Return how many pushes there are."""
        return len(self.places)

    @property
    def source(self) -> str:
        """Where the scenes are from."""
        return FROM_SCENES if self.results is None else FROM_RESULT

    @cached_property
    def before(self) -> Scenes:
        """The scenes before the pushes."""
        if self.results is not None:
            return _scenes(self.results, "before.")
        assert self.scenes is not None
        return _scenes(self.scenes[0])

    @cached_property
    def after(self) -> Scenes:
        """The scenes after the pushes."""
        if self.results is not None:
            return _scenes(self.results, "after.")
        assert self.scenes is not None
        return _scenes(self.scenes[1])

    @cached_property
    def actions(self) -> ndarray:
        """Location, angle and length of the pushes (K, 3)."""
        if self.results is not None:
            return _numbers(self.results, [f"push.{name}" for name in PUSH_NAMES])
        assert self.pushes is not None
        return _numbers(self.pushes, PUSH_NAMES)

    @cached_property
    def durations(self) -> ndarray:
        """How long the pushes took (K,) [s], simulated."""
        if self.results is not None:
            return _numbers(self.results, ["duration"])[:, 0]
        return np.asarray(1e-9 * (self.after.stamps - self.before.stamps))

    @cached_property
    def given(self) -> ndarray:
        """Which pushes have a goal (K,)."""
        return np.asarray(self.goal_of != NONE)

    @cached_property
    def goal_values(self) -> ndarray:
        """Goal x, y and tolerance (K, 3) [m]; NaN: none was given."""
        values = np.full((len(self), len(GOAL_FIELDS)), np.nan)
        if self.goals:
            goals = _numbers(gather(self.goals), GOAL_FIELDS)
            values[self.given] = goals[self.goal_of[self.given]]
        return values

    @cached_property
    def predicted(self) -> ndarray:
        """Which pushes have a prediction without an error (K,)."""
        if self.predictions is None:
            return np.zeros(len(self), dtype=bool)
        table, rows = self.predictions
        return (rows != NONE) & (table.columns["error_code"][rows] == OK)

    @cached_property
    def models(self) -> ndarray:
        """What predicted each push (K,); empty: nothing did."""
        if self.predictions is None:
            return np.full(len(self), "", dtype=object)
        table, rows = self.predictions
        return np.where(rows != NONE, table.columns["model"][rows], "")

    def physics(self, chosen: ndarray, count: int) -> ndarray:
        """Return f_p(s, a) of pushes, (len(chosen), count, 8); NaN: not as many disks, or none."""
        scenes = np.full((len(chosen), count, len(STATE_NAMES)), np.nan)
        if self.predictions is not None:
            table, rows = self.predictions
            disks = table.disks[DISKS]
            fitting = self.predicted[chosen] & (disks.counts[rows[chosen]] == count)
            scenes[fitting] = disks.scenes(rows[chosen[fitting]], count)
        return scenes

    def part(self, chosen: slice) -> "PairedPushes":
        """Return some of the pushes, which have results and no goals yet."""
        assert self.results is not None
        return PairedPushes(
            np.arange(len(self.places[chosen])),
            self.push_ids[chosen],
            self.planned_in[chosen],
            self.planned_from[chosen],
            self.episodes[chosen],
            self.codes[chosen],
            self.times[chosen],
            self.predictions and (self.predictions[0], self.predictions[1][chosen]),
            (self.results[0], self.results[1][chosen]),
        )

    def about(self, push: int) -> str:
        """Return in words which push it is."""
        return about(int(self.push_ids[push]), int(self.planned_in[push]))

    def why_senseless(self, push: int) -> str:
        """Return what is wrong with the scenes, the push or the prediction."""
        try:
            before = _possible(self.before.one(push), "scene before")
            after = _possible(self.after.one(push), "scene after")
            if len(before) != len(after):
                raise InvalidInputError(f"{len(before)} disks before the push, {len(after)} after")
            check_fields(self.actions[push], PUSH_NAMES, "push")
            if self.predictions is not None and self.predicted[push]:
                table, rows = self.predictions
                disks = table.disks[DISKS]
                count = int(disks.counts[rows[push]])
                check_disks(disks.scenes(rows[[push]], count)[0], "prediction")
                raise InvalidInputError(f"{len(before)} disks, {count} in the prediction")
        except InvalidInputError as error:
            return str(error)
        raise AssertionError(f"nothing is wrong with {self.about(push)}")

    def why_no_goal(self, push: int) -> str:
        """Return what is wrong with the goal."""
        try:
            check_fields(self.goal_values[push], GOAL_FIELDS, "goal")
        except InvalidInputError as error:
            return str(error)
        raise AssertionError(f"nothing is wrong with the goal of {self.about(push)}")


def about(push_id: int, episode: int) -> str:
    """Return in words which push it is."""
    return f"push {push_id} of episode {episode}"


def _scenes(found: Found, prefix: str = "") -> Scenes:
    table, rows = found
    columns, disks = table.columns, table.disks[prefix + DISKS]
    seconds = columns[f"{prefix}header.stamp.sec"][rows].astype(np.int64)
    return Scenes(
        disks,
        rows,
        disks.counts[rows],
        columns[f"{prefix}settled"][rows] != 0,
        columns[f"{prefix}scene_id"][rows],
        seconds * SECOND + columns[f"{prefix}header.stamp.nanosec"][rows].astype(np.int64),
    )


def _numbers(found: Found, names: Sequence[str]) -> ndarray:
    table, rows = found
    return np.stack([table.columns[name][rows].astype(np.float64) for name in names], axis=-1)


def _possible(scene: Scene, name: str) -> Scene:
    check_disks(scene, name)
    for column in (MASS, RADIUS):
        if (scene[:, column] <= 0.0).any():
            raise InvalidInputError(f"{name}: a {STATE_NAMES[column]} is not positive")
    return scene
