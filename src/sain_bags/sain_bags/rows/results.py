"""Pushes as a recording has them: what was planned, what was sent, and what became of it.

Data set, report page and summaries read pushes here.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_bags.mcap.mcap_file import Batch
from sain_bags.reading.reader import Bag
from sain_bags.rows.tables import Elements, MessageTable, TableReader
from sain_bags.rows.topics import PUSH_RESULT, STROKE, topics_of
from sain_core.errors import ErrorCode
from sain_core.push import PUSH_NAMES, PUSH_SIZE, STROKE_NAMES, pushed_bodies
from sain_core.scene import STATE_SIZE, check_finite
from sain_core.shapes.library import register_all
from sain_core.shapes.outlines import read_stored
from sain_core.shapes.solids import Prism
from sain_core.transitions import ORIGINS, Columns
from sain_core.types import Pushes, Scenes
from sain_core.wire import as_sent, check_disks, decode_plan
from sain_core.world import PushRecord

OK: Final = int(ErrorCode.OK)
SECOND: Final = 1_000_000_000  # [ns]
SCENE_FIELDS: Final = (
    "episode_id", "scene_id", "settled", "header.stamp.sec", "header.stamp.nanosec",
    "header.frame_id", "disks",
)  # fmt: skip
FIELDS: Final = (  # of a `PushResult`
    "push_id", "episode_id", "error_code", "error_message", "duration",
    *(f"push.{name}" for name in ("push_id", "episode_id", "source", *PUSH_NAMES)),
    *(f"{scene}.{name}" for scene in ("before", "after") for name in SCENE_FIELDS),
    *(f"prediction.{name}" for name in ("model", "error_code", "disks")),
)  # fmt: skip
TOOL: Final = STROKE_NAMES[PUSH_SIZE:]  # what a `Stroke` states beside its result
STROKE_FIELDS: Final = ("push_id", *TOOL, *map(str, ORIGINS))
OUTLINES_KEY: Final = "outlines"  # of the custom data: the text of a data set's outlines


@dataclass(frozen=True)
class RecordedScenes:
    """One scene for each of K pushes, of any number of bodies each."""

    table: MessageTable
    name: str  # of the field that has them

    @property
    def disks(self) -> Elements:
        """The states of their bodies."""
        return self.table.sequences[f"{self.name}.disks"]

    @property
    def counts(self) -> ndarray:
        """The number of bodies (K,)."""
        return self.disks.counts

    def column(self, name: str) -> ndarray:
        """Return a field of each scene (K,)."""
        return self.table.columns[f"{self.name}.{name}"]

    @property
    def settled(self) -> ndarray:
        """Which are at rest (K,)."""
        return np.asarray(self.column("settled") != 0)

    @property
    def stamps(self) -> ndarray:
        """The simulated times (K,) [ns]."""
        seconds = self.column("header.stamp.sec").astype(np.int64)
        return seconds * SECOND + self.column("header.stamp.nanosec").astype(np.int64)


@dataclass(frozen=True)
class Results:
    """K results as columns."""

    table: MessageTable
    log_times: ndarray  # (K,) [ns since the epoch]

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.log_times)

    def __getitem__(self, rows: slice) -> "Results":
        """Return some of them."""
        return Results(self.table[rows], self.log_times[rows])

    def column(self, name: str) -> ndarray:
        """Return a field of each (K,)."""
        return self.table.columns[name]

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

    @property
    def before(self) -> RecordedScenes:
        """The scenes before the pushes."""
        return RecordedScenes(self.table, "before")

    @property
    def after(self) -> RecordedScenes:
        """The scenes after the pushes."""
        return RecordedScenes(self.table, "after")

    @cached_property
    def actions(self) -> ndarray:
        """The pushes (K, 5), or where the recording states the tool's ways, strokes (K, 11)."""
        names = [f"push.{name}" for name in PUSH_NAMES] + [n for n in TOOL if self.are_strokes]
        return as_sent(np.stack([self.column(name) for name in names], -1, dtype=float))

    @property
    def are_strokes(self) -> bool:
        """Whether the recording states the tool's ways; NaN: not of this push."""
        return TOOL[0] in self.table.columns

    @property
    def origins(self) -> Columns:
        """What users call surfaces, bodies and recordings (K,); only strokes state it."""
        columns = self.table.columns if self.are_strokes else {}
        return {name: columns[name].astype(np.str_) for name in ORIGINS if name in columns}

    @cached_property
    def bodies(self) -> ndarray:
        """The body that each push is against (K,)."""
        return pushed_bodies(self.actions)

    @cached_property
    def predicted(self) -> ndarray:
        """Which pushes have a prediction without an error (K,)."""
        return np.asarray(self.column("prediction.error_code") == OK)

    @cached_property
    def models(self) -> ndarray:
        """What predicted each push (K,); empty: nothing did."""
        return np.where(self.predicted, self.column("prediction.model"), "")

    def physics(self, chosen: ndarray, count: int) -> Scenes:
        """Return f_p(s, a) of pushes, (len(chosen), count, 8); NaN: not as many bodies, or none."""
        disks = self.table.sequences["prediction.disks"]
        scenes = np.full((len(chosen), count, STATE_SIZE), np.nan)
        fitting = self.predicted[chosen] & (disks.counts[chosen] == count)
        scenes[fitting] = disks.take(chosen[fitting], count)
        return scenes

    def pushes(self) -> Iterator["RecordedPush"]:
        """Yield the pushes one by one."""
        names = ("push_id", "episode_id", "error_code", "duration")
        numbers = zip(*(self.column(name).tolist() for name in names), strict=True)
        both = (self.before, self.after)
        scene_ids = [scenes.column("scene_id").tolist() for scenes in both]
        stamps = [scenes.stamps.tolist() for scenes in both]
        for row, (push_id, episode, code, duration) in enumerate(numbers):
            before, after = (scenes.disks.one(row) for scenes in both)
            for scene in filter(len, (before, after)):
                check_disks(scene)
            if code == OK:
                check_finite(self.actions[row], STROKE_NAMES, "{name} of the push")
            physics = self.table.sequences["prediction.disks"].one(row)
            yield RecordedPush(
                self.actions[row],
                before,
                after,
                physics=physics if self.predicted[row] and len(physics) else None,
                duration=duration,
                code=code,
                message=self.column("error_message")[row],
                push_id=push_id,
                episode_id=episode,
                source=self.column("push.source")[row],
                physics_model=self.models[row],
                scene_ids=(scene_ids[0][row], scene_ids[1][row]),
                stamps=(stamps[0][row], stamps[1][row]),
                log_time=int(self.log_times[row]),
            )


