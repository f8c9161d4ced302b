"""Where two outlines are nearest each other, compiled: the local geometry of a contact.

The closest features of two outlines are a corner of one and a side or a corner of the other. Where
two sides lie along each other, all of both is equally near. So that nothing jumps when they turn a
little, a contact is the mean over all such pairs, of which the weight falls off with their gap. It
depends on the outline alone: not on how that is cut into parts, nor on which corner is the first.

A disk, and the tool, is one corner that is rounded by its radius.
"""

from typing import NamedTuple

import numpy as np

from sain_model.compute.compiling import compiled

SOFTNESS = 0.0015  # [m], a gap larger by this counts e times less
CUT = 6.0 * SOFTNESS
FAR = 0.08  # [m], circumscribed circles that are further apart make no contact

# Rows of a body's pose, and of a contact: its middle [m], the normal from the first body to the
# second, the gap [m] and how far it extends along its tangent [m].
POSE_X, POSE_Y, POSE_COS, POSE_SIN, POSE_RADIUS = range(5)
AT_X, AT_Y, NORMAL_X, NORMAL_Y, APART, EXTENT = range(6)
POSE_SIZE, PATCH_SIZE = 5, 6
SUMS = 9  # that `find_patch` works with


class OutlineTable(NamedTuple):
    """The outlines of N bodies and, behind them, of the tool; in units of the states' radii."""

    first_corner: np.ndarray  # (N + 2,) int64
    corners: np.ndarray  # (M, 2), counter-clockwise
    rounding: np.ndarray  # (N + 1,), 1 for what is round, else 0
    reach: np.ndarray  # (N + 1,), circumscribed radius
    inertia: np.ndarray  # (N + 1,), upright moment, share of mass x radius^2
    supports: np.ndarray  # (N, 6): second moment of the loads, their 2nd and 3rd order in the plane


@compiled
def place_corners(table, poses, placed):
    """Write where the corners (M, 2) [m] are of bodies in poses (N + 1, 5)."""
    for body in range(poses.shape[0]):
        cos, sin = poses[body, POSE_COS], poses[body, POSE_SIN]
        for corner in range(table.first_corner[body], table.first_corner[body + 1]):
            x = poses[body, POSE_RADIUS] * table.corners[corner, 0]
            y = poses[body, POSE_RADIUS] * table.corners[corner, 1]
            placed[corner, 0] = poses[body, POSE_X] + cos * x - sin * y
            placed[corner, 1] = poses[body, POSE_Y] + sin * x + cos * y


@compiled
def _foot(placed, corner, here, after):
    """Return the distance of a corner from a side, and the unit vector from the side to it.

    The distance is negative for a corner behind the side.
    """
    way_x, way_y = placed[after, 0] - placed[here, 0], placed[after, 1] - placed[here, 1]
    off_x, off_y = placed[corner, 0] - placed[here, 0], placed[corner, 1] - placed[here, 1]
    squared = way_x * way_x + way_y * way_y
    share = 0.0
    if squared > 0.0:
        share = (off_x * way_x + off_y * way_y) / squared
    if 0.0 < share < 1.0:
        scale = 1.0 / np.sqrt(squared)
        normal_x, normal_y = scale * way_y, -scale * way_x  # outward, as outlines turn left
        return off_x * normal_x + off_y * normal_y, normal_x, normal_y
    if share >= 1.0:
        off_x, off_y = off_x - way_x, off_y - way_y
    distance = np.sqrt(off_x * off_x + off_y * off_y)
    scale = 1.0 / max(distance, 1e-12)
    return distance, scale * off_x, scale * off_y


@compiled
def _least_gap(table, placed, of, on, rounding):
    """Return the smallest gap [m] between corners of a body and sides of another."""
    least = np.inf
    for corner in range(table.first_corner[of], table.first_corner[of + 1]):
        here = table.first_corner[on + 1] - 1
        for after in range(table.first_corner[on], table.first_corner[on + 1]):
            distance = _foot(placed, corner, here, after)[0]
            least = min(least, abs(distance - rounding))
            here = after
    return least


@compiled
def _add_near(table, placed, poses, of, on, least, way, sums):
    """Add up what is near: corners of body `of` about sides of body `on`, weighted.

    `least` is the smallest gap of the two [m], `way` 1 where the normal is from `of` to `on`, else
    -1. The sums (9,) are weight, then weighted x, y, normal, gap, xx, xy and yy.
    """
    round_of = table.rounding[of] * poses[of, POSE_RADIUS]
    round_on = table.rounding[on] * poses[on, POSE_RADIUS]
    for corner in range(table.first_corner[of], table.first_corner[of + 1]):
        here = table.first_corner[on + 1] - 1
        for after in range(table.first_corner[on], table.first_corner[on + 1]):
            distance, normal_x, normal_y = _foot(placed, corner, here, after)
            here = after
            gap = distance - round_of - round_on
            if abs(gap) - least > CUT:
                continue
            weight = np.exp((least - abs(gap)) / SOFTNESS)
            inward = round_of + 0.5 * gap
            x = placed[corner, 0] - inward * normal_x
            y = placed[corner, 1] - inward * normal_y
            sums[0] += weight
            sums[1] += weight * x
            sums[2] += weight * y
            sums[3] -= way * weight * normal_x
            sums[4] -= way * weight * normal_y
            sums[5] += weight * gap
            sums[6] += weight * x * x
            sums[7] += weight * x * y
            sums[8] += weight * y * y


@compiled
def find_patch(table, placed, poses, first, second, sums, patch):
    """Write the contact (6,) of two bodies, or an infinite gap where they are far apart."""
    x = poses[second, POSE_X] - poses[first, POSE_X]
    y = poses[second, POSE_Y] - poses[first, POSE_Y]
    reach = table.reach[first] * poses[first, POSE_RADIUS]
    reach += table.reach[second] * poses[second, POSE_RADIUS]
    for row in range(PATCH_SIZE):
        patch[row] = 0.0
    if np.sqrt(x * x + y * y) - reach > FAR:
        patch[APART] = np.inf
        return
    rounding = table.rounding[first] * poses[first, POSE_RADIUS]
    rounding += table.rounding[second] * poses[second, POSE_RADIUS]
    least = min(
        _least_gap(table, placed, first, second, rounding),
        _least_gap(table, placed, second, first, rounding),
    )
    for row in range(sums.shape[0]):
        sums[row] = 0.0
    _add_near(table, placed, poses, first, second, least, 1.0, sums)
    _add_near(table, placed, poses, second, first, least, -1.0, sums)
    scale = 1.0 / sums[0]
    patch[AT_X], patch[AT_Y], patch[APART] = scale * sums[1], scale * sums[2], scale * sums[5]
    length = max(np.sqrt(sums[3] * sums[3] + sums[4] * sums[4]), 1e-12)
    patch[NORMAL_X], patch[NORMAL_Y] = sums[3] / length, sums[4] / length
    along_x, along_y = -patch[NORMAL_Y], patch[NORMAL_X]
    xx = scale * sums[6] - patch[AT_X] * patch[AT_X]
    xy = scale * sums[7] - patch[AT_X] * patch[AT_Y]
    yy = scale * sums[8] - patch[AT_Y] * patch[AT_Y]
    squared = along_x * along_x * xx + 2.0 * along_x * along_y * xy + along_y * along_y * yy
    patch[EXTENT] = np.sqrt(max(squared, 0.0))
