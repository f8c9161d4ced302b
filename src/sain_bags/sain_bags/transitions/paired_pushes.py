"""Pushes with the messages about them, as columns."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.transitions.message_fields import DISKS, GOAL_ID
from sain_bags.transitions.tables import Disks, Message, MessageTable, gather
from sain_core.errors import ErrorCode
from sain_core.push import PUSH_NAMES, pushed_bodies
from sain_core.scene import STATE_NAMES
from sain_core.types import Scene
from sain_core.wire import as_sent

OK: Final = int(ErrorCode.OK)
NONE: Final = -1  # in place of a row
FROM_RESULT: Final = "push_result"  # where the scenes of a row are from
FROM_SCENES: Final = "scenes"
FIELDS_OF: Final = {  # prefixes of the fields of the push, the scene before and the one after
    FROM_RESULT: ("push.", "before.", "after."),
    FROM_SCENES: ("", "", ""),
}
IDS: Final = np.dtype(
    [
        ("push_id", "u8"),
        ("planned_in", "u8"),  # episode that the push names
        ("planned_from", "u8"),  # id of the scene that it names
        ("episode", "u8"),  # that the result names, if there is one
        ("code", "i8"),  # of the result; 0: there is none
        ("log_time", "i8"),  # [ns since the epoch] of the first message about it
    ]
)
GOAL_FIELDS: Final = ("x", "y", "tolerance")
SECOND: Final = 1_000_000_000  # [ns]

SceneId = tuple[int, int]  # episode_id and scene_id

Found = tuple[MessageTable, ndarray]  # messages: the table that they are in, and their rows


class PushScenes(NamedTuple):
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


@dataclass(slots=True)
class PendingPush:
    """One push while its messages come in; what is None was not found."""

    push_id: int
    planned_from: SceneId
    log_time: int  # [ns since the epoch], of the first message about it
    push: Message | None = None  # needed where there is no result
    result: Message | None = None
    code: int = 0  # of the result, 0: there is none
    episode_id: int = 0  # as the result has it, or the push
    prediction: Message | None = None
    before: Message | None = None  # scene, settled; looked for where results are missing
    after: Message | None = None
    goal: Message | None = None
    repeated: bool = False  # its id had been used before
    ambiguous: bool = False  # another one may be what moved the scene, and there is no result
    released: bool = False  # messages from now on are too late

    @property
    def refused(self) -> bool:
        """Whether a result states that it moved nothing."""
        return self.result is not None and self.code != OK


@dataclass(frozen=True)
class PairedPushes:
    """K pushes; the scenes of all are from results, or of all from scene messages."""

    places: ndarray  # (K,) their order among all pushes that were paired at once
    ids: ndarray  # (K,) `IDS`
    predictions: Found | None  # rows (K,), `NONE` where there is none; None: there are none at all
    source: str  # of the scenes: `FROM_RESULT` or `FROM_SCENES`
    messages: tuple[Found, Found, Found]  # with push, scene before, scene after; all the results
    goals: Sequence[Message] = ()
    goal_of: ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))  # (K,) in goals

    def __len__(self) -> int:
        """Return how many pushes there are."""
        return len(self.places)

    @cached_property
    def before(self) -> PushScenes:
        """The scenes before the pushes."""
        return _scenes(self.messages[1], FIELDS_OF[self.source][1])

    @cached_property
    def after(self) -> PushScenes:
        """The scenes after the pushes."""
        return _scenes(self.messages[2], FIELDS_OF[self.source][2])

    @cached_property
    def actions(self) -> ndarray:
        """The pushes (K, 5)."""
        prefix = FIELDS_OF[self.source][0]
        return as_sent(_numbers(self.messages[0], [prefix + name for name in PUSH_NAMES]))

    @cached_property
    def bodies(self) -> ndarray:
        """The body that each push is against (K,)."""
        return pushed_bodies(self.actions)

    @cached_property
    def goal_ids(self) -> ndarray:
        """The id of each push's goal (K,); 0: it has none."""
        ids = np.zeros(len(self), dtype=np.uint64)
        if self.goals:
            table, rows = gather(self.goals)
            ids[self.given] = table.columns[GOAL_ID][rows][self.goal_of[self.given]]
        return ids

    @cached_property
    def durations(self) -> ndarray:
        """How long the pushes took (K,) [s], simulated."""
        if self.source == FROM_RESULT:
            return _numbers(self.messages[0], ["duration"])[:, 0]
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
        """Return some of the pushes, which have no goals yet."""
        sent, before, after = ((table, rows[chosen]) for table, rows in self.messages)
        predictions = self.predictions and (self.predictions[0], self.predictions[1][chosen])
        ids, messages = self.ids[chosen], (sent, before, after)
        places = np.arange(len(ids))
        return PairedPushes(places, ids, predictions, self.source, messages)


def as_columns(pushes: Sequence[PendingPush], places: Sequence[int]) -> PairedPushes:
    """Return some pushes as columns; either all of them have a result, or none has."""
    chosen = [pushes[place] for place in places]
    given = np.array([push.goal is not None for push in chosen])
    predicted = np.array([push.prediction is not None for push in chosen])
    predictions = None
    if predicted.any():
        table, found = gather(_there([push.prediction for push in chosen]))
        rows = np.full(len(chosen), NONE)
        rows[predicted] = found
        predictions = (table, rows)
    rows_of_ids = [
        (push.push_id, *push.planned_from, push.episode_id, push.code, push.log_time)
        for push in chosen
    ]
    ids = np.array(rows_of_ids, dtype=IDS)
    goals = _there([push.goal for push in chosen])
    goal_of = np.where(given, np.cumsum(given) - 1, NONE)
    if chosen[0].result is not None:
        results = gather(_there([push.result for push in chosen]))
        messages, source = (results, results, results), FROM_RESULT
    else:
        sent = gather(_there([push.push for push in chosen]))
        before = gather(_there([push.before for push in chosen]))
        after = gather(_there([push.after for push in chosen]))
        messages, source = (sent, before, after), FROM_SCENES
    return PairedPushes(np.array(places), ids, predictions, source, messages, goals, goal_of)


def _there(messages: Sequence[Message | None]) -> list[Message]:
    """Return the messages that are not None."""
    return [message for message in messages if message is not None]


def _scenes(found: Found, prefix: str) -> PushScenes:
    table, rows = found
    columns, disks = table.columns, table.disks[prefix + DISKS]
    seconds = columns[f"{prefix}header.stamp.sec"][rows].astype(np.int64)
    return PushScenes(
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
