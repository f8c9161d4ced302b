"""Where goals and further disks may go so that a scene can be solved."""

from math import pi

import numpy as np

from sain_core.feasibility import Feasibility, reachable
from sain_core.push import make_push
from sain_core.scene import MID, POSITION, RADIUS, TARGET, Table, make_scene, unit
from sain_core.types import Angles, Place, Points, Scene

GOAL_TRIES = 20  # before the disks are placed anew
DISK_TRIES = 200
EDGE_ROOM = 0.02  # [m], between the rim of a disk at rest and the table's edge
CORRIDOR_ROOM = 0.01  # [m], between further disks and the way of mid disk and target
DISK_ROOM = 0.02  # [m], between further disks and the others
NEIGHBOURHOOD = 0.35  # [m], further disks lie this near the middle of the target's way


def touching_distance(scene: Scene) -> float:
    """Return the distance [m] of mid disk and target when they touch."""
    return float(scene[MID, RADIUS] + scene[TARGET, RADIUS])


def draw_goal(
    pair: Scene,
    distance: tuple[float, float],
    feasibility: Feasibility,
    random: np.random.Generator,
) -> Place | None:
    """Draw a goal (2,) that a straight push from behind can reach; None when none is found."""
    target = pair[TARGET, POSITION]
    for _ in range(GOAL_TRIES):
        heading = np.asarray(random.uniform(-pi, pi))
        way = random.uniform(*distance)
        goal = target + way * unit(heading)
        if not has_room(goal, pair[TARGET, RADIUS], feasibility.table):
            continue
        if not feasibility.reach.contains(goal):
            continue
        if _can_be_pushed(pair, heading, way, feasibility):
            return np.asarray(goal)
    return None


def _can_be_pushed(pair: Scene, heading: Angles, way: float, feasibility: Feasibility) -> bool:
    """Tell whether the arm can push straight along, once the mid disk is behind the target."""
    behind = pair.copy()
    behind[MID, POSITION] = pair[TARGET, POSITION] - touching_distance(pair) * unit(heading)
    stroke = make_push(float(heading), 0.0, way)
    room = has_room(behind[MID, POSITION], pair[MID, RADIUS], feasibility.table)
    return room and bool(reachable(behind, stroke, feasibility.limits, feasibility.reach))


def has_room(point: Place, radius: float, table: Table) -> bool:
    """Tell whether a disk at a point (2,) lies on the table with some room to the edge."""
    margin = radius + EDGE_ROOM
    corners = point + margin * np.array([[-1, -1], [1, 1]])
    return bool(table.contains(corners).all())


def draw_extra_disks(
    pair: Scene,
    goal: Place,
    radii: tuple[float, ...],
    feasibility: Feasibility,
    random: np.random.Generator,
) -> Points | None:
    """Draw places (N - 2, 2) for further disks that leave the straight way to the goal open.

    The way is that of the target to the goal, of the mid disk behind it, and of the tool
    behind that. None when no place is found for one of them.
    """
    placed = pair
    places = np.empty((0, 2))
    middle = (pair[TARGET, POSITION] + goal) / 2
    for radius in radii:
        for _ in range(DISK_TRIES):
            place = middle + random.uniform(-NEIGHBOURHOOD, NEIGHBOURHOOD, 2)
            if not has_room(place, radius, feasibility.table):
                continue
            apart = np.linalg.norm(placed[:, POSITION] - place, axis=-1)
            if (apart < placed[:, RADIUS] + radius + DISK_ROOM).any():
                continue
            if _leaves_way_open(place, radius, pair, goal, feasibility):
                break
        else:
            return None
        places = np.concatenate([places, place[None]])
        placed = np.concatenate([placed, make_scene(place[None], np.ones(1), np.array([radius]))])
    return places


def _leaves_way_open(
    place: Place, radius: float, pair: Scene, goal: Place, feasibility: Feasibility
) -> bool:
    target = pair[TARGET, POSITION]
    way = (goal - target) / np.linalg.norm(goal - target)
    limits = feasibility.limits
    behind = touching_distance(pair)
    tool = behind + pair[MID, RADIUS] + limits.clearance + limits.tool_radius
    lanes = (
        (0.0, pair[TARGET, RADIUS]),
        (behind, pair[MID, RADIUS]),
        (tool, limits.tool_radius),
    )
    return all(
        _segment_distance(place, target - back * way, goal - back * way)
        >= radius + width + CORRIDOR_ROOM
        for back, width in lanes
    )


def _segment_distance(point: Place, start: Place, end: Place) -> float:
    way = end - start
    share = np.clip((point - start) @ way / (way @ way), 0.0, 1.0)
    return float(np.linalg.norm(start + share * way - point))
