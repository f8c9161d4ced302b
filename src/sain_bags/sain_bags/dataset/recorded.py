"""A data set as a recording: each row the result of a push, as a graph would have published it.

`to_dataset` makes the same rows of it again, in the order of their episodes. Messages have corners
of outlines in single precision; the bag's custom data states them as the data set does.
"""

import json
import os
import shutil
from collections.abc import Callable, Iterator
from math import isnan
from pathlib import Path
from typing import Any, Final

import numpy as np

from sain_bags.bag.metadata import OWN_TYPES, TopicQos
from sain_bags.rows.results import OK, OUTLINES_KEY, SECOND
from sain_bags.rows.topics import BODIES, PUSH_RESULT, SCENE, STROKE, WORLD
from sain_bags.writing.messages import MessageMaker
from sain_bags.writing.writer import BagWriter
from sain_core.errors import DatasetError, OutputError
from sain_core.guarding.documents import read_json
from sain_core.push import PUSH_NAMES, PUSH_SIZE, STROKE_NAMES
from sain_core.scene import RADIUS, STATE_NAMES
from sain_core.shapes.bodies import Role
from sain_core.shapes.outlines import OUTLINES_FILE
from sain_core.shapes.shape import Shape
from sain_core.shapes.solids import support_points
from sain_core.transitions import (
    FRICTIONS,
    ORIGINS,
    Column,
    Columns,
    Values,
    read_shard,
    row_bodies,
    shard_paths,
)
from sain_core.types import Scene
from sain_core.wire.bodies import stated_parts

PAUSE: Final = SECOND  # [ns], between two pushes
TOPICS: Final = {
    BODIES: "/sain/shapes", WORLD: "/sain/world_parameters", SCENE: "/sain/scene",
    STROKE: "/sain/stroke", PUSH_RESULT: "/sain/push_result",
}  # fmt: skip
LATCHED: Final = (BODIES, WORLD)
LEFT: Final = 1 << 32  # added to the id of a scene that the next push does not begin in
MORE: Final[Values] = {  # columns, with what is recorded where a data set lacks them
    **dict.fromkeys(FRICTIONS, np.nan), Column.DURATION: 0.0, Column.PHYSICS_SOURCE: "physics",
}  # fmt: skip

Row = dict[str, Any]  # of `Columns`, with the bodies under `BODIES`
Progress = Callable[[int, int], None]


def write_recording(data: Path, out: Path, progress: Progress = lambda done, of: None) -> int:
    """Write the pushes of a data set as a bag, and return how many there are.

    `progress` is called with how many are written, and of how many.

    Raises:
        DatasetError: the folder has no npz shards, or one of them is damaged or lacks a column.
        OutputError: there is something at `out`, or it cannot be written.
        InvalidInputError: no definitions of messages are installed.
    """
    if os.path.lexists(out):
        raise OutputError(f"{out} exists; a bag is never overwritten, choose another")
    shards = [_read(path) for path in shard_paths(data)]
    messages, outlines = MessageMaker(), data / OUTLINES_FILE
    has_strokes = any(shard[Column.ACTION].shape[1] > PUSH_SIZE for shard in shards)
    topics = [
        messages.topic(name, kind, _offered(kind))
        for kind, name in TOPICS.items()
        if has_strokes or kind != STROKE
    ]
    about = {OUTLINES_KEY: json.dumps(read_json(outlines))} if outlines.exists() else {}
    count = sum(len(shard[Column.EPISODE]) for shard in shards)
    bag = BagWriter(out, custom_data=about)
    try:
        with bag as writer:
            for topic in topics:
                writer.add_topic(topic)
            recorder = _Recorder(writer, messages)
            for number, row in enumerate(_in_order(shards), start=1):
                recorder.push(number, row)
                progress(number, count)
    except BaseException:  # also Ctrl-C: a part would look like the whole
        shutil.rmtree(out, ignore_errors=True)
        raise
    return count


def _offered(kind: str) -> tuple[TopicQos, ...]:
    return (TopicQos(durability="transient_local" if kind in LATCHED else "volatile"),)


def _read(path: Path) -> Columns:
    """Return the columns of a shard, with scenes (M, N, 8), and the bodies of each row."""
    columns = read_shard(path, MORE)
    if (wrong := np.minimum(columns[Column.EPISODE], columns[Column.STEP]) < 0).any():
        raise DatasetError(f"{path}: row {np.argmax(wrong)} lacks an episode or step of 0 or more")
    bodies = np.empty(len(columns[Column.STATE]), dtype=object)
    bodies[:] = row_bodies(columns)
    return columns | {BODIES: bodies}


