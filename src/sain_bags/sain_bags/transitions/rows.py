"""Pushes of a recording as rows of a data set, a batch at a time."""

from collections.abc import Callable
from itertools import groupby
from typing import Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.transitions.dropped import (
    NOT_MOVED,
    SENSELESS,
    UNPREDICTED,
    UNSETTLED,
    Dropped,
    drop,
    why_no_goal,
    why_no_row,
    why_senseless,
)
from sain_bags.transitions.message_fields import GOAL_ID
from sain_bags.transitions.paired_pushes import PairedPushes, as_columns
from sain_bags.transitions.pairing import Paired
from sain_core.errors import SainError
from sain_core.model import Model
from sain_core.push import check_predictable
from sain_core.scene import MASS, POSITION, RADIUS, TARGET
from sain_core.shapes.bodies import PAPER_DISKS, Bodies, check_scenes
from sain_core.transitions import MOVED, Column
from sain_core.types import Pushes, Scenes
from sain_core.wire import MIN_DISKS

COMPUTED: Final = "computed:"  # prefix of a physics source: the recording has no prediction


EpisodeBodies = Callable[[int], Bodies]  # by the episode's id in the bag


class RowBlock(NamedTuple):
    """Rows whose scenes have one number of disks."""

    places: ndarray  # (M,) of their pushes among those that were given
    columns: dict[str, ndarray]  # (M, ...) as in a shard, but for what numbers them


class RowMaker:
    """Makes rows of pushes, or returns why a push is no row."""

    def __init__(
        self,
        prior: Callable[[], Model],
        prior_name: str,
        moved_only: bool = False,
        keep_unsettled: bool = False,
    ) -> None:
        """Store the settings; the prior is made when a push without a prediction comes."""
        self._make_prior, self._prior_name = prior, prior_name
        self._prior: Model | None = None
        self._moved_only, self._keep_unsettled = moved_only, keep_unsettled

    def rows(
        self, pushes: Paired, bodies: EpisodeBodies = lambda _: PAPER_DISKS
    ) -> tuple[list[RowBlock], list[Dropped]]:
        """Return the rows of pushes, and those that are none, in their order.

        `bodies` returns those of an episode by its id; by default the paper's disks.
        """
        dropped: dict[int, Dropped] = {}
        if isinstance(pushes, PairedPushes):
            blocks = self._blocks(pushes, dropped, bodies)
        else:
            blocks, left = [], []
            for place, push in enumerate(pushes):
                if (found := why_no_row(push)) is None:
                    left.append(place)
                else:
                    dropped[place] = found
            for _, places in groupby(left, key=lambda place: pushes[place].result is None):
                blocks += self._blocks(as_columns(pushes, list(places)), dropped, bodies)
        blocks = [block for block in blocks if len(block.places)]
        return blocks, [dropped[place] for place in sorted(dropped)]

    def _blocks(
        self, pushes: PairedPushes, dropped: dict[int, Dropped], bodies: EpisodeBodies
    ) -> list[RowBlock]:
        before, after = pushes.before, pushes.after
        left = np.ones(len(pushes), dtype=bool)
        if not self._keep_unsettled:
            left &= before.settled & after.settled
            drop(pushes, np.flatnonzero(~left), UNSETTLED, None, dropped)
        alike = (before.counts == after.counts) & (before.counts >= MIN_DISKS)
        drop(pushes, np.flatnonzero(left & ~alike), SENSELESS, why_senseless, dropped)
        left &= alike
        return [
            self._block(pushes, np.flatnonzero(left & (before.counts == count)), dropped, bodies)
            for count in np.unique(before.counts[left])
        ]

    def _block(
        self,
        pushes: PairedPushes,
        chosen: ndarray,
        dropped: dict[int, Dropped],
        bodies: EpisodeBodies,
    ) -> RowBlock:
        """Return the rows of pushes (M,) whose scenes have one number of disks N."""
        count = int(pushes.before.counts[chosen[0]])
        before, after = pushes.before.take(chosen, count), pushes.after.take(chosen, count)
        physics, predicted = pushes.physics(chosen, count), pushes.predicted[chosen]
        kept = np.ones(len(chosen), dtype=bool)

        def keep(
            right: ndarray, reason: str, why: Callable[[PairedPushes, int], str] | None = None
        ) -> None:
            drop(pushes, chosen[kept & ~right], reason, why, dropped)
            np.logical_and(kept, right, out=kept)

        sensible = _possible(before) & _possible(after)
        sensible &= np.isfinite(pushes.actions[chosen]).all(axis=-1)
        sensible &= pushes.bodies[chosen] < count
        sensible &= np.isfinite(physics).all(axis=(1, 2)) | ~predicted
        keep(sensible, SENSELESS, why_senseless)
        lacking = np.flatnonzero(kept & ~predicted)
        if len(lacking):
            computed, reasons = self._predict(before[lacking], pushes, chosen[lacking], bodies)
            physics[lacking] = computed
            why = {int(chosen[lacking[place]]): reason for place, reason in reasons.items()}
            keep(~np.isin(chosen, list(why)), UNPREDICTED, lambda _, push: why[push])
        finite = np.isfinite(pushes.goal_values).all(axis=-1) | ~pushes.given
        keep(finite[chosen], SENSELESS, why_no_goal)
        if self._moved_only:
            keep(_moved(before, after), NOT_MOVED)
        if not kept.all():
            chosen, before, after, physics = (
                array[kept] for array in (chosen, before, after, physics)
            )
        columns = _scene_columns(before, after, physics) | self._push_columns(pushes, chosen)
        return RowBlock(pushes.places[chosen], columns)

    def _push_columns(self, pushes: PairedPushes, chosen: ndarray) -> dict[str, ndarray]:
        computed, ids = COMPUTED + self._prior_name, pushes.ids[chosen]
        models = np.where(pushes.predicted, pushes.models, computed)[chosen]
        return {
            Column.ACTION: pushes.actions[chosen],
            GOAL_ID: pushes.goal_ids[chosen],
            Column.DURATION: pushes.durations[chosen],
            Column.GOAL: pushes.goal_values[chosen, :2],
            Column.TOLERANCE: pushes.goal_values[chosen, 2],
            Column.PUSH_ID: ids["push_id"],
            Column.BAG_EPISODE: ids["episode"],
            Column.BAG_SCENE: pushes.before.numbers[chosen].astype(np.uint64),
            Column.OUTCOME: ids["code"],
            Column.STAMP: pushes.before.stamps[chosen],
            Column.NEXT_STAMP: pushes.after.stamps[chosen],
            Column.LOG_TIME: ids["log_time"],
            Column.SOURCE: np.full(len(chosen), pushes.source),
            Column.PHYSICS_SOURCE: models.astype(np.str_),
        }

    def _predict(
        self, scenes: Scenes, pushes: PairedPushes, chosen: ndarray, bodies: EpisodeBodies
    ) -> tuple[Scenes, dict[int, str]]:
        """Return the prior's predictions (M, N, 8), and the reason for each that it cannot make."""
        if self._prior is None:
            self._prior = self._make_prior()
        actions = pushes.actions[chosen]
        predicted, reasons = np.zeros_like(scenes), dict[int, str]()
        episodes = pushes.ids["episode"][chosen]
        for episode in np.unique(episodes).tolist():
            rows, known = np.flatnonzero(episodes == episode), bodies(episode)
            try:
                predicted[rows] = _step(self._prior, scenes[rows], actions[rows], known)
            except SainError:  # one spoils all: each is looked at alone
                for row in rows.tolist():
                    one = slice(row, row + 1)
                    try:
                        predicted[one] = _step(self._prior, scenes[one], actions[one], known)
                    except SainError as error:
                        reasons[row] = str(error)
        for row in np.flatnonzero(~np.isfinite(predicted).all(axis=(1, 2))).tolist():
            reasons[row] = f"{self._prior_name} predicted NaN or Inf"
        return predicted, reasons


