"""Pushes of a recording as rows of a data set, by the thousand; and why a push is none."""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.transitions.pairing import OK, Paired
from sain_bags.transitions.push_groups import (
    FROM_RESULT,
    FROM_SCENES,
    PushGroup,
    about,
    told_of_each,
    told_of_run,
)
from sain_bags.transitions.push_run import PushRun
from sain_bags.transitions.row_draft import Draft, Dropped, drop
from sain_core.dynamics import Dynamics
from sain_core.errors import ErrorCode, SainError
from sain_core.push import check_predictable
from sain_core.scene import check_scenes
from sain_core.types import Pushes, Scenes
from sain_core.wire import MIN_DISKS

COMPUTED: Final = "computed:"  # prefix of a physics source: the recording has no prediction

# Why a push is no row.
REFUSED: Final = "refused"
REPEATED: Final = "push id used before"
UNANSWERED: Final = "no result, and no settled scenes around it"
AMBIGUOUS: Final = "no result, and another push from the same scene"
UNSETTLED: Final = "scene before or after not settled"
SENSELESS: Final = "makes no sense"
UNPREDICTED: Final = "not predicted, and the prior cannot"
NOT_MOVED: Final = "target moved by less than 2 mm"


class Block(NamedTuple):
    """Rows whose scenes have one number of disks."""

    places: ndarray  # (M,) of their pushes among those that were given
    columns: dict[str, ndarray]  # (M, ...) as in a shard, but for what numbers them


class RowMaker:
    """Makes rows of pushes, or says why one is none."""

    def __init__(
        self,
        prior: Callable[[], Dynamics],
        prior_name: str,
        moved_only: bool = False,
        keep_unsettled: bool = False,
    ) -> None:
        """Filter so, and predict with this prior, made when it is needed first, what is not."""
        self._make_prior, self._prior_name = prior, prior_name
        self._prior: Dynamics | None = None
        self._moved_only, self._keep_unsettled = moved_only, keep_unsettled

    def rows(self, pushes: Sequence[Paired] | PushRun) -> tuple[list[Block], list[Dropped]]:
        """Return the rows of pushes, by numbers of disks, and those that are none, in order."""
        dropped: dict[int, Dropped] = {}
        if isinstance(pushes, PushRun):
            group = PushGroup(FROM_RESULT, np.arange(len(pushes)), told_of_run(pushes))
            blocks = self._blocks(group, dropped)
        else:
            blocks = []
            for source, places in _chosen(pushes, dropped).items():
                told = told_of_each([pushes[place] for place in places], source)
                blocks += self._blocks(PushGroup(source, np.array(places), told), dropped)
        return _merged(blocks), [dropped[place] for place in sorted(dropped)]

    def _blocks(self, group: PushGroup, dropped: dict[int, Dropped]) -> list[Block]:
        before, after = group.before, group.after
        left = np.ones(len(group.places), dtype=bool)
        if not self._keep_unsettled:
            left &= before.settled & after.settled
            drop(group, np.flatnonzero(~left), UNSETTLED, _no_detail, dropped)
        alike = (before.counts == after.counts) & (before.counts >= MIN_DISKS)
        drop(group, np.flatnonzero(left & ~alike), SENSELESS, group.why_senseless, dropped)
        left &= alike
        return [
            self._block(group, np.flatnonzero(left & (before.counts == count)), dropped)
            for count in np.unique(before.counts[left])
        ]

    def _block(self, group: PushGroup, chosen: ndarray, dropped: dict[int, Dropped]) -> Block:
        """Return the rows of pushes whose scenes have one number of disks."""
        count = int(group.before.counts[chosen[0]])
        scenes = (group.before.take(chosen, count), group.after.take(chosen, count))
        draft = Draft(group, dropped, chosen, *scenes, group.predictions(chosen, count))
        draft.keep(draft.sensible(), SENSELESS, group.why_senseless)
        self._predict_rest(draft)
        finite = np.isfinite(group.goals).all(axis=-1) | ~group.given
        draft.keep(finite[draft.chosen], SENSELESS, group.why_no_goal)
        if self._moved_only:
            draft.keep(draft.moved(), NOT_MOVED, _no_detail)
        return Block(group.places[draft.chosen], draft.columns() | self._told(group, draft.chosen))

    def _predict_rest(self, draft: Draft) -> None:
        """Let the prior predict what was not predicted."""
        lacking = np.flatnonzero(~draft.group.predicted[draft.chosen])
        if not len(lacking):
            return
        pushes = draft.chosen[lacking]
        computed, reasons = self._predict(draft.state[lacking], draft.group.actions[pushes])
        draft.physics[lacking] = computed
        why = {int(pushes[place]): reason for place, reason in reasons.items()}
        draft.keep(~np.isin(draft.chosen, list(why)), UNPREDICTED, why.__getitem__)

    def _told(self, group: PushGroup, chosen: ndarray) -> dict[str, ndarray]:
        told = group.told
        models = np.where(group.predicted, group.models, COMPUTED + self._prior_name)[chosen]
        return {
            "action": group.actions[chosen],
            "duration": group.durations[chosen],
            "goal": group.goals[chosen, :2],
            "tolerance": group.goals[chosen, 2],
            "push_id": told.push_ids[chosen],
            "bag_episode": told.episodes[chosen],
            "bag_scene": group.before.numbers[chosen].astype(np.uint64),
            "outcome": told.codes[chosen],
            "stamp": group.before.stamps[chosen],
            "next_stamp": group.after.stamps[chosen],
            "log_time": told.times[chosen],
            "source": np.full(len(chosen), group.source),
            "physics_source": models.astype(np.str_),
        }

    def _predict(self, scenes: Scenes, pushes: Pushes) -> tuple[Scenes, dict[int, str]]:
        """Return what the prior predicts (M, N, 8), and for which it cannot, with the reason."""
        if self._prior is None:
            self._prior = self._make_prior()
        reasons: dict[int, str] = {}
        try:
            predicted = self._prior.step(check_scenes(scenes), check_predictable(pushes))
        except SainError:  # one spoils all: each is looked at alone
            predicted = np.zeros_like(scenes)
            for row in range(len(scenes)):
                one = slice(row, row + 1)
                try:
                    checked = check_scenes(scenes[one]), check_predictable(pushes[one])
                    predicted[one] = self._prior.step(*checked)
                except SainError as error:
                    reasons[row] = str(error)
        for row in np.flatnonzero(~np.isfinite(predicted).all(axis=(1, 2))).tolist():
            reasons[row] = f"{self._prior_name} predicted NaN or Inf"
        return predicted, reasons


