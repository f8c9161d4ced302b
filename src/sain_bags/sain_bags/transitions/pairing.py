"""Pushes of one graph as they stream past, each with all that was said of it, paired by ids.

A push, its result and its prediction share a `push_id`; the scenes around it are named by
`episode_id` and `scene_id`. Time stamps pair nothing. What streams past is not kept: at most
`WINDOW` pushes wait for what is still to come, so that memory does not grow with the recording,
but for the ranges of the ids of pushes that are done with.

Of each message no more is looked at here than its ids; where the rest of it stands goes along.
"""

from collections import OrderedDict, deque
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_bags.transitions.id_ranges import IdRanges
from sain_bags.transitions.push_run import ANY_EPISODE, GoalRun, PushRun, Where
from sain_core.errors import ErrorCode

WINDOW: Final = 1000  # pushes that wait, scenes and predictions that are kept for pushes to come
SHORT: Final = 16  # pushes that are told of sooner one by one
OK: Final = int(ErrorCode.OK)

Place = tuple[int, int]  # episode_id and scene_id


@dataclass(slots=True)
class Paired:
    """One push with the messages about it; what is None was not found."""

    push_id: int
    place: Place  # the scene that it was planned from
    log_time: int  # [ns since the epoch], of the first message about it
    push: Where | None = None  # needed where there is no result
    result: Where | None = None
    code: int = 0  # of the result, 0: there is none
    episode_id: int = 0  # as the result has it, or the push
    prediction: Where | None = None
    before: Where | None = None  # scene, settled; looked for where results are missing
    after: Where | None = None
    goal: Where | None = None
    repeated: bool = False  # its id had been used before
    ambiguous: bool = False  # another one may be what moved the scene, and no result tells
    released: bool = False  # what is heard of it from now on is too late

    @property
    def refused(self) -> bool:
        """Whether a result says that it moved nothing."""
        return self.result is not None and self.code != OK


