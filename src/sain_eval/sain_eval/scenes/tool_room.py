"""Places for bodies of any shape where the tool can stand all around them."""

import numpy as np

from sain_core.feasibility import Feasibility
from sain_core.scene import POSITION, RADIUS, TARGET
from sain_core.types import Mask, Place, Points, Scalars, Scene
from sain_eval.scenes.placement import EDGE_ROOM

TRIES = 200  # for one body, before all are placed anew
BODY_GAP = 0.03  # [m], between circumscribed circles: the tool fits in between
BLOCKER_GAP = 0.02  # [m], between circumscribed circles of bodies in the way and all others
LANE_SHARE = 0.5  # of the two radii: a body whose centre is so near the target's way blocks it


def has_tool_room(points: Points, sizes: Scalars, feasibility: Feasibility) -> Mask:
    """Tell where bodies lie on the table with room for the tool all around.

    Args:
        points: (..., 2) [m], their centres.
        sizes: (...,) [m], their circumscribed radii.
        feasibility: table, reach and tool.
    """
    table, reach, limits = feasibility.table, feasibility.reach, feasibility.limits
    edge = np.asarray(sizes + EDGE_ROOM)[..., None]
    on_table = table.contains(points - edge) & table.contains(points + edge)
    away = sizes + limits.clearance + limits.tool_radius
    distance = np.hypot(points[..., 0], points[..., 1])
    inside = (distance - away >= reach.inner) & (distance + away <= reach.outer)
    return np.asarray(on_table & inside & reach.contains(points))


def draw_places(
    sizes: Scalars,
    random: np.random.Generator,
    starts: Points | None = None,
    least_way: float = 0.0,
    feasibility: Feasibility = Feasibility(),
) -> Points:
    """Draw places (N, 2) for bodies with circumscribed radii (N,) [m], anywhere that is allowed.

    Each is at least `least_way` [m] from the body's start (N, 2), where there are starts.
    """
    outer = feasibility.reach.outer
    while True:
        places: list[np.ndarray] = []
        for body, size in enumerate(sizes.tolist()):
            draws = random.uniform((0.0, -outer), (outer, outer), (TRIES, 2))
            fits = has_tool_room(draws, np.full(TRIES, size), feasibility)
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


def draw_blockers(
    pair: Scene,
    goal: Place,
    sizes: Scalars,
    random: np.random.Generator,
    feasibility: Feasibility = Feasibility(),
) -> Points | None:
    """Draw places (B, 2) in the straight lane of the target of a scene (2, 8) to its goal (2,).

    None when there is no place for one of the bodies with circumscribed radii (B,) [m].
    """
    target = pair[TARGET, POSITION]
    way = goal - target
    length = float(np.linalg.norm(way))
    ahead = way / length
    across = np.array([-ahead[1], ahead[0]])
    taken = [(disk[POSITION], float(disk[RADIUS])) for disk in pair]
    places: list[np.ndarray] = []
    for size in sizes.tolist():
        half = LANE_SHARE * (size + pair[TARGET, RADIUS])
        along = random.uniform(0.0, length, TRIES)
        beside = random.uniform(-half, half, TRIES)
        draws = target + along[:, None] * ahead + beside[:, None] * across
        fits = has_tool_room(draws, np.full(TRIES, size), feasibility)
        for place, radius in taken:
            fits &= np.linalg.norm(draws - place, axis=1) >= size + radius + BLOCKER_GAP
        if not fits.any():
            return None
        places.append(draws[np.argmax(fits)])
        taken.append((places[-1], size))
    return np.stack(places)
