"""The pairing of one graph's messages: each push with all messages about it, by their ids.

A push, its result and its prediction share a `push_id`; the scenes around it are named by
`episode_id` and `scene_id`. Time stamps pair nothing. At most `WINDOW` pushes wait for messages to
come, so that memory does not grow with the recording, except for ranges of the ids of old pushes.

Contiguous pushes are paired as columns (`sain_bags.transitions.contiguous`), all others message by
message. Of a message no more than its ids is read here; its table and row are passed on.
"""

from collections import OrderedDict, deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_bags.transitions.contiguous import ANY_EPISODE, PushStretch, find_contiguous
from sain_bags.transitions.id_ranges import IdRanges
from sain_bags.transitions.message_fields import GOAL, PREDICTION, PUSH, SCENE
from sain_bags.transitions.messages import ChannelMessages
from sain_bags.transitions.paired_pushes import NONE, OK, PairedPushes, PendingPush, SceneId
from sain_bags.transitions.tables import Message

WINDOW: Final = 1000  # pushes that wait, scenes and predictions that are kept for pushes to come
SHORT: Final = 16  # contiguous pushes that are faster paired one by one

Paired = list[PendingPush] | PairedPushes  # in the order of the pushes
Calls = tuple[Callable[..., None], Iterator[tuple[Any, ...]]]  # a method and its arguments


