"""The YAML file that states what a camera cannot see: shape, role, radius and mass of each body.

And by what a body is recognised: tags on its top, a frame on ``/tf``, or a topic with its pose.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import check_angle, check_number, check_text
from sain_core.errors import ConfigError
from sain_core.guarding.documents import dump_yaml, read_user_yaml
from sain_core.guarding.plugins import did_you_mean
from sain_core.guarding.untrusted import (
    LEAST_RADIUS,
    LONGEST_PATH,
    MOST_BODIES,
    MOST_RADIUS,
    check_frame,
    check_ros_name,
)
from sain_core.scene import DISK_HEIGHT, MASS, NOMINAL_MASS, POSE, RADIUS, make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import register
from sain_core.shapes.outlines import (
    LEAST_MASS,
    MOST_HEIGHT,
    MOST_MASS,
    BodyOutline,
    named_outlines,
)
from sain_core.shapes.shape import FEET, FLAT, FLAT_MARK, Shape
from sain_core.types import Points, Scene

T = TypeVar("T")
Poses = Float[ndarray, "N 3"]  # x, y [m], heading [rad]

KEYS: Final = (
    "name", "shape", "role", "radius", "mass", "height", "tags", "frame", "topic",
)  # fmt: skip
TAG_KEYS: Final = ("id", "size", "x", "y", "angle")
NEEDED: Final = ("shape", "radius")
UNKNOWN: Final = "unknown"
TAG_SIZE: Final = 0.04  # [m], where a file gives none
TAG_SIZES: Final = (0.005, 0.5)  # [m]
MOST_TAGS: Final = 32  # of a body
OVERLAP: Final = 0.01  # of the smaller of two tags, that the other may cover by rounding
LAST_TAG: Final = 586  # of family 36h11, the largest


@dataclass(frozen=True)
class Tag:
    """A tag on the top of a body, by its centre and the way of its x axis in the body's frame.

    The x axis points right where AprilTag's picture is upright.
    """

    number: int  # its id
    size: float = TAG_SIZE  # side of its black square [m]
    x: float = 0.0  # [m]
    y: float = 0.0  # [m]
    angle: float = 0.0  # [rad]

    def corners(self) -> Points:
        """Return its corners (4, 2) in the body's frame [m]: upper left, then clockwise."""
        half = self.size / 2 * np.array([(-1, 1), (1, 1), (1, -1), (-1, -1)])
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        return np.asarray(half @ np.array([[cosine, sine], [-sine, cosine]]) + (self.x, self.y))


@dataclass(frozen=True)
class BodyFile:
    """What is known of the bodies on a table, in the order of its scenes."""

    bodies: Bodies  # shapes and roles
    names: tuple[str, ...]  # of each its own, for messages and detections
    radii: tuple[float, ...]  # [m], as in a scene
    masses: tuple[float, ...]  # [kg]; nominal where unknown
    tags: tuple[tuple[Tag, ...], ...]  # on the tops; none: found otherwise
    frames: tuple[str, ...]  # on ``/tf``; "": none
    topics: tuple[str, ...]  # with poses; "": none
    weighed: bool  # whether all masses are known

    def scene(self, poses: Poses) -> Scene:
        """Return bodies at rest (N, 8) at poses (N, 3)."""
        scene = make_scene(poses[:, :2], np.array(self.masses), np.array(self.radii))
        scene[:, POSE] = poses
        return scene

    @property
    def heights(self) -> tuple[float, ...]:
        """Heights of the tops over the table (N,) [m]."""
        return self.bodies.tops

    def called(self, body: int) -> str:
        """Return what a body is called in messages."""
        return f"body {body} ({self.names[body]})"


def read_bodies(path: Path) -> BodyFile:
    """Return the bodies that a YAML file states; raises `ConfigError`, naming file and body."""
    content = read_user_yaml(path, "bodies file")
    try:
        return parse_bodies(content)
    except ConfigError as error:
        raise ConfigError(f"bodies file {path}: {error}") from error