def _step(prior: Model, scenes: Scenes, pushes: Pushes, bodies: Bodies) -> Scenes:
    """Return the prior's predictions (M, N, 8) of pushes that it can be asked about."""
    check_scenes(scenes, bodies)
    return prior.with_bodies(bodies).step(scenes, check_predictable(pushes))


def _possible(scenes: Scenes) -> ndarray:
    """Return which scenes (M, N, 8) are of finite numbers, with masses and radii."""
    finite = np.isfinite(scenes).all(axis=(1, 2))
    return finite & (scenes[..., [MASS, RADIUS]] > 0.0).all(axis=(1, 2))


def _moved(before: Scenes, after: Scenes) -> ndarray:
    """Return which pushes moved the target, or the only body, by 2 mm or more (M,)."""
    target = min(TARGET, before.shape[1] - 1)
    travel = after[:, target, POSITION] - before[:, target, POSITION]
    return np.asarray(np.hypot(travel[:, 0], travel[:, 1]) >= MOVED)


def _scene_columns(before: Scenes, after: Scenes, physics: Scenes) -> dict[str, ndarray]:
    count = len(before)
    return {
        Column.STATE: before.reshape(count, -1),
        Column.PHYSICS_NEXT: physics.reshape(count, -1),
        Column.NEXT_STATE: after.reshape(count, -1),
        Column.MASSES: before[..., MASS],
        Column.RADII: before[..., RADIUS],
        Column.MOVED: _moved(before, after),
    }