class Pairing:
    """Pairs the messages of one graph, push by push, in the order of the pushes."""

    def __init__(self, results: bool, predictions: bool, window: int = WINDOW) -> None:
        """Wait for results and predictions only where the recording has some."""
        self._results, self._predictions, self._window = results, predictions, window
        self._waiting: OrderedDict[int, PendingPush] = OrderedDict()
        self._ready: list[Paired] = []
        self._executed: deque[ndarray] = deque()  # scenes that contiguous pushes were planned from
        self._early: OrderedDict[int, Message] = OrderedDict()  # predictions of pushes to come
        self._scenes: OrderedDict[SceneId, Message] = OrderedDict()
        self._rivals: OrderedDict[SceneId, list[PendingPush]] = OrderedDict()
        self._goals: dict[int, Message] = {}
        self._refused, self._done = IdRanges(), IdRanges()  # push ids; one may be in both
        self.late_predictions = 0  # that came when their push was no longer waiting

    def read(self, messages: Sequence[ChannelMessages], count: int) -> None:
        """Pair the messages of a batch, by channel; `count` is how many the batch has."""
        found = find_contiguous(messages, count, self.knows, self._predictions)
        turns = np.full(count, NONE)  # which of `calls` a message belongs to
        calls: list[Calls] = []
        for one in messages:
            rows = np.flatnonzero(~found.covered[one.spots]) if found else np.arange(len(one.spots))
            turns[one.spots[rows]] = len(calls)
            calls.append(self._calls(one, rows))
        others = np.flatnonzero(turns != NONE)
        stretches = iter(found.stretches(others) if found else ())
        for turn in turns[others].tolist():
            self.contiguous(next(stretches, None))
            method, arguments = calls[turn]
            method(*next(arguments))
        self.contiguous(next(stretches, None))

    def ready(self) -> list[Paired]:
        """Return the pushes that became complete since the last call, in their order."""
        ready, self._ready = self._ready, []
        return ready

    def rest(self) -> list[Paired]:
        """Return the pushes that still wait when the recording has ended."""
        while self._waiting:
            _, first = self._waiting.popitem(last=False)
            self._release(first)
        return self.ready()

    def knows(self, numbers: ndarray) -> ndarray:
        """Return which push ids (M,) have occurred."""
        kept = np.array([*self._waiting, *self._early], dtype=np.uint64)
        return self._refused.holds(numbers) | self._done.holds(numbers) | np.isin(numbers, kept)

    def _calls(self, messages: ChannelMessages, rows: ndarray) -> Calls:
        """Return the method that reads messages of a kind, and its arguments for some of them."""
        places, lists = messages.places(rows), messages.lists
        if messages.kind == GOAL:
            return self.goal, zip(*lists(rows, "episode_id"), places, strict=True)
        if messages.kind == SCENE:
            ids = zip(*lists(rows, "episode_id", "scene_id"), strict=True)
            return self.settled_scene, zip(ids, places, strict=True)
        if messages.kind == PREDICTION:
            return self.prediction, zip(*lists(rows, "push_id"), places, strict=True)
        times = messages.times[rows].tolist()
        if messages.kind == PUSH:
            planned = zip(*lists(rows, "episode_id", "scene_id"), strict=True)
            return self.push, zip(*lists(rows, "push_id"), planned, times, places, strict=True)
        planned = zip(*lists(rows, "push.episode_id", "push.scene_id"), strict=True)
        named = lists(rows, "push_id", "episode_id", "error_code", "push.push_id")
        return self.result, zip(*named, planned, times, places, strict=True)

    def push(self, number: int, planned_from: SceneId, log_time: int, message: Message) -> None:
        """Read that a push was sent."""
        if not (number in self._waiting or number in self._refused or number in self._done):
            self._wait(PendingPush(number, planned_from, log_time, message))
            self._release_complete()
        elif not self._results:  # else its own result tells what became of the second one
            self._pass_on(PendingPush(number, planned_from, log_time, message, repeated=True))

    def result(
        self,
        number: int,
        episode: int,
        code: int,
        push_id: int,
        planned_from: SceneId,
        log_time: int,
        message: Message,
    ) -> None:
        """Read that a push was executed or refused; from `push_id` on: as the result repeats it."""
        waiting = self._waiting.get(number)
        executed = waiting.result is not None if waiting is not None else number in self._done
        if code != OK:
            # Another push with this id may have been executed: that one keeps its turn.
            if waiting is None or executed:
                push = PendingPush(push_id, planned_from, log_time)
            else:
                push = self._waiting.pop(number)
            self._refused.add(number)
            self._pass_on(push)
        elif executed:
            push = PendingPush(push_id, planned_from, log_time, repeated=True)
            self._pass_on(push)
        else:
            push = waiting or self._wait(PendingPush(number, planned_from, log_time))
        push.result, push.code, push.episode_id = message, code, episode
        self._release_complete()

    def prediction(self, number: int, message: Message) -> None:
        """Read that a push was predicted."""
        waiting = self._waiting.get(number)
        if waiting is not None:
            waiting.prediction = waiting.prediction or message
            self._release_complete()
        elif number in self._done:
            self.late_predictions += 1
        else:
            _keep(self._early, number, message, self._window)

    def settled_scene(self, scene_id: SceneId, message: Message) -> None:
        """Read that a scene was observed, settled."""
        if scene_id in self._scenes:
            return
        _keep(self._scenes, scene_id, message, self._window)
        for push in self._rivals.get(scene_id, []):
            if not push.released:
                push.before = push.before or message
        for push in self._rivals.get((scene_id[0], scene_id[1] - 1), []):
            if not push.released:
                push.after = push.after or message
        self._release_complete()

    def goal(self, episode: int, message: Message) -> None:
        """Read that a goal was given."""
        self._goals[episode] = message

    def contiguous(self, stretch: PushStretch | None) -> None:
        """Pair executed pushes at once; none of their ids has occurred."""
        if stretch is None:
            return
        if self._waiting or len(stretch.pushes) < SHORT:  # where a push waits, they wait behind it
            self._one_by_one(stretch)
            return
        pushes = stretch.with_goals(self._goals)
        self._ready.append(pushes)
        self._goals.update(stretch.given())
        self._done.add_all(pushes.ids["push_id"])
        planned = [pushes.ids[name] for name in ("planned_in", "planned_from")]
        self._executed.append(np.stack(planned, axis=-1))
        while sum(map(len, self._executed)) - len(self._executed[0]) > self._window:
            self._executed.popleft()

    def _one_by_one(self, stretch: PushStretch) -> None:
        pushes, goals = stretch.pushes, deque(stretch.given())
        goal_spots = stretch.goals.spots if stretch.goals else np.empty(0)
        given = np.searchsorted(goal_spots, stretch.spots).tolist()  # goals before each push
        table, rows = pushes.messages[0]
        for push, row in enumerate(rows.tolist()):
            while len(goals) > len(goal_spots) - given[push]:
                self.goal(*goals.popleft())
            number, planned_in, planned_from, episode, code, time = pushes.ids[push].item()
            pending = self._wait(PendingPush(number, (planned_in, planned_from), time))
            pending.result, pending.code, pending.episode_id = (table, row), code, episode
            if pushes.predictions is not None:
                pending.prediction = (pushes.predictions[0], int(pushes.predictions[1][push]))
            self._release_complete()
        for goal in goals:
            self.goal(*goal)

    def _wait(self, push: PendingPush) -> PendingPush:
        """Let a new push wait, with what came before it and beside its rivals; return it."""
        episode, scene = push.planned_from
        if self._early:
            push.prediction = self._early.pop(push.push_id, None)
        if self._scenes:
            push.before = self._scenes.get(push.planned_from)
            push.after = self._scenes.get((episode, scene + 1))
        rivals = self._rivals.get(push.planned_from)
        if rivals is None:  # kept as long as a push may wait
            _keep(self._rivals, push.planned_from, [push], self._window + 1)
        else:
            rivals.append(push)
        self._waiting[push.push_id] = push
        return push

    def _pass_on(self, push: PendingPush) -> None:
        if not self._ready or isinstance(self._ready[-1], PairedPushes):
            self._ready.append([])
        self._ready[-1].append(push)  # type: ignore[union-attr]

    def _complete(self, push: PendingPush) -> bool:
        known = push.result is not None
        if not known and not self._results:
            known = push.before is not None and push.after is not None
        return known and (push.prediction is not None or not self._predictions)

    def _release_complete(self) -> None:
        while self._waiting:
            first = next(iter(self._waiting.values()))
            if len(self._waiting) <= self._window and not self._complete(first):
                break
            del self._waiting[first.push_id]
            self._release(first)

    def _release(self, push: PendingPush) -> None:
        self._done.add(push.push_id)
        push.released = True
        if push.result is None:
            push.episode_id = push.planned_from[0]
            rivals = (one for one in self._rivals.get(push.planned_from, ()) if one is not push)
            planned = np.array(push.planned_from)
            executed = any((one == planned).all(axis=1).any() for one in self._executed)
            push.ambiguous = executed or not all(rival.refused for rival in rivals)
        push.goal = self._goals.get(push.episode_id) or self._goals.get(ANY_EPISODE)
        self._pass_on(push)


def _keep(kept: "OrderedDict[Any, Any]", key: Any, value: Any, most: int) -> None:
    kept[key] = value
    if len(kept) > most:
        kept.popitem(last=False)
