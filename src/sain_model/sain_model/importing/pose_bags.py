"""Pushes in bags of ROS 1 and ROS 2, from the poses of a body and of a tool, by `rosbags`.

A push is a straight and level way of the tool from one stop to the next, at the height of those
that move the body, and not back along the way before. Bodies are read at rest: last before the
tool starts, first after it stopped.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from sain_core.errors import DatasetError, InvalidInputError
from sain_core.push import LENGTH, SPEED, allowed_ranges
from sain_core.scene import wrap_angle
from sain_core.wire import check_pose, flat_pose
from sain_model.importing.real_pushes import LONGEST_TEXT, RealPushes

METADATA: Final = "metadata.yaml"  # of a folder that is one bag of ROS 2
SUFFIXES: Final = (".bag", ".mcap", ".db3")
NEEDS: Final = "give --body-topic, --tool-topic and --body"
HALF: Final = 0.1  # [s], before and after a moment, that the tool's speed is taken over
STANDS: Final = 0.004  # [m/s], below which the tool stands
PAUSE: Final = 0.1  # [s], the shortest stop
REST: Final = 0.1  # [s], in which a body at rest moves and turns
STILL: Final = np.array([0.002, 0.002, 0.02])  # [m, m, rad] at most; the pose is their median
OLD: Final = 0.5  # [s], before a push, when the body must have been seen
BENDS: Final = 0.002  # [m], from the straight way of a push, at most
RISES: Final = 0.005  # [m], likewise, in height
MIDDLE: Final = (0.1, 0.9)  # shares of a way, between which its speed is taken
BACK: Final = 0.98  # cosine of the most that a way back is off the way before it
LEVEL: Final = 0.02  # [m], of a way off the height of those that move the body


@dataclass(frozen=True)
class PoseTopics:
    """Where the poses are: topics, with ``:FRAME`` where one has transforms of many frames."""

    body: str
    tool: str
    object: str  # name of the body's outline
    surface: str = ""


class Pose(NamedTuple):
    """A pose that a message states, and the frames that it names."""

    numbers: list[float]  # x, y, z [m] and a quaternion x y z w; NaN: a point
    frame: str  # that it is in
    child: str  # that it is of


class Track(NamedTuple):
    """Poses at M times."""

    times: Float[ndarray, "M"]  # [s], of receipt
    places: Float[ndarray, "M 3"]  # [m]
    turns: Float[ndarray, "M 4"]  # quaternions x y z w; NaN: points


def read_pose_bag(path: Path, topics: PoseTopics | None) -> tuple[RealPushes, list[str]]:
    """Return the pushes of a bag, and notes about what is none.

    Raises `DatasetError`: no topics are given, or they are not there, or in two frames; it is
    damaged, or holds no push.
    """
    if topics is None:
        raise DatasetError(f"{path} is a bag; {NEEDS}, to say where its poses are")
    body, tool = _tracks(path, topics)
    poses, wrong = _flat(body, topics.body)
    if 2 * len(wrong) > len(body.times):
        raise DatasetError(f"{path}: {len(wrong)} of {len(body.times)} poses: {wrong[0]}")
    notes = [f"{path}: {len(wrong)} poses are left out: {wrong[0]}"] if wrong else []
    times = body.times[np.isfinite(poses[:, 0])]
    poses = poses[np.isfinite(poses[:, 0])]
    poses[:, 2] = np.unwrap(poses[:, 2])
    runs = _runs(tool)
    ends = [*(tool.times[first] for first, _ in runs[1:]), np.inf][: len(runs)]
    rows, most = list[tuple[ndarray, ...]](), {one: high for one, _, high in allowed_ranges(True)}
    for (first, last), until in zip(runs, ends, strict=True):
        way, (begin, end) = tool.places[first : last + 1], tool.times[[first, last]]
        before, after = _before(times, poses, begin), _after(times, poses, end, until)
        length = float(np.linalg.norm(way[-1] - way[0]))
        speed = _speed(tool.times[first : last + 1], way)
        is_push = _is_push(way) and length <= most[LENGTH] and speed <= most[SPEED]
        if is_push and before is not None and after is not None:
            rows.append((before, after, way[0], way[-1], np.array(speed)))
    level = _level(rows)
    pushes = [row for row in _onward(rows) if abs(row[2][2] - level) <= LEVEL]
    if not pushes:
        raise DatasetError(
            f"{path} holds no push: none of {len(runs)} ways of {topics.tool} is straight within"
            f" {1e3 * BENDS:g} mm and level within {1e3 * RISES:g} mm, with {topics.body} seen at"
            " rest before and after it, and moved by one at least"
        )
    if others := len(runs) - len(pushes):
        notes.append(f"{path}: {others} ways of the tool are no pushes")
    return _pushes(path, topics, pushes), notes


def _pushes(path: Path, topics: PoseTopics, rows: list[tuple[ndarray, ...]]) -> RealPushes:
    """Return pushes of poses before and after, starts and ends (3,), and speeds [m/s]."""
    before, after, start, stop, speed = (np.array(column) for column in zip(*rows, strict=True))
    for pose in (before, after):  # they were unwrapped
        pose[:, 2] = wrap_angle(pose[:, 2])
    count, unknown = len(rows), np.full(len(rows), np.nan)
    names = {"surface": topics.surface, "object": topics.object, "run": path.stem[:LONGEST_TEXT]}
    return RealPushes(
        **{name: np.full(count, text) for name, text in names.items()},
        before=before, after=after, tip_start=start[:, :2], tip_end=stop[:, :2], speed=speed,
        span=np.zeros((count, 2)), bar=np.zeros(count, dtype=bool), turn=np.zeros(count),
        **dict.fromkeys(("tip_radius", "mass", "radius"), unknown),
        file=np.zeros(count, np.int64), row=np.arange(count) + 1, files=(str(path),),
    )  # fmt: skip


# --- what a bag states ----------------------------------------------------------------------------


class TopicPoses:
    """The poses of one topic, as far as a bag was read."""

    def __init__(self, name: str) -> None:
        """Begin with none; ``TOPIC:FRAME`` is of one frame."""
        self.name = name
        self.topic, _, frame = name.partition(":")
        self._frame = frame.strip("/")
        self._rows = list[tuple[float, list[float]]]()
        self._others = set[str]()  # frames that it has poses of
        self._frames = Counter[str]()  # that these poses are in

    def take(self, topic: str, time: float, pose: Pose) -> None:
        """Take a pose [s] if it is one of these."""
        if topic == self.topic:
            self._others.add(pose.child)
            if self._frame in ("", pose.child):
                self._frames[pose.frame] += 1
                self._rows.append((time, pose.numbers))

    def track(self, path: Path, held: set[str]) -> Track:
        """Return the poses; raises `DatasetError`: there are none, or of several frames."""
        named = ", ".join(sorted(filter(None, self._others)))
        if not self._rows and self._others:
            has = f"of {named}" if named else f"they name no frame: give {self.topic} alone"
            raise DatasetError(f"{path} has no poses of {self._frame!r} on {self.topic}; {has}")
        if not self._rows:
            has = ", ".join(sorted(held)) or "none"
            raise DatasetError(f"{path} has no topic {self.topic} with messages; give one of {has}")
        if not self._frame and len(self._others) > 1:
            raise DatasetError(
                f"{path}: {self.name} has poses of {named}; name one frame: {self.topic}:FRAME"
            )
        if len(self._frames) > 1:
            what = ", ".join(f"{count} in {frame!r}" for frame, count in self._frames.items())
            raise DatasetError(
                f"{path}: {self.name} has poses in several frames: {what}; allowed: one. Record it"
                " again with one publisher of these poses, or give another topic or frame"
            )
        times, numbers = map(np.array, zip(*self._rows, strict=True))
        return Track(times, numbers[:, :3], numbers[:, 3:])

    @property
    def base(self) -> str:
        """The frame that the poses are in; empty: it is not stated."""
        return next(iter(self._frames))


def _tracks(path: Path, topics: PoseTopics) -> tuple[Track, Track]:
    """Return the poses of body and tool, in one reading; raises `DatasetError`."""
    body, tool, held = TopicPoses(topics.body), TopicPoses(topics.tool), set[str]()
    for topic, time, message in _messages(path, {body.topic, tool.topic}, held):
        for pose in _poses(message, topic):
            body.take(topic, time, pose)
            tool.take(topic, time, pose)
    tracks = body.track(path, held), tool.track(path, held)
    if body.base and tool.base and body.base != tool.base:
        raise DatasetError(
            f"{path}: {body.name} is in frame {body.base!r}, and {tool.name} in {tool.base!r};"
            " record both in the frame of the table"
        )
    right = np.isfinite(tracks[1].places).all(axis=1)
    return tracks[0], Track(*(column[right] for column in tracks[1]))


def _messages(path: Path, topics: set[str], held: set[str]) -> Iterator[tuple[str, float, Any]]:
    """Yield topic, time of receipt [s] and content of messages; note which topics there are."""
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            held |= {f"{one.topic} ({one.msgtype})" for one in reader.connections}
            if chosen := [one for one in reader.connections if one.topic in topics]:
                for kind, time, data in reader.messages(chosen):
                    yield kind.topic, 1e-9 * time, reader.deserialize(data, kind.msgtype)
    except DatasetError:
        raise
    except Exception as error:  # rosbags, and what it unpacks with, raise many kinds
        raise DatasetError(f"{path} is not read: {error}") from error


def _poses(message: Any, topic: str) -> Iterator[Pose]:
    """Yield the poses that a message states; raises `DatasetError`: none can be in it."""
    if hasattr(message, "transforms"):
        for one in message.transforms:
            yield from _poses(one, topic)
        return
    kind = type(message).__name__
    frame = getattr(getattr(message, "header", None), "frame_id", "").strip("/")
    child = getattr(message, "child_frame_id", "").strip("/")
    for name in ("pose", "pose", "transform", "point"):
        message = getattr(message, name, message)
    place = getattr(message, "position", getattr(message, "translation", message))
    turn = getattr(message, "orientation", getattr(message, "rotation", None))
    if not hasattr(place, "z"):
        raise DatasetError(f"{topic}: {kind} states no pose, transform or point")
    yield Pose(
        [place.x, place.y, place.z, *(getattr(turn, one, np.nan) for one in "xyzw")], frame, child
    )


def _flat(body: Track, topic: str) -> tuple[Float[ndarray, "M 3"], list[str]]:
    """Return poses x, y, heading, NaN where one cannot be, and why those cannot."""
    poses, wrong = np.full((len(body.times), 3), np.nan), list[str]()
    for row, (_, place, turn) in enumerate(zip(*body, strict=True)):
        try:
            poses[row] = flat_pose(*check_pose(place, turn, topic), topic)
        except InvalidInputError as error:
            points = f"{topic} states points; a body needs poses, with headings"
            wrong.append(points if np.isnan(turn).all() else str(error))
    return poses, wrong


# --- ways of the tool -----------------------------------------------------------------------------


def _runs(tool: Track) -> list[tuple[int, int]]:
    """Return first and last moment of each way of the tool from one stop to the next."""
    later, earlier = (
        np.column_stack([np.interp(tool.times + shift, tool.times, x) for x in tool.places.T])
        for shift in (HALF, -HALF)
    )
    moves = np.flatnonzero(np.linalg.norm(later - earlier, axis=1) > 2.0 * HALF * STANDS)
    if not len(moves):
        return []
    stops = max(PAUSE, 2.5 * float(np.median(np.diff(tool.times))))  # also of a slow tracker
    breaks = np.flatnonzero(np.diff(tool.times[moves]) > stops)
    return list(zip(moves[[0, *breaks + 1]].tolist(), moves[[*breaks, -1]].tolist(), strict=True))


def _is_push(way: Float[ndarray, "M 3"]) -> bool:
    """Return whether a way of the tool is straight, level, and goes back nowhere."""
    along = way[-1, :2] - way[0, :2]
    length = float(np.linalg.norm(along))
    off = np.abs((way[:, :2] - way[0, :2]) @ np.array([-along[1], along[0]])).max()
    gone = (way[:, :2] - way[0, :2]) @ along
    back = (np.maximum.accumulate(gone) - gone).max()
    return bool(length > BENDS and max(off, back) <= BENDS * length and np.ptp(way[:, 2]) <= RISES)


def _speed(times: Float[ndarray, "M"], way: Float[ndarray, "M 3"]) -> float:
    """Return the speed [m/s] on the middle of a way, without its ends at rest."""
    gone = np.maximum.accumulate(np.linalg.norm(way - way[0], axis=1))
    begin, end = np.interp(np.multiply(MIDDLE, gone[-1]), gone, times)
    return float((MIDDLE[1] - MIDDLE[0]) * gone[-1] / max(end - begin, 1e-9))


def _level(rows: list[tuple[ndarray, ...]]) -> float:
    """Return the least height [m] of ways that move the body: a hand may move it meanwhile, too.

    NaN: none does.
    """
    return float(min((row[2][2] for row in rows if _is_moved(row)), default=np.nan))


def _onward(rows: list[tuple[ndarray, ...]]) -> Iterator[tuple[ndarray, ...]]:
    """Yield the ways but those on which the tool went back, and left the body where it was."""
    end, before = np.full(3, np.nan), np.zeros(3)
    for row in rows:
        along = row[3] - row[2]
        goes_back = before @ along < -BACK * np.linalg.norm(before) * np.linalg.norm(along)
        goes_back &= np.linalg.norm(row[2] - end) <= LEVEL
        if _is_moved(row) or not goes_back:
            yield row
        end, before = row[3], along


def _is_moved(row: tuple[ndarray, ...]) -> bool:
    return bool((np.abs(row[1] - row[0]) > STILL).any())


def _before(times: ndarray, poses: ndarray, begin: float) -> ndarray | None:
    """Return the pose (3,) when the tool starts; None: it was not seen then."""
    last = int(np.searchsorted(times, begin, side="right")) - 1
    if last < 0 or times[last] < begin - OLD:
        return None
    first = int(np.searchsorted(times, times[last] - REST))
    return np.asarray(np.median(poses[first : last + 1], axis=0))


def _after(times: ndarray, poses: ndarray, end: float, until: float) -> ndarray | None:
    """Return the first pose (3,) at rest after the tool stopped; None: there was none."""
    first, stop = np.searchsorted(times, (end, until), side="right").tolist()
    for place in range(first, stop):
        last = int(np.searchsorted(times, times[place] + REST))
        window = poses[place : min(last, stop)]
        if (np.ptp(window, axis=0) <= STILL).all():
            return np.asarray(np.median(window, axis=0))
    return None