def _chosen(pushes: Sequence[Paired], dropped: dict[int, Dropped]) -> dict[str, list[int]]:
    """Return the places of pushes that may be rows, by the source of their scenes."""
    chosen: dict[str, list[int]] = {}
    for place, paired in enumerate(pushes):
        if (found := _dismissed(paired)) is not None:
            dropped[place] = found
        else:
            source = FROM_SCENES if paired.result is None else FROM_RESULT
            chosen.setdefault(source, []).append(place)
    return chosen


def _dismissed(paired: Paired) -> Dropped | None:
    """Return why a push is no row; None: it may be one."""
    named = about(paired.push_id, paired.place[0])
    if paired.result is not None and paired.code != OK:
        table, row = paired.result
        message = table.columns["error_message"][row]
        return Dropped(REFUSED, f"{named}: {_code_name(paired.code)}: {message}")
    if paired.repeated:
        return Dropped(REPEATED, named)
    if paired.ambiguous:
        return Dropped(AMBIGUOUS, named)
    if paired.result is None and (paired.before is None or paired.after is None):
        return Dropped(UNANSWERED, named)
    return None


def _no_detail(_: int) -> str:
    return ""


def _merged(blocks: list[Block]) -> list[Block]:
    """Return blocks of rows in their order, one for each number of disks."""
    merged: dict[int, Block] = {}
    for block in blocks:
        disks = block.columns["masses"].shape[1]
        if disks in merged:
            places = np.concatenate([merged[disks].places, block.places])
            order = np.argsort(places)
            first = merged[disks].columns
            columns = {
                name: np.concatenate([first[name], column])[order]
                for name, column in block.columns.items()
            }
            merged[disks] = Block(places[order], columns)
        else:
            merged[disks] = block
    return [block for block in merged.values() if len(block.places)]


def _code_name(code: int) -> str:
    return ErrorCode(code).name if code in set(ErrorCode) else f"error {code}"
