"""Pushes of a recording as rows of a data set, a batch at a time."""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.rows.dropped import (
    CHANGED,
    LIMITS,
    LONGEST,
    MIXED,
    NOT_MOVED,
    REFUSED,
    REPEATED,
    SENSELESS,
    UNPREDICTED,
    UNSETTLED,
    Dropped,
    named_push,
    why_changed,
    why_mixed,
    why_refused,
    why_senseless,
)
from sain_bags.rows.latched import NONE, PLACE, Extras, Latched
from sain_bags.rows.results import OK, Results
from sain_core.errors import InvalidInputError, SainError
from sain_core.model import Model
from sain_core.push import allowed_ranges, check_predictable
from sain_core.scene import MASS, POSITION, RADIUS, TARGET
from sain_core.shapes.bodies import Bodies, check_scenes
from sain_core.transitions import MOVED, SAME_KIND, Column, Columns, changed_kinds
from sain_core.types import Mask, Pushes, Scenes
from sain_core.wire import FRAMES, MIN_DISKS, check_fields

COMPUTED: Final = "computed:"  # prefix of a physics source: the recording has no prediction
FROM_RESULT: Final = "push_result"  # where the scenes of a row are from


class RowBlock(NamedTuple):
    """Rows whose scenes have one number of disks."""

    places: ndarray  # (M,) of their pushes among those that were given
    columns: Columns  # (M, ...) as in a shard, but for what numbers them


class RowsConfig(NamedTuple):
    """What becomes of pushes."""

    prior: str = "planar"
    moved_only: bool = False
    keep_unsettled: bool = False
    extras: Extras = Extras()


