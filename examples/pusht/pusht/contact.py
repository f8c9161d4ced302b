"""How a block of Push-T moves while a disk is pushed into it, compiled.

Nothing slides there: a block that is not pushed stops at once. There is no friction, and no bounce.
So each contact moves the block as an impulse at it would: along the normal, and about the centre of
mass. Disk and walls go where they go. All is in metres and radians.
"""

import numba
import numpy as np

STEP = 0.0012  # [m], of the disk, from one resolution of the contacts to the next
CRUSHED = 0.0008  # [m], how deep a block may still be in disk or wall after all rounds
ROUNDS = 4  # in which contacts are resolved one after another


@numba.njit(cache=True)
def push_blocks(poses, starts, ways, radius, corners, firsts, centre, gyration, low, high):
    """Return the poses (B, 3) of blocks after a disk went from starts (B, 2) by ways (B, 2).

    A block that would be crushed between disk and wall stays where it is: it might be pressed
    through the wall, which is thin.

    `corners` (M, 2) are those of convex parts, counter-clockwise, which begin at `firsts` (P + 1,);
    they, and the `centre` (2,) of mass, are in the block's frame. Walls are at `low` and `high`
    (2,).
    """
    after = poses.copy()
    placed = np.empty_like(corners)
    reach = radius + np.sqrt((corners**2).sum(axis=1).max())
    for row in range(len(poses)):
        pose, way = after[row], ways[row]
        count = int(np.ceil(np.hypot(way[0], way[1]) / STEP)) + 1
        for step in range(count + 1):
            x = starts[row, 0] + way[0] * step / count
            y = starts[row, 1] + way[1] * step / count
            if step == 0 or np.hypot(x - pose[0], y - pose[1]) < reach:
                left = resolve(
                    pose, x, y, radius, corners, firsts, centre, gyration, low, high, placed
                )
                if step > 0 and left > CRUSHED:
                    pose[:] = poses[row]
                    break
    return after


@numba.njit(cache=True)
def resolve(pose, x, y, radius, corners, firsts, centre, gyration, low, high, placed):
    """Move a block (3,) out of a disk at x, y and out of walls; return how deep it still was."""
    deepest = 0.0
    for _ in range(ROUNDS):
        place_corners(pose, corners, placed)
        deepest = 0.0
        for part in range(len(firsts) - 1):
            deep, at_x, at_y, normal_x, normal_y = _into(
                x, y, radius, placed, firsts[part], firsts[part + 1]
            )
            if deep > 0.0:
                deepest = max(deepest, deep)
                _shift(pose, deep, at_x, at_y, normal_x, normal_y, centre, gyration)
                place_corners(pose, corners, placed)
        for corner in range(len(placed)):
            for axis in range(2):
                along_x, along_y = 1.0 - axis, float(axis)
                lower = low[axis] - placed[corner, axis]
                upper = placed[corner, axis] - high[axis]
                deep = max(lower, upper)
                if deep > 0.0:
                    deepest = max(deepest, deep)
                    sign = 1.0 if lower > 0.0 else -1.0
                    at_x, at_y = placed[corner]
                    _shift(pose, deep, at_x, at_y, sign * along_x, sign * along_y, centre, gyration)
                    place_corners(pose, corners, placed)
        if deepest == 0.0:
            break
    return deepest


@numba.njit(cache=True)
def place_corners(pose, corners, placed):
    """Write where the corners (M, 2) of a body at a pose (3,) are."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    for corner in range(len(corners)):
        placed[corner, 0] = pose[0] + cos * corners[corner, 0] - sin * corners[corner, 1]
        placed[corner, 1] = pose[1] + sin * corners[corner, 0] + cos * corners[corner, 1]


@numba.njit(cache=True)
def _shift(pose, deep, at_x, at_y, normal_x, normal_y, centre, gyration):
    """Move a block (3,) by an impulse along a normal until a point has moved along it by `deep`."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    from_x, from_y = cos * centre[0] - sin * centre[1], sin * centre[0] + cos * centre[1]
    lever = (at_x - pose[0] - from_x) * normal_y - (at_y - pose[1] - from_y) * normal_x
    turn_of_one = lever / gyration**2
    share = deep / (1.0 + lever * turn_of_one)
    turn = share * turn_of_one
    cos, sin = np.cos(turn), np.sin(turn)
    pose[0] += share * normal_x + from_x - (cos * from_x - sin * from_y)
    pose[1] += share * normal_y + from_y - (sin * from_x + cos * from_y)
    pose[2] += turn


@numba.njit(cache=True)
def _into(x, y, radius, placed, first, last):
    """Return how deep a disk is in a convex part, the point of it, and the normal into the part."""
    inside, best, squared = True, -np.inf, np.inf
    at_x = at_y = near_x = near_y = normal_x = normal_y = 0.0
    for corner in range(first, last):
        after = corner + 1 if corner + 1 < last else first
        side_x, side_y = placed[after, 0] - placed[corner, 0], placed[after, 1] - placed[corner, 1]
        length = np.hypot(side_x, side_y)
        out_x, out_y = side_y / length, -side_x / length
        off_x, off_y = x - placed[corner, 0], y - placed[corner, 1]
        beyond = off_x * out_x + off_y * out_y
        if beyond >= radius:
            return 0.0, 0.0, 0.0, 0.0, 0.0
        inside = inside and beyond <= 0.0
        if beyond > best:
            best, normal_x, normal_y = beyond, -out_x, -out_y
            at_x, at_y = x - beyond * out_x, y - beyond * out_y
        along = min(max((off_x * side_x + off_y * side_y) / length**2, 0.0), 1.0)
        foot_x, foot_y = placed[corner, 0] + along * side_x, placed[corner, 1] + along * side_y
        away = (x - foot_x) ** 2 + (y - foot_y) ** 2
        if away < squared:
            squared, near_x, near_y = away, foot_x, foot_y
    if inside:
        return radius - best, at_x, at_y, normal_x, normal_y
    away = np.sqrt(squared)
    if away >= radius or away == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    return radius - away, near_x, near_y, (near_x - x) / away, (near_y - y) / away
