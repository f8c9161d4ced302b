"""Where goals and bodies may go so that a scene can be solved."""

from collections.abc import Iterable, Sequence
from math import pi
from typing import Final, NamedTuple

import numpy as np
from numpy import ndarray

from sain_core.errors import ConfigError
from sain_core.feasibility import Feasibility, reachable
from sain_core.push import make_push
from sain_core.scene import MID, POSITION, RADIUS, TARGET, make_scene, unit
from sain_core.shapes.shape import Pair
from sain_core.types import Angles, Mask, Place, Points, Scalars, Scene

GOAL_TRIES: Final = 20  # before the disks are placed anew
TRIES: Final = 200  # for one body, before all are placed anew
EDGE_ROOM: Final = 0.02  # [m], between the rim of a disk at rest and the table's edge
CORRIDOR_ROOM: Final = 0.01  # [m], between further disks and the path of mid disk and target
DISK_ROOM: Final = 0.02  # [m], between further disks and the others
NEIGHBOURHOOD: Final = 0.35  # [m], further disks lie this near the middle of the target's path
STRIP_TRIES: Final = 4000  # of all bodies, before the strips become wider
WIDER: Final = (0.0, 0.05, 0.1, 0.15, 0.2)  # [m], all around
BODY_GAP: Final = 0.03  # [m], between circumscribed circles: the tool fits in between
BLOCKER_GAP: Final = 0.02  # [m], between circumscribed circles of bodies in the way and all others
FEASIBILITY: Final = Feasibility()
LANE_SHARE: Final = 0.5  # of the two radii: a body whose centre is so near the path blocks it


def touching_distance(scene: Scene) -> float:
    """Return the distance [m] of mid disk and target when they touch."""
    return float(scene[MID, RADIUS] + scene[TARGET, RADIUS])


def has_room(point: Place, radius: float) -> bool:
    """Tell whether a disk at a point (2,) lies on the table with some room to the edge."""
    margin = radius + EDGE_ROOM
    corners = point + margin * np.array([[-1, -1], [1, 1]])
    return bool(FEASIBILITY.table.contains(corners).all())


def has_tool_room(points: Points, sizes: ndarray) -> Mask:
    """Tell where bodies lie on the table with room for the tool all around.

    Points (..., 2) [m] are their centres, sizes [m] their circumscribed radii, which are broadcast.
    """
    table, reach, limits = FEASIBILITY.table, FEASIBILITY.reach, FEASIBILITY.limits
    edge = np.asarray(sizes + EDGE_ROOM)[..., None]
    on_table = table.contains(points - edge) & table.contains(points + edge)
    away = sizes + limits.clearance + limits.tool_radius
    distance = np.hypot(points[..., 0], points[..., 1])
    inside = (distance - away >= reach.inner) & (distance + away <= reach.outer)
    return np.asarray(on_table & inside & reach.contains(points))


def draw_goal(
    pair: Scene, distance: tuple[float, float], random: np.random.Generator
) -> Place | None:
    """Draw a goal (2,) that a straight push from behind can reach; None: none was drawn."""
    target = pair[TARGET, POSITION]
    for _ in range(GOAL_TRIES):
        heading = np.asarray(random.uniform(-pi, pi))
        length = random.uniform(*distance)
        goal = target + length * unit(heading)
        if not has_room(goal, pair[TARGET, RADIUS]):
            continue
        if FEASIBILITY.reach.contains(goal) and _can_be_pushed(pair, heading, length):
            return np.asarray(goal)
    return None


def _can_be_pushed(pair: Scene, heading: Angles, length: float) -> bool:
    """Tell whether the arm can push straight along, once the mid disk is behind the target."""
    behind = pair.copy()
    behind[MID, POSITION] = pair[TARGET, POSITION] - touching_distance(pair) * unit(heading)
    stroke = make_push(float(heading), 0.0, length)
    room = has_room(behind[MID, POSITION], pair[MID, RADIUS])
    return room and bool(reachable(behind, stroke, FEASIBILITY.limits, FEASIBILITY.reach))


def draw_extra_disks(
    pair: Scene, goal: Place, radii: Iterable[float], random: np.random.Generator
) -> Points | None:
    """Draw places (N - 2, 2) for further disks that leave the straight path to the goal open.

    The path is that of the target to the goal, of the mid disk behind it, and of the tool
    behind that. None: none was drawn for one of them.
    """
    placed, places = pair, np.empty((0, 2))
    middle = (pair[TARGET, POSITION] + goal) / 2
    for radius in radii:
        for _ in range(TRIES):
            place = middle + random.uniform(-NEIGHBOURHOOD, NEIGHBOURHOOD, 2)
            if not has_room(place, radius):
                continue
            apart = np.linalg.norm(placed[:, POSITION] - place, axis=-1)
            if (apart < placed[:, RADIUS] + radius + DISK_ROOM).any():
                continue
            if _leaves_path_open(place, radius, pair, goal):
                break
        else:
            return None
        places = np.concatenate([places, place[None]])
        placed = np.concatenate([placed, make_scene(place[None], np.ones(1), np.array([radius]))])
    return places