class RowMaker:
    """Makes rows of the pushes of one recording, or returns why a push is no row."""

    def __init__(self, config: RowsConfig, latched: Latched, prior: Callable[[], Model]) -> None:
        """Store the settings; the prior is called for when a push without a prediction comes."""
        self._config, self._latched, self._prior = config, latched, prior
        self._used = np.empty(0, dtype=np.uint64)  # ids of executed pushes

    def rows(self, results: Results) -> tuple[list[RowBlock], list[Dropped]]:
        """Return the rows of pushes, and those that are none, in their order."""
        pushes = _Sorting(results)
        codes = results.codes
        pushes.keep(codes == OK, REFUSED, why_refused)
        pushes.keep(~self._repeated(results, pushes.kept), REPEATED)
        pushes.keep(np.all([same for *_, same in results.ids], axis=0), MIXED, why_mixed)
        before, after = results.before, results.after
        if not self._config.keep_unsettled:
            pushes.keep(before.settled & after.settled, UNSETTLED)
        counts = before.counts
        alike = (counts == after.counts) & (counts >= MIN_DISKS)
        pushes.keep(alike, SENSELESS, why_senseless)
        blocks = [
            self._block(pushes, np.flatnonzero(pushes.kept & (counts == count)), int(count))
            for count in np.unique(counts[pushes.kept])
        ]
        return [block for block in blocks if len(block.places)], pushes.dropped

    def _repeated(self, results: Results, executed: Mask) -> Mask:
        """Return which pushes have the id of one that was executed earlier (K,)."""
        ids, places = results.push_ids, np.flatnonzero(executed)
        repeated = np.zeros(len(ids), dtype=bool)
        if len(self._used) and ids.min() <= self._used.max():  # ids are counted up mostly
            repeated = np.isin(ids, self._used) & executed
        _, first = np.unique(ids[places], return_index=True)
        again = np.ones(len(places), dtype=bool)
        again[first] = False
        repeated[places[again]] = True
        self._used = np.concatenate([self._used, ids[executed & ~repeated]])
        return repeated

    def _block(self, pushes: "_Sorting", chosen: ndarray, count: int) -> RowBlock:
        """Return the rows of pushes (M,) whose scenes have one number of disks N."""
        results = pushes.results
        before, after = results.before.take(chosen, count), results.after.take(chosen, count)
        physics, predicted = results.physics(chosen, count), results.predicted[chosen]
        sensible = _possible(before) & _possible(after) & (results.bodies[chosen] < count)
        sensible &= np.isfinite(results.actions[chosen]).all(axis=-1)
        for scenes in (results.before, results.after):
            sensible &= np.isin(scenes.frames[chosen].astype(np.str_), FRAMES)
        durations = results.durations[chosen]
        sensible &= (durations >= 0.0) & (durations <= LONGEST)
        sensible &= np.isfinite(physics).all(axis=(1, 2)) | ~predicted
        pushes.keep_of(chosen, sensible, SENSELESS, why_senseless)
        same = np.asarray((changed_kinds(before, after) <= SAME_KIND).all(axis=(1, 2)))
        pushes.keep_of(chosen, same, CHANGED, why_changed)
        lacking = np.flatnonzero(pushes.kept[chosen] & ~predicted)
        if len(lacking):
            physics[lacking], why = self._predict(before[lacking], results, chosen[lacking])
            known = np.array([not why.get(push) for push in chosen.tolist()], dtype=bool)
            pushes.keep_of(chosen, known, UNPREDICTED, lambda _, push: why[push])
        pushes.keep_of(chosen, _carried_out(results.actions[chosen]), SENSELESS, why_senseless)
        episodes = results.episodes[chosen]
        goals = self._latched.goals.chosen(episodes, results.log_times[chosen])
        sound = np.isfinite(self._latched.places(goals)).all(axis=-1)
        sound |= (goals == NONE) | np.isin(goals, list(self._latched.goals.poses))
        pushes.keep_of(chosen, sound, SENSELESS, self._why_no_goal)
        if self._config.moved_only:
            pushes.keep_of(chosen, _moved(before, after), NOT_MOVED)
        if not (kept := pushes.kept[chosen]).all():
            chosen, before, after, physics, episodes, goals = (
                array[kept] for array in (chosen, before, after, physics, episodes, goals)
            )
        if not len(chosen):
            return RowBlock(chosen, {})
        return RowBlock(
            chosen,
            _scene_columns(before, after, physics)
            | self._push_columns(results, chosen)
            | self._latched.columns(episodes, goals, count, self._config.extras),
        )

    def _why_no_goal(self, results: Results, push: int) -> str:
        """Return what is wrong with the goal of a push."""
        one = np.array([push])
        goals = self._latched.goals.chosen(results.episodes[one], results.log_times[one])
        try:
            check_fields(self._latched.places(goals)[0], PLACE, "goal")
        except InvalidInputError as error:
            return str(error)
        raise AssertionError(f"nothing is wrong with the goal of {named_push(results, push)}")

    def _push_columns(self, results: Results, chosen: ndarray) -> Columns:
        computed = COMPUTED + self._config.prior
        models = np.where(results.predicted, results.models, computed)[chosen]
        return {
            Column.ACTION: results.actions[chosen],
            Column.DURATION: results.durations[chosen],
            Column.PUSH_ID: results.push_ids[chosen].astype(np.uint64),
            Column.BAG_EPISODE: results.episodes[chosen].astype(np.uint64),
            Column.BAG_SCENE: results.before.numbers[chosen].astype(np.uint64),
            Column.OUTCOME: np.full(len(chosen), OK),
            Column.STAMP: results.before.stamps[chosen],
            Column.NEXT_STAMP: results.after.stamps[chosen],
            Column.LOG_TIME: results.log_times[chosen],
            Column.SOURCE: np.full(len(chosen), FROM_RESULT),
            Column.PHYSICS_SOURCE: models.astype(np.str_),
        }

    def _predict(
        self, scenes: Scenes, results: Results, chosen: ndarray
    ) -> tuple[Scenes, dict[int, str]]:
        """Return the prior's predictions (M, N, 8), and why it cannot predict a push, by place."""
        prior, name = self._prior(), self._config.prior
        actions, episodes = results.actions[chosen], results.episodes[chosen]
        predicted, reasons = np.zeros_like(scenes), dict[int, str]()
        for episode in np.unique(episodes).tolist():
            rows, bodies = np.flatnonzero(episodes == episode), self._latched.bodies_of(episode)
            try:
                predicted[rows] = _step(prior, scenes[rows], actions[rows], bodies)
            except SainError:  # one spoils all: each is looked at alone
                for row in rows.tolist():
                    one = slice(row, row + 1)
                    try:
                        predicted[one] = _step(prior, scenes[one], actions[one], bodies)
                    except SainError as error:
                        reasons[int(chosen[row])] = str(error)
        for row in np.flatnonzero(~np.isfinite(predicted).all(axis=(1, 2))).tolist():
            reasons[int(chosen[row])] = f"{name} predicted NaN or Inf"
        return predicted, reasons