def _in_order(shards: list[Columns]) -> Iterator[Row]:
    """Yield all rows by episode and step."""
    places = [(shard, row) for shard in shards for row in range(len(shard[BODIES]))]
    keys = [np.concatenate([one[key] for one in shards]) for key in (Column.STEP, Column.EPISODE)]
    for shard, row in (places[place] for place in np.lexsort(keys).tolist()):
        yield {name: column[row] for name, column in shard.items()}


class _Recorder:
    """Writes pushes one after the other, on a clock of its own: data sets have no times."""

    def __init__(self, writer: BagWriter, messages: MessageMaker) -> None:
        self._writer, self._messages = writer, messages
        self._now = self._scene = 0  # [ns]; id of the scene that the next push begins in
        self._last: Row = {Column.EPISODE: -1}

    def push(self, number: int, row: Row) -> None:
        """Write a push, and what a graph publishes before its result."""
        self._now += PAUSE
        ids = {"episode_id": int(row[Column.EPISODE]) + 1}
        if row[Column.EPISODE] != self._last[Column.EPISODE]:
            self._scene += 1
            self._begin(row, ids)
        else:
            self._scene += int(row[Column.STEP] - self._last[Column.STEP])
        self._last, action = row, row[Column.ACTION].tolist()
        before = self._show(row[Column.STATE], self._scene, ids)
        duration = float(row[Column.DURATION])
        self._now += max(round(SECOND * duration), 1)
        after = self._show(row[Column.NEXT_STATE], self._scene + LEFT, ids)
        numbers = dict(zip(PUSH_NAMES[1:], action[1:PUSH_SIZE], strict=True))
        names = {str(name): str(row[name]) for name in ORIGINS}
        if len(action) > PUSH_SIZE:
            tool = dict(zip(STROKE_NAMES[PUSH_SIZE:], action[PUSH_SIZE:], strict=True))
            self._write(STROKE, push_id=number, **tool, **names)
        pushed = self._make(
            "Push", push_id=number, scene_id=self._scene, body=int(action[0]), source=names["run"],
            **ids, **numbers,
        )  # fmt: skip
        physics = self._disks(row[Column.PHYSICS_NEXT])
        model = str(row[Column.PHYSICS_SOURCE])
        self._write(
            PUSH_RESULT, push_id=number, error_code=OK, push=pushed, before=before, after=after,
            duration=duration, prediction=self._make(
                "Prediction", model=model, error_code=OK, disks=physics
            ), **ids,
        )  # fmt: skip

    def _begin(self, row: Row, ids: dict[str, int]) -> None:
        """Write what holds for an episode."""
        bodies, radii = row[BODIES], row[Column.STATE][:, RADIUS].tolist()
        stated = zip(bodies.shapes, bodies.roles, bodies.tops, radii, strict=True)
        self._write(BODIES, bodies=[self._body(*one) for one in stated], **ids)
        known = {name: float(row[name]) for name in FRICTIONS}
        if not all(map(isnan, known.values())):
            self._write(WORLD, **known, **ids)

    def _body(self, shape: Shape, role: Role, top: float, radius: float) -> Any:
        make = self._messages.make
        corner, point = "geometry_msgs/msg/Point32", "geometry_msgs/msg/Point"
        parts = [
            make(
                "shape_msgs/msg/SolidPrimitive", type=kind, dimensions=np.array(sizes),
                polygon=make("geometry_msgs/msg/Polygon",
                             points=[make(corner, x=x, y=y) for x, y in corners.tolist()]),
            )
            for kind, sizes, corners in stated_parts(shape, radius, top)
        ]  # fmt: skip
        supports = support_points(shape, radius).tolist()
        return self._make(
            "Body", name=shape.name, role=str(role), radius=radius, symmetry=shape.symmetry,
            parts=parts, supports=[make(point, x=x, y=y, z=-top / 2) for x, y in supports],
        )  # fmt: skip

    def _show(self, scene: Scene, scene_id: int, ids: dict[str, int]) -> Any:
        """Write a scene (N, 8) at rest, and return it."""
        seconds, nanoseconds = divmod(self._now, SECOND)
        stamp = self._messages.make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
        header = self._messages.make("std_msgs/msg/Header", stamp=stamp, frame_id="world")
        about = {"header": header, "scene_id": scene_id, "settled": True, **ids}
        return self._write(SCENE, disks=self._disks(scene), **about)

    def _disks(self, scene: Scene) -> list[Any]:
        rows = (dict(zip(STATE_NAMES, row, strict=True)) for row in scene.tolist())
        return [self._make("DiskState", **row) for row in rows]

    def _make(self, kind: str, /, **fields: Any) -> Any:
        return self._messages.make(f"{OWN_TYPES}{kind}", **fields)

    def _write(self, kind: str, /, **fields: Any) -> Any:
        message = self._messages.make(kind, **fields)
        self._writer.write(TOPICS[kind], self._messages.data(message), self._now)
        return message
