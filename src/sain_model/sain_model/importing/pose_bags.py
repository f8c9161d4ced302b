"""Pushes in bags of ROS 1 and ROS 2, from the poses of a body and of a tool, by `rosbags`.

A push is a straight and level way of the tool from one stop to the next. Bodies are read at rest:
before the tool starts, and before it starts again.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.typesys import Stores, get_typestore

from sain_core.errors import DatasetError, InvalidInputError
from sain_core.scene import wrap_angle
from sain_core.storage import DAMAGE
from sain_core.wire import check_pose, flat_pose
from sain_model.importing.real_pushes import LONGEST_TEXT, RealPushes

SUFFIXES: Final = (".bag", ".mcap")
NEEDS: Final = "give --body-topic, --tool-topic and --body"
HALF: Final = 0.05  # [s], before and after a moment, that the tool's speed is taken over
STANDS: Final = 0.002  # [m/s], below which the tool stands
PAUSE: Final = 0.1  # [s], the shortest stop
REST: Final = 0.1  # [s], that a pose of a body is the median of
BENDS: Final = 0.002  # [m], from the straight way of a push, at most
RISES: Final = 0.005  # [m], likewise, in height


@dataclass(frozen=True)
class PoseTopics:
    """Where the poses are: topics, with ``:FRAME`` where one has transforms of many frames."""

    body: str
    tool: str
    object: str  # name of the body's outline
    surface: str = ""


class Track(NamedTuple):
    """Poses at M times."""

    times: Float[ndarray, "M"]  # [s], of receipt
    places: Float[ndarray, "M 3"]  # [m]
    turns: Float[ndarray, "M 4"]  # quaternions x y z w; NaN: points


def read_pose_bag(path: Path, topics: PoseTopics | None) -> tuple[RealPushes, list[str]]:
    """Return the pushes of a bag, and notes about ways of the tool that are none.

    Raises `DatasetError`: no topics are given, or they are not there; it is damaged, or holds no
    push.
    """
    if topics is None:
        raise DatasetError(f"{path} is a bag; {NEEDS}, to say where its poses are")
    try:
        body, tool = _tracks(path, topics.body, topics.tool)
        poses = np.array(
            [
                flat_pose(*check_pose(*one, topics.body), topics.body)
                for one in zip(*body[1:], strict=True)
            ]
        )
    except InvalidInputError as error:
        raise DatasetError(f"{path}: {error}") from error
    except (AnyReaderError, *DAMAGE) as error:
        raise DatasetError(f"{path} is not read: {error}") from error
    poses[:, 2] = np.unwrap(poses[:, 2])
    runs, speeds = _runs(tool), list[float]()
    ends = [*(tool.times[first] for first, _ in runs[1:]), np.inf][: len(runs)]
    rows, others = list[tuple[ndarray, ...]](), 0
    for (first, last), until in zip(runs, ends, strict=True):
        way, (begin, end) = tool.places[first : last + 1], tool.times[[first, last]]
        spans = ((-np.inf, begin), (end, until))
        found = [_at_rest(body.times, poses, *span) for span in spans]
        at_rest = [pose for pose in found if pose is not None]
        if not _is_push(way) or len(at_rest) < len(spans):
            others += 1
            continue
        rows.append((*at_rest, way[0, :2], way[-1, :2]))
        speeds.append(float(np.linalg.norm(way[-1] - way[0]) / (end - begin)))
    if not rows:
        raise DatasetError(
            f"{path} holds no push: none of {len(runs)} ways of {topics.tool} is straight within"
            f" {1e3 * BENDS:g} mm and level within {1e3 * RISES:g} mm, with {topics.body} seen"
            " before and after it"
        )
    note = [f"{path}: {others} ways of the tool are no pushes"] if others else []
    return _pushes(path, topics, rows, speeds), note


def _pushes(
    path: Path, topics: PoseTopics, rows: list[tuple[ndarray, ...]], speeds: list[float]
) -> RealPushes:
    """Return pushes of poses before and after, starts, ends, and speeds [m/s]."""
    before, after, start, stop = (np.array(column) for column in zip(*rows, strict=True))
    for pose in (before, after):  # they were unwrapped
        pose[:, 2] = wrap_angle(pose[:, 2])
    count, unknown = len(rows), np.full(len(rows), np.nan)
    names = {"surface": topics.surface, "object": topics.object, "run": path.stem[:LONGEST_TEXT]}
    return RealPushes(
        **{name: np.full(count, text) for name, text in names.items()},
        before=before, after=after, tip_start=start, tip_end=stop, speed=np.array(speeds),
        span=np.zeros((count, 2)), bar=np.zeros(count, dtype=bool), turn=np.zeros(count),
        **dict.fromkeys(("tip_radius", "mass", "radius"), unknown),
        file=np.zeros(count, np.int64), row=np.arange(count) + 1, files=(str(path),),
    )  # fmt: skip


def _tracks(path: Path, *names: str) -> Iterator[Track]:
    """Yield the poses of topics."""
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for name in names:
            topic, _, frame = name.partition(":")
            chosen = [one for one in reader.connections if one.topic == topic]
            rows = [
                (1e-9 * time, pose)
                for kind, time, data in (reader.messages(chosen) if chosen else ())
                for pose in _poses(reader.deserialize(data, kind.msgtype), frame)
            ]
            if not rows:
                what = f"no poses of {frame!r} on {topic}" if chosen else f"no topic {topic}"
                held = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections}))
                raise DatasetError(f"{path} has {what}; it has {held or 'none'}")
            times, poses = zip(*rows, strict=True)
            numbers = np.array(poses)
            yield Track(np.array(times), numbers[:, :3], numbers[:, 3:])


def _poses(message: Any, frame: str) -> Iterator[list[float]]:
    """Yield x, y, z and a quaternion of what a message states, of this frame where it names any."""
    if hasattr(message, "transforms"):
        for one in message.transforms:
            if one.child_frame_id.lstrip("/") == frame:
                yield from _poses(one, frame)
        return
    for name in ("pose", "pose", "transform", "point"):
        message = getattr(message, name, message)
    place = getattr(message, "position", getattr(message, "translation", message))
    turn = getattr(message, "orientation", getattr(message, "rotation", None))
    if not hasattr(place, "z"):
        raise InvalidInputError(f"{type(message).__name__} states no pose, transform or point")
    yield [place.x, place.y, place.z, *(getattr(turn, one, np.nan) for one in "xyzw")]


def _runs(tool: Track) -> list[tuple[int, int]]:
    """Return first and last moment of each way of the tool from one stop to the next."""
    later, earlier = (
        np.column_stack([np.interp(tool.times + shift, tool.times, x) for x in tool.places.T])
        for shift in (HALF, -HALF)
    )
    moves = np.flatnonzero(np.linalg.norm(later - earlier, axis=1) > 2.0 * HALF * STANDS)
    if not len(moves):
        return []
    breaks = np.flatnonzero(np.diff(tool.times[moves]) > PAUSE)
    return list(zip(moves[[0, *breaks + 1]].tolist(), moves[[*breaks, -1]].tolist(), strict=True))


def _is_push(way: Float[ndarray, "M 3"]) -> bool:
    """Return whether a way of the tool is straight and level."""
    along = way[-1, :2] - way[0, :2]
    length = float(np.linalg.norm(along))
    off = np.abs((way[:, :2] - way[0, :2]) @ np.array([-along[1], along[0]])).max()
    return bool(length > BENDS and off <= BENDS * length and np.ptp(way[:, 2]) <= RISES)


def _at_rest(times: ndarray, poses: ndarray, first: float, last: float) -> ndarray | None:
    """Return the pose (3,) at the end of a span of time [s]; None: it was not seen then."""
    seen = times[(times >= first) & (times <= last)]
    if not len(seen):
        return None
    return np.asarray(
        np.median(poses[(times <= seen[-1]) & (times >= max(first, seen[-1] - REST))], axis=0)
    )
