"""Where two outlines are near each other, compiled: corners against sides, corners against corners.

In the plane the closest features of two outlines are a corner of one and a side or a corner of
the other (Ericson, "Real-Time Collision Detection", chapter 5). Corners may be rounded: the tool
and a disk are one corner with a large radius. The outline of a whole body is looked at, not its
convex parts. So the seams between parts catch nothing, and how an outline is cut does not matter.
"""

import numpy as np

from sain_model.compute.compiling import compiled
from sain_model.physics.outline_kernels import (
    ALONG,
    CONVEX,
    CORNER_AT_X,
    CORNER_AT_Y,
    CORNER_X,
    CORNER_Y,
    COS,
    FACE_X,
    FACE_Y,
    FEATURE,
    GAP,
    KEY,
    LENGTH,
    LIGHTNESS,
    MOST_CONTACTS,
    POINT_BODY,
    POINT_X,
    POINT_Y,
    REACH,
    ROUND,
    SIDE_BODY,
    SIDE_X,
    SIDE_Y,
    SIN,
    SPIN,
    TOOL,
    VX,
    VY,
    X,
    Y,
)

NEAR = 0.005  # [m], features further apart are looked at again in the next step
FACING = 0.1  # sine of the angle by which a corner's sides may dip into a side that it entered
ON_SIDE, ON_CORNER = 0, 1


@compiled
def find_touching(work, horizon):
    """List the features of all bodies that are near each other, or will be soon.

    Args:
        work: scratch memory; its list of contacts is made anew, without impulses.
        horizon: no longer step than this will follow [s].
    """
    bodies, count = work.bodies, work.count
    count[0] = 0
    for second in range(1, bodies.shape[0]):
        for first in range(second):
            dx, dy = bodies[second, X] - bodies[first, X], bodies[second, Y] - bodies[first, Y]
            vx, vy = bodies[second, VX] - bodies[first, VX], bodies[second, VY] - bodies[first, VY]
            speed = abs(vx) + abs(vy)
            speed += abs(bodies[first, SPIN]) * bodies[first, REACH]
            speed += abs(bodies[second, SPIN]) * bodies[second, REACH]
            near = NEAR + horizon * speed
            reach = bodies[first, REACH] + bodies[second, REACH] + near
            if dx * dx + dy * dy < reach * reach:
                if bodies[first, LIGHTNESS] + bodies[second, LIGHTNESS] > 0.0:
                    limit = count[0] + MOST_CONTACTS
                    points_against_sides(work, first, second, near, True, limit)
                    if first != TOOL:
                        points_against_sides(work, second, first, near, False, limit)


@compiled
def points_against_sides(work, point_body, side_body, near, meet, limit):
    """List where corners of one body are near the outline of another.

    Args:
        work: scratch memory.
        point_body: row of the one.
        side_body: row of the other.
        near: largest gap to list [m].
        meet: whether to look at corners against corners as well.
        limit: how many contacts there may be after it.
    """
    bodies, corners = work.bodies, work.corners
    cos_side, sin_side = bodies[side_body, COS], bodies[side_body, SIN]
    dx = bodies[point_body, X] - bodies[side_body, X]
    dy = bodies[point_body, Y] - bodies[side_body, Y]
    away_x, away_y = cos_side * dx + sin_side * dy, cos_side * dy - sin_side * dx
    cos = bodies[point_body, COS] * cos_side + bodies[point_body, SIN] * sin_side
    sin = bodies[point_body, SIN] * cos_side - bodies[point_body, COS] * sin_side
    rounding = bodies[point_body, ROUND] + bodies[side_body, ROUND]
    reach = bodies[side_body, REACH] + bodies[point_body, ROUND] + near
    for point in range(work.first_corner[point_body], work.first_corner[point_body + 1]):
        if corners[point, CONVEX] == 0.0:
            continue
        x = away_x + cos * corners[point, CORNER_X] - sin * corners[point, CORNER_Y]
        y = away_y + sin * corners[point, CORNER_X] + cos * corners[point, CORNER_Y]
        if x * x + y * y < reach * reach:
            _point_against_sides(
                work, point_body, side_body, point, x, y, cos, sin, rounding, near, meet, limit
            )


@compiled
def _point_against_sides(
    work, point_body, side_body, point, x, y, cos, sin, rounding, near, meet, limit
):
    """List the features of an outline near a point (x, y), in that outline's frame."""
    corners, count = work.corners, work.count
    first, last = work.first_corner[side_body], work.first_corner[side_body + 1]
    nearest, inside = np.inf, False
    start, before = count[0], last - 1
    for side in range(first, last):
        dx, dy = x - corners[side, CORNER_X], y - corners[side, CORNER_Y]
        along = dx * corners[side, SIDE_X] + dy * corners[side, SIDE_Y]
        if along < 0.0 or last - first == 1:
            squared = dx * dx + dy * dy
            if squared < nearest:
                nearest, inside = squared, corners[side, CONVEX] == 0.0
            if meet and corners[side, CONVEX] == 1.0 and count[0] < limit:
                back_x, back_y = corners[before, CORNER_X], corners[before, CORNER_Y]
                past = (x - back_x) * corners[before, SIDE_X] + (y - back_y) * corners[
                    before, SIDE_Y
                ]
                if past >= corners[before, LENGTH] and squared < (near + rounding) ** 2:
                    if _is_nearest_corner(corners, work, point_body, point, dx, dy, cos, sin):
                        _note_corner(work, point_body, side_body, point, side, rounding)
        elif along <= corners[side, LENGTH]:
            off = dx * corners[side, SIDE_Y] - dy * corners[side, SIDE_X]
            if off * off < nearest:
                nearest, inside = off * off, off < 0.0
            if 0.0 <= off < near + rounding and count[0] < limit:
                _note_side(work, point_body, side_body, point, side, off, rounding)
        before = side
    if inside:
        count[0] = start  # what is in front of a point inside is no obstacle
        _leave(work, point_body, side_body, point, x, y, cos, sin, rounding)


