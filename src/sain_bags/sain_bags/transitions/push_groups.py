"""Pushes whose scenes are all from results, or all from scenes, as columns."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.transitions.pairing import OK, Paired
from sain_bags.transitions.push_run import NONE, PushRun, Where
from sain_bags.transitions.tables import Disks, Table, gather
from sain_bags.transitions.wanted_fields import DISKS
from sain_core.errors import InvalidInputError
from sain_core.push import PUSH_NAMES
from sain_core.scene import MASS, RADIUS, STATE_NAMES
from sain_core.types import Scene
from sain_core.wire import check_disks, check_fields

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
class Told:
    """What is said of K pushes."""

    push_ids: ndarray  # (K,)
    planned_in: ndarray  # (K,) episode that the push names
    episodes: ndarray  # (K,) that the result names, if there is one
    codes: ndarray  # (K,) of the results; 0: there is none
    times: ndarray  # (K,) [ns since the epoch] of the first message about each
    goals: Sequence[Where]
    goal_of: ndarray  # (K,) in goals; `NONE`: none was given
    there: ndarray  # (K,) whether there is a prediction
    predictions: Found | None  # of those; None: there is none at all
    results: Found | None = None
    pushes: Found | None = None  # and the scenes before and after, where there are no results
    scenes: tuple[Found, Found] | None = None


def told_of_run(run: PushRun) -> Told:
    """Return what is said of the pushes of a run."""
    there = np.full(len(run), run.predictions is not None)
    return Told(
        run.column("push_id"),
        run.column("push.episode_id"),
        run.column("episode_id"),
        run.column("error_code").astype(np.int64),
        run.times,
        run.goals,
        run.goal_of,
        there,
        None if run.predictions is None else (run.predictions, run.prediction_rows),
        results=(run.results, run.rows),
    )


def told_of_each(pushes: Sequence[Paired], source: str) -> Told:
    """Return what is said of pushes that were told of one by one."""
    there = np.array([paired.prediction is not None for paired in pushes])
    goals = _there([paired.goal for paired in pushes])
    given = np.array([paired.goal is not None for paired in pushes])
    goal_of = np.where(given, np.cumsum(given) - 1, NONE)
    told = Told(
        np.array([paired.push_id for paired in pushes], dtype=np.uint64),
        np.array([paired.place[0] for paired in pushes], dtype=np.uint64),
        np.array([paired.episode_id for paired in pushes], dtype=np.uint64),
        np.array([paired.code for paired in pushes], dtype=np.int64),
        np.array([paired.log_time for paired in pushes], dtype=np.int64),
        goals,
        goal_of,
        there,
        gather(_there([p.prediction for p in pushes])) if there.any() else None,
    )
    if source == FROM_RESULT:
        return replace(told, results=gather(_there([paired.result for paired in pushes])))
    before, after = ([p.before for p in pushes], [p.after for p in pushes])
    scenes = gather(_there(before)), gather(_there(after))
    return replace(told, pushes=gather(_there([p.push for p in pushes])), scenes=scenes)


class PushGroup:
    """K pushes with the scenes before and after them."""

    def __init__(self, source: str, places: ndarray, told: Told) -> None:
        """Look up what is known of pushes.

        Args:
            source: of the scenes, `FROM_RESULT` or `FROM_SCENES`.
            places: (K,) of these pushes among all.
            told: what is said of them.
        """
        self.source, self.places, self.told = source, places, told
        if told.results is not None:
            table, rows = told.results
            self.before = _scenes(table, rows, "before.")
            self.after = _scenes(table, rows, "after.")
            self.actions = _numbers(table, rows, [f"push.{name}" for name in PUSH_NAMES])
            self.durations = table.columns["duration"][rows].astype(np.float64)
        else:
            assert told.scenes is not None and told.pushes is not None
            self.before, self.after = (_scenes(table, rows, "") for table, rows in told.scenes)
            table, rows = told.pushes
            self.actions = _numbers(table, rows, PUSH_NAMES)
            self.durations = 1e-9 * (self.after.stamps - self.before.stamps)
        self.given = told.goal_of != NONE
        self.goals = np.full((len(places), len(GOAL_FIELDS)), np.nan)  # NaN: none was given
        if told.goals:
            table, rows = gather(told.goals)
            goals = _numbers(table, rows, GOAL_FIELDS)
            self.goals[self.given] = goals[told.goal_of[self.given]]
        self.predicted, self.models, self._predictions = _predictions(told)

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
        return about(int(self.told.push_ids[push]), int(self.told.planned_in[push]))

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


def about(push_id: int, episode: int) -> str:
    """Return in words which push it is."""
    return f"push {push_id} of episode {episode}"


def _there(wheres: Sequence[Where | None]) -> list[Where]:
    """Return the same; all of them are there."""
    return [where for where in wheres if where is not None]


def _predictions(told: Told) -> tuple[ndarray, ndarray, tuple[Disks, ndarray] | None]:
    """Return which pushes are predicted (K,), by what (K,), and where, if any is."""
    predicted = np.zeros(len(told.there), dtype=bool)
    models = np.full(len(told.there), "", dtype=object)
    if told.predictions is None:
        return predicted, models, None
    table, found = told.predictions
    rows = np.zeros(len(told.there), dtype=np.int64)
    rows[told.there] = found
    predicted[told.there] = table.columns["error_code"][found] == OK
    models[told.there] = table.columns["model"][found]
    return predicted, models, (table.disks[DISKS], rows)


def _scenes(table: Table, rows: ndarray, prefix: str) -> Scenes:
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


def _numbers(table: Table, rows: ndarray, names: Sequence[str]) -> ndarray:
    return np.stack([table.columns[name][rows].astype(np.float64) for name in names], axis=-1)


def _possible(scene: Scene, name: str) -> Scene:
    check_disks(scene, name)
    for column in (MASS, RADIUS):
        if (scene[:, column] <= 0.0).any():
            raise InvalidInputError(f"{name}: a {STATE_NAMES[column]} is not positive")
    return scene