def parse_bodies(content: Any) -> BodyFile:
    """Return the bodies that the content of a file states; raises as `read_bodies`."""
    rows = content.get("bodies") if isinstance(content, Mapping) else None
    if not isinstance(rows, list) or not 1 <= len(rows) <= MOST_BODIES:
        raise ConfigError(f"it must have a list 'bodies' of 1 to {MOST_BODIES} bodies")
    for number, row in enumerate(rows):
        _check_keys(row, f"body {number}")

    def column(key: str, default: Any, check: Callable[..., T], *allowed: Any) -> list[T]:
        values = (row.get(key, default) for row in rows)
        return [check(f"{key} of body {body}", one, *allowed) for body, one in enumerate(values)]

    frames, topics, roles, names = (
        column(key, "", check_text, 0) for key in ("frame", "topic", "role", "name")
    )
    shapes = column("shape", "", check_text, 0, LONGEST_PATH)  # of a file, by its path
    tags = [_tags(row.get("tags", []), number) for number, row in enumerate(rows)]
    _check_sources(frames, topics, tags)
    own_names = _all_named(names, shapes)
    _check_unique("name", own_names)
    if any(roles) and not all(roles):
        raise ConfigError(f"body {roles.index('')} has no role and others have; give all or none")
    masses = column("mass", UNKNOWN, _mass)
    radii = column("radius", None, check_number, LEAST_RADIUS, MOST_RADIUS, "m")
    heights = column("height", DISK_HEIGHT, check_number, LEAST_RADIUS, MOST_HEIGHT, "m")
    bodies = Bodies.named(shapes, roles if all(roles) else (), heights)
    for number, body in enumerate(zip(tags, bodies.shapes, radii, strict=True)):
        if body[0]:
            _check_tags(number, *body)
    return BodyFile(
        bodies=bodies,
        names=own_names,
        radii=tuple(radii),
        masses=tuple(NOMINAL_MASS if mass is None else mass for mass in masses),
        tags=tuple(tags),
        frames=tuple(frames),
        topics=tuple(topics),
        weighed=None not in masses,
    )


def outlined_bodies(
    outlines: Mapping[str, BodyOutline], names: Sequence[str], tagged: bool = False
) -> BodyFile:
    """Return the bodies of these names of a file of outlines, flat on the table, all pushable.

    Their shapes are registered in this process. A mass that the file does not state is unknown, a
    height that of our bodies. With `tagged`, each has the tag of its own number in its middle.

    Raises:
        ConfigError: the file has none of a name, or the middle of a body is beside it.
    """
    rows = []
    for body, (name, one) in enumerate(zip(names, named_outlines(outlines, names), strict=True)):
        register(one.shape)
        row: dict[str, Any] = {"name": name if names.count(name) == 1 else f"{name}_{body}"}
        row |= {"shape": one.shape.on(FLAT).name, "role": "pushable", "radius": one.radius}
        row |= {"mass": one.mass or UNKNOWN, "height": one.height or DISK_HEIGHT}
        rows.append(row | ({"tags": body} if tagged else {}))
    return parse_bodies({"bodies": rows})


def write_tagged_bodies(
    path: Path, scene: Scene, bodies: Bodies, sources: Mapping[str, str] | None = None
) -> None:
    """Write the file of bodies (N, 8) of which each has the tag with its own number in the middle.

    It is as sizes and masses are known in a simulator. Shapes that are read from a file have it as
    their source, by their names: ``FILE:BODY``.
    """
    rows = [
        {
            "name": f"body_{body}",
            "shape": _source(shape, sources),
            "height": float(top),
            "role": str(role),
            "radius": float(state[RADIUS]),
            "mass": float(state[MASS]),
            "tags": body,
        }
        for body, (shape, role, top, state) in enumerate(
            zip(bodies.shapes, bodies.roles, bodies.tops, scene, strict=True)
        )
    ]
    path.write_text(dump_yaml({"bodies": rows}))


def _source(shape: Shape, sources: Mapping[str, str] | None) -> str:
    """Return where a shape is found, by its name or in a file, with its bottom."""
    name = shape.on(FEET).name
    return (sources or {}).get(name, name) + FLAT_MARK * shape.lies_flat


def _check_unique(key: str, values: Sequence[Any]) -> None:
    for value in values:
        if value != "" and values.count(value) > 1:
            raise ConfigError(f"two bodies have the {key} {value!r}; each needs its own")


