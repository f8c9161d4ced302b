"""Pushes of one graph as they stream past, each with all that was said of it, paired by ids.

A push, its result and its prediction share a `push_id`; the scenes around it are named by
`episode_id` and `scene_id`. Time stamps pair nothing. What streams past is not kept: at most
`WINDOW` pushes wait for what is still to come, so that memory does not grow with the recording,
but for the ranges of the ids of pushes that are done with.
"""

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from sain_bags.episodes import GOAL, PREDICTION, PUSH_RESULT, SCENE
from sain_bags.id_ranges import IdRanges
from sain_bags.reader import Received
from sain_core.errors import ErrorCode

PUSH: Final = "sain_interfaces/msg/Push"
WINDOW: Final = 1000  # pushes that wait, scenes and predictions that are kept for pushes to come
ANY_EPISODE: Final = 0  # in a goal: it holds for all

Place = tuple[int, int]  # episode_id and scene_id


@dataclass
class Paired:
    """One push with the messages about it; what is None was not found."""

    push_id: int
    place: Place  # the scene that it was planned from
    log_time: int  # [ns since the epoch], of the first message about it
    push: Any  # sain_interfaces/msg/Push, as the simulator says that it received it if it does
    result: Any = None  # sain_interfaces/msg/PushResult
    prediction: Any = None  # sain_interfaces/msg/PushPrediction
    before: Any = None  # sain_interfaces/msg/Scene, settled; looked for where results are missing
    after: Any = None
    goal: Any = None  # sain_interfaces/msg/Goal
    repeated: bool = False  # its id had been used before
    rivals: "list[Paired]" = field(default_factory=list)  # other pushes from the same scene

    @property
    def refused(self) -> bool:
        """Whether a result says that it moved nothing."""
        return self.result is not None and self.result.error_code != ErrorCode.OK

    @property
    def ambiguous(self) -> bool:
        """Whether another push may be what moved the scene, and no result tells."""
        return self.result is None and not all(rival.refused for rival in self.rivals)


class Pairing:
    """Puts the messages of one graph together, push by push, in the order of the pushes."""

    def __init__(self, results: bool, predictions: bool, window: int = WINDOW) -> None:
        """Tell which of the two are to be waited for, because the recording has some."""
        self._results, self._predictions, self._window = results, predictions, window
        self._waiting: OrderedDict[int, Paired] = OrderedDict()
        self._early: OrderedDict[int, Any] = OrderedDict()  # predictions of pushes to come
        self._scenes: OrderedDict[Place, Any] = OrderedDict()
        self._places: OrderedDict[Place, list[Paired]] = OrderedDict()
        self._goals: dict[int, Any] = {}
        self._refused, self._done = IdRanges(), IdRanges()  # push ids; one may be in both
        self.late_predictions = 0  # that came when their push was no longer waited with

    def add(self, received: Received) -> Iterator[Paired]:
        """Take the next message; yield the pushes that are complete by it."""
        message = received.message
        if received.type == GOAL:
            self._goals[message.episode_id] = message
        elif received.type == SCENE:
            self._take_scene(message)
        elif received.type == PREDICTION:
            self._take_prediction(message)
        elif received.type == PUSH_RESULT:
            yield from self._take_result(message, received.log_time)
        elif received.type == PUSH:
            yield from self._take_push(message, received.log_time)
        while self._waiting:
            first = next(iter(self._waiting.values()))
            if not self._complete(first) and len(self._waiting) <= self._window:
                break
            yield self._release(first)

    def rest(self) -> Iterator[Paired]:
        """Yield what still waits when the recording has ended."""
        while self._waiting:
            yield self._release(next(iter(self._waiting.values())))

    def _take_push(self, push: Any, log_time: int) -> Iterator[Paired]:
        number = push.push_id
        if not (number in self._waiting or number in self._refused or number in self._done):
            self._wait(self._paired(push, log_time))
        elif not self._results:  # else its own result tells what became of the second one
            again = self._paired(push, log_time)
            again.repeated = True
            yield again

    def _take_result(self, result: Any, log_time: int) -> Iterator[Paired]:
        number = result.push_id
        waiting = self._waiting.get(number)
        executed = number in self._done or (waiting is not None and waiting.result is not None)
        if result.error_code != ErrorCode.OK:
            # Another push with this id may have been executed: that one keeps its place.
            if waiting is None or executed:
                refused = self._paired(result.push, log_time)
            else:
                refused = self._waiting.pop(number)
            refused.result = result
            self._refused.add(number)
            yield refused
        elif executed:
            again = self._paired(result.push, log_time)
            again.result, again.repeated = result, True
            yield again
        else:
            waiting = waiting or self._wait(self._paired(result.push, log_time, number))
            waiting.result, waiting.push = result, result.push

    def _take_prediction(self, prediction: Any) -> None:
        waiting = self._waiting.get(prediction.push_id)
        if waiting is not None:
            waiting.prediction = waiting.prediction or prediction
        elif prediction.push_id in self._done:
            self.late_predictions += 1
        else:
            _keep(self._early, prediction.push_id, prediction, self._window)

    def _take_scene(self, scene: Any) -> None:
        if not scene.settled:
            return
        episode, number = place = (scene.episode_id, scene.scene_id)
        if place in self._scenes:
            return
        _keep(self._scenes, place, scene, self._window)
        for paired in self._places.get(place, []):
            paired.before = paired.before or scene
        for paired in self._places.get((episode, number - 1), []):
            paired.after = paired.after or scene

    def _paired(self, push: Any, log_time: int, number: int | None = None) -> Paired:
        place = (push.episode_id, push.scene_id)
        return Paired(push.push_id if number is None else number, place, log_time, push)

    def _wait(self, paired: Paired) -> Paired:
        """Let a new push wait, with what came before it and beside its rivals; return it."""
        episode, number = paired.place
        paired.prediction = self._early.pop(paired.push_id, None)
        paired.before = self._scenes.get(paired.place)
        paired.after = self._scenes.get((episode, number + 1))
        rivals = self._places.get(paired.place, [])
        for rival in rivals:
            rival.rivals.append(paired)
            paired.rivals.append(rival)
        _keep(self._places, paired.place, [*rivals, paired], self._window)
        self._waiting[paired.push_id] = paired
        return paired

    def _complete(self, paired: Paired) -> bool:
        known = paired.result is not None
        if not known and not self._results:
            known = paired.before is not None and paired.after is not None
        return known and (paired.prediction is not None or not self._predictions)

    def _release(self, paired: Paired) -> Paired:
        del self._waiting[paired.push_id]
        self._done.add(paired.push_id)
        episode = paired.place[0] if paired.result is None else paired.result.episode_id
        paired.goal = self._goals.get(episode) or self._goals.get(ANY_EPISODE)
        return paired


def _keep(kept: "OrderedDict[Any, Any]", key: Any, value: Any, most: int) -> None:
    kept[key] = value
    if len(kept) > most:
        kept.popitem(last=False)