@compiled
def _is_nearest_corner(corners, work, body, point, dx, dy, cos, sin):
    """Tell whether no side of a corner's own body is nearer to another corner than it is.

    `(dx, dy)` leads from the other corner to this one, in the frame of the other's body.
    """
    first, last = work.first_corner[body], work.first_corner[body + 1]
    if last - first == 1:
        return True
    here_x, here_y = -(cos * dx + sin * dy), -(cos * dy - sin * dx)
    before = point - 1 if point > first else last - 1
    after = here_x * corners[point, SIDE_X] + here_y * corners[point, SIDE_Y]
    past = here_x * corners[before, SIDE_X] + here_y * corners[before, SIDE_Y]
    return after <= 0.0 <= past


@compiled
def _leave(work, point_body, side_body, point, x, y, cos, sin, rounding):
    """List the side through which a point inside an outline leaves it soonest.

    A corner cannot have entered through a side that one of its own sides dips into.
    """
    corners = work.corners
    own = work.first_corner[point_body]
    single = work.first_corner[point_body + 1] - own == 1
    before = point - 1 if point > own else work.first_corner[point_body + 1] - 1
    best, highest, best_faces = -1, -np.inf, False
    for side in range(work.first_corner[side_body], work.first_corner[side_body + 1]):
        dx, dy = x - corners[side, CORNER_X], y - corners[side, CORNER_Y]
        along = dx * corners[side, SIDE_X] + dy * corners[side, SIDE_Y]
        off = dx * corners[side, SIDE_Y] - dy * corners[side, SIDE_X]
        if 0.0 <= along <= corners[side, LENGTH] and off <= 0.0:
            nx, ny = corners[side, SIDE_Y], -corners[side, SIDE_X]
            nx, ny = cos * nx + sin * ny, cos * ny - sin * nx  # in the frame of the point's body
            faces = single or (
                nx * corners[point, SIDE_X] + ny * corners[point, SIDE_Y] > -FACING
                and nx * corners[before, SIDE_X] + ny * corners[before, SIDE_Y] < FACING
            )
            if (faces and not best_faces) or (faces == best_faces and off > highest):
                best, highest, best_faces = side, off, faces
    if best >= 0:
        _note_side(work, point_body, side_body, point, best, highest, rounding)


@compiled
def _note_side(work, point_body, side_body, point, side, off, rounding):
    """List a corner in front of a side, at a distance from the side to the corner's middle [m]."""
    bodies, corners = work.bodies, work.corners
    contacts, number = work.contacts, work.count[0]
    cos, sin = bodies[side_body, COS], bodies[side_body, SIN]
    nx, ny = corners[side, SIDE_Y], -corners[side, SIDE_X]
    contacts[number, FACE_X], contacts[number, FACE_Y] = cos * nx - sin * ny, sin * nx + cos * ny
    contacts[number, GAP] = off - rounding
    _note(work, point_body, side_body, point, side, ON_SIDE)


@compiled
def _note_corner(work, point_body, side_body, point, corner, rounding):
    """List a corner near a corner."""
    bodies, corners = work.bodies, work.corners
    contacts, number = work.contacts, work.count[0]
    cos, sin = bodies[side_body, COS], bodies[side_body, SIN]
    x, y = corners[corner, CORNER_X], corners[corner, CORNER_Y]
    at_x, at_y = cos * x - sin * y, sin * x + cos * y
    contacts[number, CORNER_AT_X], contacts[number, CORNER_AT_Y] = at_x, at_y
    _note(work, point_body, side_body, point, corner, ON_CORNER)
    dx = bodies[point_body, X] + contacts[number, POINT_X] - bodies[side_body, X] - at_x
    dy = bodies[point_body, Y] + contacts[number, POINT_Y] - bodies[side_body, Y] - at_y
    distance = np.sqrt(dx * dx + dy * dy)
    contacts[number, GAP] = distance - rounding
    if distance > 0.0:
        contacts[number, FACE_X], contacts[number, FACE_Y] = dx / distance, dy / distance
    else:
        contacts[number, FACE_X], contacts[number, FACE_Y] = 1.0, 0.0


@compiled
def _note(work, point_body, side_body, point, feature, kind):
    bodies, corners, features = work.bodies, work.corners, work.features
    number = work.count[0]
    contacts = work.contacts
    cos, sin = bodies[point_body, COS], bodies[point_body, SIN]
    x, y = corners[point, CORNER_X], corners[point, CORNER_Y]
    contacts[number, POINT_X], contacts[number, POINT_Y] = cos * x - sin * y, sin * x + cos * y
    contacts[number, ALONG] = 0.0
    features[number, POINT_BODY], features[number, SIDE_BODY] = point_body, side_body
    features[number, FEATURE] = kind
    features[number, KEY] = (point * corners.shape[0] + feature) * 2 + kind
    work.count[0] = number + 1


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
