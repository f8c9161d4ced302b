"""The one converter of recordings: each push becomes one `PushResult` as it is today.

Needed for recordings of before, where results and predictions were messages of their own, and
wherever a push has no result: on a robot, or when the result was lost. Then the settled scenes
around the push state what came of it. A recording that is as it is today is not changed.

Messages are joined by ids: a push, its result and its prediction share a `push_id`; the scenes
around it are named by `episode_id` and `scene_id`. Time stamps join nothing. At most `WINDOW`
pushes wait for messages to come.
"""

import struct
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_bags.bag.layouts import read_types
from sain_bags.bag.metadata import Topic
from sain_bags.reading.bag_files import Batch
from sain_bags.reading.reader import Bag
from sain_bags.rows.cdr import write_cdr
from sain_bags.rows.dropped import REPEATED
from sain_bags.rows.message_fields import (
    FIELDS,
    PUSH,
    PUSH_RESULT,
    SCENE,
    all_paths,
    has_path,
    namespaces,
    topics_of,
)
from sain_bags.rows.recorded_push import UNANSWERED
from sain_bags.rows.results import OK, naming
from sain_bags.rows.tables import TableReader
from sain_bags.writing.writer import BagConfig, BagWriter
from sain_core.errors import DatasetError
from sain_core.wire import decode_stamp

WINDOW: Final = 1000  # pushes that wait, scenes and predictions that are kept for pushes to come
OLD_PREDICTION: Final = "sain_interfaces/msg/PushPrediction"

NO_SCENES: Final = "no result, and no settled scenes around it"
AMBIGUOUS: Final = "no result, and another push from the same scene"