def _check_sources(
    frames: Sequence[str], topics: Sequence[str], tags: Sequence[Sequence[Tag]]
) -> None:
    """Check by what bodies are found; raises `ConfigError`, also where two are found by one."""
    for number, (frame, topic) in enumerate(zip(frames, topics, strict=True)):
        check_frame(f"frame of body {number}", frame)
        if topic:
            check_ros_name(f"topic of body {number}", topic)
    _check_unique("frame", frames)
    _check_unique("topic", topics)
    owners: dict[int, int] = {}
    for body, tag in ((body, tag) for body, row in enumerate(tags) for tag in row):
        if tag.number in owners:
            other = owners[tag.number]
            where = f"twice on body {body}" if other == body else f"on bodies {other} and {body}"
            raise ConfigError(f"tag {tag.number} is {where}; each tag may be given once")
        owners[tag.number] = body


def _check_tags(body: int, tags: Sequence[Tag], shape: Shape, radius: float) -> None:
    """Check that tags lie on a body and apart: in its convex hull, for a tag may cover a hollow."""
    from shapely import MultiPoint, Point, Polygon

    outline = shape.outline(radius)
    across = 2.0 * float(np.hypot(*outline.T).max())
    top = MultiPoint(outline).convex_hull
    for place, tag in enumerate(tags):
        what = f"tag {tag.number} of body {body}"
        if tag.size > across:
            raise ConfigError(
                f"{what} has a side of {tag.size:g} m and the body is {across:.4g} m across; it"
                " must lie on the body: correct its size, or the body's radius"
            )
        if not top.covers(Point(tag.x, tag.y)):
            raise ConfigError(
                f"{what} is at ({tag.x:g}, {tag.y:g}) m, beside the body of radius {radius:g} m;"
                " its centre must be on the body: correct x and y [m], in the body's frame"
            )
        for other in tags[:place]:
            shared = Polygon(tag.corners()).intersection(Polygon(other.corners())).area
            if shared > OVERLAP * min(tag.size, other.size) ** 2:
                raise ConfigError(
                    f"{what} lies where its tag {other.number} does; tags must be apart: correct x,"
                    " y and size"
                )


def _all_named(names: Sequence[str], shapes: Sequence[str]) -> tuple[str, ...]:
    """Return a name of its own for each body: as given, or that of its shape, without folders."""
    made: list[str] = []
    shapes = [shape.rpartition("/")[2] for shape in shapes]
    for body, (name, shape) in enumerate(zip(names, shapes, strict=True)):
        free = shape not in made and shape not in names
        made.append(name or (shape if free else f"{shape}_{body}"))
    return tuple(made)


def _tags(value: Any, body: int) -> tuple[Tag, ...]:
    """Return the tags of a body: a number, or a list of numbers and of mappings."""
    rows = value if isinstance(value, list) else [value]
    if len(rows) > MOST_TAGS:
        raise ConfigError(f"body {body} has {len(rows)} tags; allowed: up to {MOST_TAGS}")
    return tuple(_tag(row, f"a tag of body {body}") for row in rows)


def _tag(row: Any, what: str) -> Tag:
    given = row if isinstance(row, Mapping) else {"id": row}
    _check_keys(given, what, TAG_KEYS, ("id",))
    number = int(check_number(f"id of {what}", given["id"], 0, LAST_TAG, whole=True))
    size = check_number(f"size of {what}", given.get("size", TAG_SIZE), *TAG_SIZES, "m")
    x, y = (
        check_number(f"{key} of {what}", given.get(key, 0.0), -MOST_RADIUS, MOST_RADIUS, "m")
        for key in "xy"
    )
    angle = check_angle(f"angle of {what}", given.get("angle", 0.0))
    return Tag(number, size, x, y, angle)


def _check_keys(
    row: Any, what: str, keys: Sequence[str] = KEYS, needed: Sequence[str] = NEEDED
) -> None:
    if not isinstance(row, Mapping):
        raise ConfigError(f"{what} is {row!r}; it must have keys: {', '.join(keys)}")
    for key in row:
        if key not in keys:
            hint = did_you_mean(str(key), keys)
            raise ConfigError(f"{what} has the key {key!r}{hint}; allowed: {', '.join(keys)}")
    for key in needed:
        if key not in row:
            raise ConfigError(f"{what} has no {key}; it needs {' and '.join(needed)}")


def _mass(name: str, value: Any) -> float | None:
    return None if value == UNKNOWN else check_number(name, value, LEAST_MASS, MOST_MASS, "kg")