def stated_outlines(bag: Bag) -> tuple[Prism, ...]:
    """Return the shapes whose outlines a recording states; raises `DatasetError`."""
    stated = bag.custom_data.get(OUTLINES_KEY)
    return read_stored(stated, f"{bag.path}: {OUTLINES_KEY}") if stated else ()


class ResultReader:
    """Reads the results of one graph, with the strokes that were written before them."""

    def __init__(self, bag: Bag, namespace: str) -> None:
        """Read the definitions; raises `DatasetError` where they lack what a push needs."""
        self._results, self._strokes = (
            TableReader(bag, topics_of(bag, namespace, kind), kind, fields)
            for kind, fields in ((PUSH_RESULT, FIELDS), (STROKE, STROKE_FIELDS))
        )
        self._has_strokes = bool(topics_of(bag, namespace, STROKE))
        self._ways: dict[int, tuple[Any, ...]] = {}  # by push id
        register_all(stated_outlines(bag), bag.path)

    def results(self, batch: Batch) -> Results | None:
        """Return the results in a batch; None: there are none. Raises as `TableReader.read`."""
        if len(strokes := self._strokes.of(batch)):
            columns = self._strokes.read(strokes).columns
            ids, *stated = (columns[name].tolist() for name in STROKE_FIELDS)
            self._ways |= zip(ids, zip(*stated, strict=True), strict=True)
        if not len(found := self._results.of(batch)):
            return None
        table = self._results.read(found)
        if self._has_strokes:
            none = (*len(TOOL) * (np.nan,), *len(ORIGINS) * ("",))
            rows = [self._ways.get(push, none) for push in table.columns["push_id"].tolist()]
            ways = map(np.array, zip(*rows, strict=True))
            table.columns.update(zip(STROKE_FIELDS[1:], ways, strict=True))
        return Results(table, found.log_times)


@dataclass(frozen=True)
class PlanRecord:
    """One decision of the planner."""

    plan_id: int
    push_id: int  # of the push it sent, 0: none
    status: int  # sain_interfaces/msg/Plan
    error_code: int
    error_message: str
    dynamics: str
    fallback: bool
    pushes: Pushes  # (H, 5)
    predicted: Scenes  # (H, N, 8), the scene after each
    goal_distance: float  # [m]
    planning_time: float  # [s]
    goal_id: int = 0  # that it was made for
    log_time: int = 0  # [ns since the epoch]


@dataclass(frozen=True, eq=False)
class RecordedPush(PushRecord):
    """A push and what only a recording has of it. A scene that it lacks is one without bodies."""

    push_id: int = 0
    episode_id: int = 0
    source: str = ""
    physics_model: str = ""
    scene_ids: tuple[int, int] = (0, 0)  # before and after
    stamps: tuple[int, int] = (0, 0)  # [ns] simulated, the same
    log_time: int = 0  # [ns since the epoch]
    plan: PlanRecord | None = None

    @property
    def executed(self) -> bool:
        """Whether it was carried out; a refused push moved nothing."""
        return self.code == OK

    def planned(self, plan: PlanRecord | None) -> "RecordedPush":
        """Return the push with the plan that sent it, and what that expected after it."""
        if plan is None:
            return self
        predicted = plan.predicted[0] if len(plan.predicted) else None
        return replace(self, plan=plan, predicted=predicted, planning_time=plan.planning_time)


def recorded_plan(message: Any, log_time: int) -> PlanRecord:
    """Return a decision of the planner, received at a time [ns since the epoch]."""
    pushes, predicted = decode_plan(message)
    decoded: dict[str, Any] = {"pushes": pushes, "predicted": predicted, "log_time": log_time}
    names = [field.name for field in fields(PlanRecord) if field.name not in decoded]
    return PlanRecord(**{name: getattr(message, name) for name in names}, **decoded)
