"""The tool's way through a push, compiled: a straight line with a trapezoid speed profile.

And where on it the tool first touches a body with an outline.
"""

from typing import NamedTuple

import numpy as np

from sain_model.compute.compiling import compiled
from sain_model.physics.body_kernels import (
    CONVEX,
    CORNER_X,
    CORNER_Y,
    COS,
    LENGTH,
    REACH,
    ROUND,
    SIDE_X,
    SIDE_Y,
    SIN,
    TOOL,
    X,
    Y,
)


class Profile(NamedTuple):
    """From rest to rest: speeding up for `ramp`, cruising, and braking for `ramp` until `end`."""

    length: float  # [m]
    acceleration: float  # [m/s^2]
    ramp: float  # [s]
    end: float  # [s]


@compiled
def make_profile(length, speed, acceleration):
    """Return the fastest profile over a length > 0 [m] within a speed and an acceleration."""
    ramp = min(speed / acceleration, np.sqrt(length / acceleration))
    return Profile(length, acceleration, ramp, ramp + length / (acceleration * ramp))


@compiled
def travelled(profile, time):
    """Return how far [m] the tool has come."""
    if time >= profile.end:
        return profile.length
    if time < profile.ramp:
        return 0.5 * profile.acceleration * time * time
    if time < profile.end - profile.ramp:
        return profile.acceleration * profile.ramp * (time - 0.5 * profile.ramp)
    return profile.length - 0.5 * profile.acceleration * (profile.end - time) ** 2


@compiled
def tool_speed(profile, time):
    """Return how fast [m/s] the tool moves."""
    return profile.acceleration * max(min(time, profile.ramp, profile.end - time), 0.0)


@compiled
def time_of(profile, distance):
    """Return when [s] the tool has come this far [m]: the inverse of `travelled`."""
    ramp_length = 0.5 * profile.acceleration * profile.ramp**2
    if distance < ramp_length:
        return np.sqrt(2.0 * distance / profile.acceleration)
    if distance <= profile.length - ramp_length:
        return distance / (profile.acceleration * profile.ramp) + 0.5 * profile.ramp
    left = max(profile.length - distance, 0.0)
    return profile.end - np.sqrt(2.0 * left / profile.acceleration)


@compiled
def until_kink(profile, time):
    """Return how long [s] the tool's acceleration stays as it is; infinite when it is over."""
    if time < profile.ramp - 1e-9:
        return profile.ramp - time
    if time < profile.end - profile.ramp - 1e-9:
        return profile.end - profile.ramp - time
    if time < profile.end - 1e-9:
        return profile.end - time
    return np.inf


@compiled
def first_touch_of(work, way_x, way_y):
    """Return how far [m] the tool travels until it touches any body; infinite if never."""
    bodies = work.bodies
    nearest = np.inf
    for row in range(1, bodies.shape[0]):
        dx, dy = bodies[TOOL, X] - bodies[row, X], bodies[TOOL, Y] - bodies[row, Y]
        reach = bodies[row, REACH] + bodies[TOOL, ROUND]
        across = dx * way_y - dy * way_x
        if abs(across) < reach and dx * way_x + dy * way_y < reach:
            nearest = min(nearest, _distance_to(work, row, dx, dy, way_x, way_y))
    return nearest


@compiled
def _distance_to(work, row, dx, dy, way_x, way_y):
    """Return how far [m] the tool, at (dx, dy) from a body's centre, travels until they touch.

    The tool's axis meets the outline grown by both radii: each side moved outward, and a circle
    about each convex corner.
    """
    bodies, corners = work.bodies, work.corners
    cos, sin = bodies[row, COS], bodies[row, SIN]
    x, y = cos * dx + sin * dy, cos * dy - sin * dx
    ux, uy = cos * way_x + sin * way_y, cos * way_y - sin * way_x
    rounding = bodies[row, ROUND] + bodies[TOOL, ROUND]
    nearest = np.inf
    for side in range(work.first_corner[row], work.first_corner[row + 1]):
        from_x, from_y = x - corners[side, CORNER_X], y - corners[side, CORNER_Y]
        closing = uy * corners[side, SIDE_X] - ux * corners[side, SIDE_Y]
        off = from_x * corners[side, SIDE_Y] - from_y * corners[side, SIDE_X]
        if closing > 0.0 and off >= 0.0:
            distance = max((off - rounding) / closing, 0.0)
            along = (from_x + distance * ux) * corners[side, SIDE_X]
            along += (from_y + distance * uy) * corners[side, SIDE_Y]
            if 0.0 <= along <= corners[side, LENGTH]:
                nearest = min(nearest, distance)
        if corners[side, CONVEX] == 1.0:
            ahead = -(from_x * ux + from_y * uy)
            squared = rounding * rounding - (from_x * from_x + from_y * from_y - ahead * ahead)
            if squared > 0.0 and ahead > 0.0:
                nearest = min(nearest, max(ahead - np.sqrt(squared), 0.0))
    return nearest