class Pairing:
    """Puts the messages of one graph together, push by push, in the order of the pushes."""

    def __init__(self, results: bool, predictions: bool, window: int = WINDOW) -> None:
        """Tell which of the two are to be waited for, because the recording has some."""
        self._results, self._window = results, window
        self._waiting: OrderedDict[int, Paired] = OrderedDict()
        self._ready: list[list[Paired] | PushRun] = []
        self._runs: deque[PushRun] = deque()  # the latest, for rivals of pushes to come
        self._early: OrderedDict[int, Where] = OrderedDict()  # predictions of pushes to come
        self._scenes: OrderedDict[Place, Where] = OrderedDict()
        self._places: OrderedDict[Place, list[Paired]] = OrderedDict()
        self._goals: dict[int, Where] = {}
        self._refused, self._done = IdRanges(), IdRanges()  # push ids; one may be in both
        self.awaits_predictions = predictions
        self.late_predictions = 0  # that came when their push was no longer waited with

    def ready(self) -> list[list[Paired] | PushRun]:
        """Return the pushes that have become complete since it was asked last, in their order."""
        ready, self._ready = self._ready, []
        return ready

    def rest(self) -> list[list[Paired] | PushRun]:
        """Return what still waits when the recording has ended."""
        while self._waiting:
            _, first = self._waiting.popitem(last=False)
            self._release(first)
        return self.ready()

    def push(self, number: int, place: Place, log_time: int, where: Where) -> None:
        """Hear that a push was sent."""
        if not (number in self._waiting or number in self._refused or number in self._done):
            self._wait(Paired(number, place, log_time, where))
            self._release_complete()
        elif not self._results:  # else its own result tells what became of the second one
            self._pass_on(Paired(number, place, log_time, where, repeated=True))

    def result(
        self,
        number: int,
        episode: int,
        code: int,
        push_id: int,
        place: Place,
        log_time: int,
        where: Where,
    ) -> None:
        """Hear that a push was executed or refused; from `push_id` on: as the result repeats it."""
        waiting = self._waiting.get(number)
        executed = waiting.result is not None if waiting is not None else number in self._done
        if code != OK:
            # Another push with this id may have been executed: that one keeps its place.
            if waiting is None or executed:
                told = Paired(push_id, place, log_time)
            else:
                told = self._waiting.pop(number)
            self._refused.add(number)
            self._pass_on(told)
        elif executed:
            told = Paired(push_id, place, log_time, repeated=True)
            self._pass_on(told)
        else:
            told = waiting or self._wait(Paired(number, place, log_time))
        told.result, told.code, told.episode_id = where, code, episode
        self._release_complete()

    def run(self, run: PushRun, goals: GoalRun | None) -> None:
        """Hear at once all that is said of executed pushes, and goals in between.

        Only of ids that are not among `knows`, where nothing is said of other pushes in between.
        """
        if self._waiting or len(run) < SHORT:  # where something waits, they wait behind it
            self._run_one_by_one(run, goals)
            return
        run.find_goals(goals, self._goals)
        self._goals.update(goals.items() if goals else ())
        self._done.add_all(run.column("push_id"))
        self._runs.append(run)
        while sum(map(len, self._runs)) - len(self._runs[0]) > self._window:
            self._runs.popleft()
        self._ready.append(run)

    def _run_one_by_one(self, run: PushRun, goals: GoalRun | None) -> None:
        given = list(zip(goals.items(), goals.spots.tolist(), strict=True)) if goals else []
        names = ("push_id", "push.episode_id", "push.scene_id", "episode_id")
        columns = (run.column(name).tolist() for name in names)
        rows = (run.rows, run.prediction_rows, run.times, run.spots)
        for number, episode, scene, told, row, prediction, time, spot in zip(
            *columns, *(column.tolist() for column in rows), strict=True
        ):
            while given and given[0][1] < spot:
                (for_episode, where), _ = given.pop(0)
                self.goal(for_episode, where)
            paired = self._wait(Paired(number, (episode, scene), time))
            paired.result, paired.code, paired.episode_id = (run.results, row), OK, told
            if run.predictions is not None:
                paired.prediction = (run.predictions, prediction)
            self._release_complete()
        for (for_episode, where), _ in given:
            self.goal(for_episode, where)

    def knows(self, numbers: ndarray) -> ndarray:
        """Tell which push ids (M,) were heard before."""
        kept = np.array([*self._waiting, *self._early], dtype=np.uint64)
        return self._refused.holds(numbers) | self._done.holds(numbers) | np.isin(numbers, kept)

    def prediction(self, number: int, where: Where) -> None:
        """Hear that a push was predicted."""
        waiting = self._waiting.get(number)
        if waiting is not None:
            waiting.prediction = waiting.prediction or where
            self._release_complete()
        elif number in self._done:
            self.late_predictions += 1
        else:
            _keep(self._early, number, where, self._window)

    def settled_scene(self, place: Place, where: Where) -> None:
        """Hear that a scene was seen, settled."""
        if place in self._scenes:
            return
        _keep(self._scenes, place, where, self._window)
        for paired in self._places.get(place, []):
            if not paired.released:
                paired.before = paired.before or where
        for paired in self._places.get((place[0], place[1] - 1), []):
            if not paired.released:
                paired.after = paired.after or where
        self._release_complete()

    def goal(self, episode: int, where: Where) -> None:
        """Hear that a goal was given."""
        self._goals[episode] = where

    def _wait(self, paired: Paired) -> Paired:
        """Let a new push wait, with what came before it and beside its rivals; return it."""
        episode, number = place = paired.place
        if self._early:
            paired.prediction = self._early.pop(paired.push_id, None)
        if self._scenes:
            paired.before = self._scenes.get(place)
            paired.after = self._scenes.get((episode, number + 1))
        self._beside_rivals(paired)
        self._waiting[paired.push_id] = paired
        return paired

    def _beside_rivals(self, paired: Paired) -> None:
        rivals = self._places.get(paired.place)
        if rivals is None:
            _keep(self._places, paired.place, [paired], self._window + 1)  # as long as one waits
        else:
            rivals.append(paired)

    def _pass_on(self, paired: Paired) -> None:
        if not self._ready or isinstance(self._ready[-1], PushRun):
            self._ready.append([])
        self._ready[-1].append(paired)  # type: ignore[union-attr]

    def _complete(self, paired: Paired) -> bool:
        known = paired.result is not None
        if not known and not self._results:
            known = paired.before is not None and paired.after is not None
        return known and (paired.prediction is not None or not self.awaits_predictions)

    def _release_complete(self) -> None:
        while self._waiting:
            first = next(iter(self._waiting.values()))
            if len(self._waiting) <= self._window and not self._complete(first):
                break
            del self._waiting[first.push_id]
            self._release(first)

    def _release(self, paired: Paired) -> None:
        self._done.add(paired.push_id)
        paired.released = True
        if paired.result is None:
            paired.episode_id = paired.place[0]
            rivals = (rival for rival in self._places.get(paired.place, ()) if rival is not paired)
            executed = any(run.has_place(*paired.place) for run in self._runs)
            paired.ambiguous = executed or not all(rival.refused for rival in rivals)
        paired.goal = self._goals.get(paired.episode_id) or self._goals.get(ANY_EPISODE)
        self._pass_on(paired)


def _keep(kept: "OrderedDict[Any, Any]", key: Any, value: Any, most: int) -> None:
    kept[key] = value
    if len(kept) > most:
        kept.popitem(last=False)