class _Sorting:
    """Results, which of them are still to be rows, and why the others are none."""

    def __init__(self, results: Results) -> None:
        self.results = results
        self.kept = np.ones(len(results), dtype=bool)
        self._dropped: dict[int, Dropped] = {}

    @property
    def dropped(self) -> list[Dropped]:
        """Those that are no rows, in their order."""
        return [self._dropped[place] for place in sorted(self._dropped)]

    def keep(
        self, right: Mask, reason: str, why: Callable[[Results, int], str] | None = None
    ) -> None:
        """Drop the pushes that are not right (K,), with the reason and a detail of each, if any."""
        self.keep_of(np.arange(len(self.kept)), right, reason, why)

    def keep_of(
        self,
        chosen: ndarray,
        right: Mask,
        reason: str,
        why: Callable[[Results, int], str] | None = None,
    ) -> None:
        """Drop those of some pushes (M,) that are not right (M,)."""
        wrong = chosen[self.kept[chosen] & ~right]
        self.kept[wrong] = False
        for push in wrong.tolist():
            named = named_push(self.results, push)
            detail = f"{named}: {why(self.results, push)}" if why else named
            self._dropped[push] = Dropped(reason, detail)


def _step(prior: Model, scenes: Scenes, pushes: Pushes, bodies: Bodies) -> Scenes:
    """Return the prior's predictions (M, N, 8) of pushes that it can be asked about."""
    check_scenes(scenes, bodies)
    return prior.with_bodies(bodies).step(scenes, check_predictable(pushes))


def _possible(scenes: Scenes) -> Mask:
    """Return which scenes (M, N, 8) are of finite numbers within `LIMITS`."""
    within = np.isfinite(scenes).all(axis=(1, 2))
    for column, (least, most) in LIMITS.items():
        values = scenes[..., column]
        within &= ((values >= least) & (values <= most)).all(axis=1)
    return within


def _carried_out(pushes: Pushes) -> Mask:
    """Return which pushes (M, 5) an arm may have carried out, see `check_predictable`."""
    right = np.ones(len(pushes), dtype=bool)
    for column, least, most in allowed_ranges(stroke=False):
        right &= (pushes[:, column] >= least) & (pushes[:, column] <= most)
    return right


def _moved(before: Scenes, after: Scenes) -> Mask:
    """Return which pushes moved the target, or the only body, by 2 mm or more (M,)."""
    target = min(TARGET, before.shape[1] - 1)
    travel = after[:, target, POSITION] - before[:, target, POSITION]
    return np.asarray(np.hypot(travel[:, 0], travel[:, 1]) >= MOVED)


def _scene_columns(before: Scenes, after: Scenes, physics: Scenes) -> Columns:
    count = len(before)
    return {
        Column.STATE: before.reshape(count, -1),
        Column.PHYSICS_NEXT: physics.reshape(count, -1),
        Column.NEXT_STATE: after.reshape(count, -1),
        Column.MASSES: before[..., MASS],
        Column.RADII: before[..., RADIUS],
        Column.MOVED: _moved(before, after),
    }