def _leaves_path_open(place: Place, radius: float, pair: Scene, goal: Place) -> bool:
    target = pair[TARGET, POSITION]
    ahead = (goal - target) / np.linalg.norm(goal - target)
    limits = FEASIBILITY.limits
    behind = touching_distance(pair)
    tool = behind + pair[MID, RADIUS] + limits.clearance + limits.tool_radius
    widths = pair[TARGET, RADIUS], pair[MID, RADIUS], limits.tool_radius
    return all(
        _segment_distance(place, target - back * ahead, goal - back * ahead)
        >= radius + width + CORRIDOR_ROOM
        for back, width in zip((0.0, behind, tool), widths, strict=True)
    )


def _segment_distance(point: Place, start: Place, end: Place) -> float:
    path = end - start
    share = np.clip((point - start) @ path / (path @ path), 0.0, 1.0)
    return float(np.linalg.norm(start + share * path - point))


def draw_places(
    sizes: Scalars,
    random: np.random.Generator,
    starts: Points | None = None,
    least_way: float = 0.0,
) -> Points:
    """Draw places (N, 2) for bodies with circumscribed radii (N,) [m], anywhere that is allowed.

    Each is at least `least_way` [m] from the body's start (N, 2), where there are starts.
    """
    outer = FEASIBILITY.reach.outer
    while True:
        places: list[np.ndarray] = []
        for body, size in enumerate(sizes.tolist()):
            draws = random.uniform((0.0, -outer), (outer, outer), (TRIES, 2))
            fits = has_tool_room(draws, np.full(TRIES, size))
            for other, place in enumerate(places):
                apart = np.linalg.norm(draws - place, axis=1)
                fits &= apart >= size + sizes[other] + BODY_GAP
            if starts is not None:
                fits &= np.linalg.norm(draws - starts[body], axis=1) >= least_way
            if not fits.any():
                break
            places.append(draws[np.argmax(fits)])
        else:
            return np.stack(places)


class Strip(NamedTuple):
    """Where goals are drawn."""

    x: Pair  # [m]
    y: float  # [m], either way from the middle


def draw_in_strips(
    sizes: Scalars, strips: Sequence[Strip], apart: float, random: np.random.Generator
) -> Points:
    """Draw places (N, 2) in the strip of each body of a circumscribed radius (N,) [m], in reach.

    They are at least `apart` [m] from each other, and circumscribed circles do not meet. Where so
    many do not fit, all strips become wider.

    Raises:
        ConfigError: they do not fit even so.
    """
    gaps = np.maximum(sizes[:, None] + sizes + BODY_GAP, apart)
    first, second = np.triu_indices(len(sizes), 1)
    low = np.array([(strip.x[0], -strip.y) for strip in strips])
    high = np.array([(strip.x[1], strip.y) for strip in strips])
    for wider in WIDER:
        draws = random.uniform(low - wider, high + wider, (STRIP_TRIES, len(sizes), 2))
        between = np.linalg.norm(draws[:, first] - draws[:, second], axis=-1)
        fits = has_tool_room(draws, sizes).all(axis=1)
        fits &= (between >= gaps[first, second]).all(axis=1)
        if fits.any():
            return np.asarray(draws[np.argmax(fits)])
    across = ", ".join(f"{2e3 * size:.0f}" for size in sizes)
    raise ConfigError(
        f"there is no room for bodies {across} mm across with the tool all around each, where the"
        " arm reaches; take fewer or smaller ones"
    )


def draw_blockers(
    pair: Scene, goal: Place, sizes: Scalars, random: np.random.Generator
) -> Points | None:
    """Draw places (B, 2) in the straight lane of the target of a scene (2, 8) to its goal (2,).

    None: none was drawn for one of the bodies with circumscribed radii (B,) [m].
    """
    target = pair[TARGET, POSITION]
    path = goal - target
    length = float(np.linalg.norm(path))
    ahead = path / length
    across = np.array([-ahead[1], ahead[0]])
    taken = [(disk[POSITION], float(disk[RADIUS])) for disk in pair]
    places: list[np.ndarray] = []
    for size in sizes.tolist():
        half = LANE_SHARE * (size + pair[TARGET, RADIUS])
        along = random.uniform(0.0, length, TRIES)
        beside = random.uniform(-half, half, TRIES)
        draws = target + along[:, None] * ahead + beside[:, None] * across
        fits = has_tool_room(draws, np.full(TRIES, size))
        for place, radius in taken:
            fits &= np.linalg.norm(draws - place, axis=1) >= size + radius + BLOCKER_GAP
        if not fits.any():
            return None
        places.append(draws[np.argmax(fits)])
        taken.append((places[-1], size))
    return np.stack(places)