IDS: Final = {  # fields that messages are joined by
    PUSH: ("push_id", "episode_id", "scene_id"),
    PUSH_RESULT: ("push_id", "error_code", "push.episode_id", "push.scene_id"),
    OLD_PREDICTION: ("push_id",),
    SCENE: ("episode_id", "scene_id", "settled"),
}
LINE: Final = 80 * "="
DEFINITION: Final = f"""uint64 push_id
uint64 episode_id
uint16 error_code
string error_message
Push push
Scene before
Scene after
float64 duration
float64 wall_time
Prediction prediction
{LINE}
MSG: sain_interfaces/Push
uint64 push_id
uint64 episode_id
uint64 scene_id
uint32 body
float64 location
float64 angle
float64 length
float64 speed
string source
{LINE}
MSG: sain_interfaces/Scene
std_msgs/Header header
uint64 episode_id
uint64 scene_id
bool settled
DiskState[] disks
{LINE}
MSG: sain_interfaces/Prediction
string model
uint16 error_code
string error_message
DiskState[] disks
{LINE}
MSG: sain_interfaces/DiskState
float64 x
float64 y
float64 theta
float64 vx
float64 vy
float64 omega
float64 mass
float64 radius
{LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{LINE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
NO_TIME: Final = SimpleNamespace(sec=0, nanosec=0)
NO_SCENE: Final = SimpleNamespace(
    header=SimpleNamespace(stamp=NO_TIME, frame_id=""),
    episode_id=0, scene_id=0, settled=False, disks=(),
)  # fmt: skip
NO_PREDICTION: Final = SimpleNamespace(model="", error_code=0, error_message="", disks=())

SceneId = tuple[int, int]  # episode_id and scene_id


class Kept(NamedTuple):
    """A message that waits, not decoded yet."""

    channel: int  # its number in the bag
    data: bytes
    time: int  # [ns since the epoch], received


@dataclass(eq=False)
class WaitingPush:
    """A push while its messages come in; what is None has not come."""

    push_id: int
    scene: SceneId  # that it was planned from
    push: Kept | None = None
    result: Kept | None = None
    prediction: Kept | None = None
    before: Kept | None = None
    after: Kept | None = None


def as_today(bag: Bag) -> Bag:
    """Return a recording in which each push is one result: itself where it is so already.

    Raises:
        DatasetError: damage, or a message that lacks what is needed.
    """
    found = namespaces(bag, PUSH, PUSH_RESULT, OLD_PREDICTION)
    old = [namespace for namespace in found if _is_old(bag, namespace)]
    lacking = [one for one in found if one in old or _count(bag, one, PUSH) > _results(bag, one)]
    if not lacking:
        return bag
    place = TemporaryDirectory(prefix="sain_bags-")
    folder = Path(place.name) / "results"
    with BagWriter(folder, BagConfig(compression="none", flush_period=60.0)) as writer:
        for namespace in lacking:
            _Conversion(bag, namespace, namespace in old, writer).run()
    hidden = [topic for one in old for topic in topics_of(bag, one, PUSH_RESULT)]
    return bag.beside(folder / f"{folder.name}_0.mcap", hidden, place)


def _is_old(bag: Bag, namespace: str) -> bool:
    """Tell whether results of a graph lack what results have today: those of before predictions."""
    topics = topics_of(bag, namespace, PUSH_RESULT)
    for found in bag.channels:
        if found.topic in topics and found.type == PUSH_RESULT:
            with naming(bag):
                types = read_types(PUSH_RESULT, found.definition())
            if not all(has_path(types, PUSH_RESULT, path) for path in all_paths(FIELDS)):
                return True
    return False


def _count(bag: Bag, namespace: str, kind: str) -> int:
    topics = topics_of(bag, namespace, kind)
    return sum(one.messages for one in bag.topics if one.name in topics and one.type == kind)


def _results(bag: Bag, namespace: str) -> int:
    return _count(bag, namespace, PUSH_RESULT)


class _Conversion:
    """Joins the messages of one graph, and writes the results that are to be read."""

    def __init__(self, bag: Bag, namespace: str, is_old: bool, writer: BagWriter) -> None:
        self._bag, self._is_old, self._writer = bag, is_old, writer
        self._has_results = _results(bag, namespace) > 0
        self._has_predictions = _count(bag, namespace, OLD_PREDICTION) > 0
        self._inputs = topics_of(bag, namespace, PUSH, PUSH_RESULT, OLD_PREDICTION)
        if _count(bag, namespace, PUSH) > _results(bag, namespace):  # else scenes tell nothing
            self._inputs += topics_of(bag, namespace, SCENE)
        self._topic = f"{namespace}/push_result"
        self._types = read_types(PUSH_RESULT, DEFINITION)
        self._readers: dict[int, TableReader] = {}
        self._waiting: OrderedDict[int, WaitingPush] = OrderedDict()
        self._answered: set[int] = set()  # push ids
        self._executed: set[int] = set()
        self._early: OrderedDict[int, Kept] = OrderedDict()  # predictions of pushes to come
        self._scenes: OrderedDict[SceneId, Kept] = OrderedDict()  # settled
        self._claims: OrderedDict[SceneId, set[int]] = OrderedDict()  # pushes from there

    def run(self) -> None:
        """Read the recording."""
        self._writer.add_topic(Topic(self._topic, PUSH_RESULT, DEFINITION))
        takes: dict[str, Callable[..., None]] = {
            PUSH: self._push, PUSH_RESULT: self._result,
            OLD_PREDICTION: self._prediction, SCENE: self._scene,
        }  # fmt: skip
        for batch in self._bag.batches(self._inputs, types=IDS):
            with naming(self._bag):
                found = sorted(self._read(batch))
            for spot, number, ids in found:
                start, time = int(batch.starts[spot]), int(batch.log_times[spot])
                data = batch.data[start : start + int(batch.sizes[spot])].tobytes()
                takes[self._bag.channels[number].type](*ids, Kept(number, data, time))
                while len(self._waiting) > WINDOW:
                    self._release(next(iter(self._waiting)))
        while self._waiting:
            self._release(next(iter(self._waiting)))

    def _read(self, batch: Batch) -> Iterator[tuple[int, int, tuple[int, ...]]]:
        """Yield place, channel and ids of each message; of scenes only the first settled ones."""
        for number in np.unique(batch.channels).tolist():
            channel, spots = self._bag.channels[number], np.flatnonzero(batch.channels == number)
            fields = IDS[channel.type]
            if number not in self._readers:
                self._readers[number] = TableReader(channel, self._bag.decoding, fields)
            columns = self._readers[number].read(batch[spots]).columns
            rows = _first_settled(columns) if channel.type == SCENE else np.arange(len(spots))
            ids = zip(*(columns[name][rows].tolist() for name in fields), strict=True)
            yield from ((int(spots[row]), number, one) for row, one in zip(rows, ids, strict=True))

    def _push(self, push_id: int, episode: int, scene: int, push: Kept) -> None:
        known = self._waiting.get(push_id)
        if known is None and push_id not in self._answered:
            known = self._wait(push_id, (episode, scene))
            known.push = push
            self._claim(known.scene).add(push_id)
            self._release_if_seen(known)
        elif not self._has_results:  # else its own result tells what became of the second one
            self._write_unanswered(WaitingPush(push_id, (episode, scene), push), REPEATED)

    def _result(self, push_id: int, code: int, episode: int, scene: int, result: Kept) -> None:
        again = push_id in self._executed
        self._answered.add(push_id)
        if code != OK:
            self._claim((episode, scene)).discard(push_id)
            if not again:
                self._waiting.pop(push_id, None)
            self._write_result(result, None)
            return
        self._claim((episode, scene)).add(push_id)
        self._executed.add(push_id)
        waiting = self._waiting.pop(push_id, None)
        prediction = waiting.prediction if waiting else self._early.pop(push_id, None)
        if again or prediction or not self._has_predictions or not self._is_old:
            self._write_result(result, prediction)
        else:
            self._wait(push_id, (episode, scene)).result = result

    def _prediction(self, push_id: int, prediction: Kept) -> None:
        waiting = self._waiting.get(push_id)
        if waiting is None:
            _keep(self._early, push_id, prediction)
        else:
            waiting.prediction = waiting.prediction or prediction
            if waiting.result is not None:
                self._release(push_id)
            else:
                self._release_if_seen(waiting)

    def _scene(self, episode: int, scene: int, _: int, message: Kept) -> None:
        if (episode, scene) in self._scenes:
            return
        _keep(self._scenes, (episode, scene), message)
        claims = self._claims.get((episode, scene), ()), self._claims.get((episode, scene - 1), ())
        for push_id in sorted({*claims[0], *claims[1]}):
            if (waiting := self._waiting.get(push_id)) is not None:
                self._look_around(waiting)
                self._release_if_seen(waiting)

    def _wait(self, push_id: int, scene: SceneId) -> WaitingPush:
        waiting = WaitingPush(push_id, scene, prediction=self._early.pop(push_id, None))
        self._look_around(waiting)
        self._waiting[push_id] = waiting
        return waiting

    def _look_around(self, push: WaitingPush) -> None:
        """Find the settled scenes before and after a push."""
        episode, scene = push.scene
        push.before = push.before or self._scenes.get(push.scene)
        push.after = push.after or self._scenes.get((episode, scene + 1))

    def _claim(self, scene: SceneId) -> set[int]:
        if scene not in self._claims:
            _keep(self._claims, scene, set())
        return self._claims[scene]

    def _release_if_seen(self, push: WaitingPush) -> None:
        found = (push.before, push.after, push.prediction or not self._has_predictions)
        if not self._has_results and all(found):
            self._release(push.push_id)

    def _release(self, push_id: int) -> None:
        push = self._waiting.pop(push_id)
        self._answered.add(push_id)
        if push.result is not None:
            self._write_result(push.result, push.prediction)
        elif self._claims.get(push.scene, set()) - {push_id}:
            push.after = None
            self._write_unanswered(push, AMBIGUOUS)
        else:
            is_seen = push.before is not None and push.after is not None
            self._write_unanswered(push, "" if is_seen else NO_SCENES)

    def _write_result(self, result: Kept, prediction: Kept | None) -> None:
        """Write a result in today's form; one that has it already stays where it is."""
        if not self._is_old:
            return
        message = self._decode(result)
        if prediction is not None:
            message.prediction = self._decode(prediction)
        self._write(message, result.time)

    def _write_unanswered(self, push: WaitingPush, message: str) -> None:
        assert push.push is not None
        before, after = map(self._decode, (push.before, push.after))
        duration = float("nan")
        if before and after:
            stamps = [decode_stamp(scene.header.stamp) for scene in (before, after)]
            duration = 1e-9 * (stamps[1] - stamps[0])
        result = SimpleNamespace(
            push_id=push.push_id,
            episode_id=push.scene[0],
            error_code=UNANSWERED,
            error_message=message,
            push=self._decode(push.push),
            before=before or NO_SCENE,
            after=after or NO_SCENE,
            duration=duration,
            prediction=self._decode(push.prediction) or NO_PREDICTION,
        )
        self._write(result, (push.after or push.push).time)

    def _decode(self, message: Kept | None) -> Any:
        return None if message is None else self._bag.decode(message.channel, message.data)

    def _write(self, result: Any, time: int) -> None:
        for holder, name, value in ((result, "wall_time", np.nan), (result.push, "source", "")):
            if not hasattr(holder, name):
                setattr(holder, name, value)
        try:
            data = write_cdr(self._types, PUSH_RESULT, result)
        except (AttributeError, struct.error) as error:
            raise DatasetError(
                f"{self._bag.path} holds messages of another definition than this graph's:"
                f" {PUSH_RESULT}: {error}"
            ) from error
        self._writer.write(self._topic, data, time)


def _first_settled(columns: dict[str, ndarray]) -> ndarray:
    """Return the rows of the first settled scene of each id; the others repeat it."""
    settled = np.flatnonzero(columns["settled"])
    ids = np.stack([columns[name][settled] for name in ("episode_id", "scene_id")])
    _, first = np.unique(ids, axis=1, return_index=True)
    return settled[np.sort(first)]


def _keep(kept: "OrderedDict[Any, Any]", key: Any, value: Any) -> None:
    kept[key] = value
    if len(kept) > WINDOW + 1:
        kept.popitem(last=False)
