"""Where two outlines are near each other, compiled: corners against sides, corners against corners.

In the plane the closest features of two outlines are a corner of one and a side or a corner of
the other (Ericson, "Real-Time Collision Detection", chapter 5). Corners may be rounded: the tool
and a disk are one corner with a large radius. The outline of a whole body is looked at, not its
convex parts. So the seams between parts catch nothing, and how an outline is cut does not matter.
"""

import numpy as np

from sain_model.compute.compiling import compiled, compiled_apart
from sain_model.physics.body_kernels import (
    CONVEX,
    CORNER_AT_X,
    CORNER_AT_Y,
    CORNER_X,
    CORNER_Y,
    COS,
    FACE_X,
    FACE_Y,
    GAP,
    KEY,
    KIND,
    LEFT,
    LENGTH,
    LIGHTNESS,
    MOST_CONTACTS,
    PAST,
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
from sain_model.physics.overlap_kernels import (
    CROSSED,
    ON_CORNER,
    ON_SIDE,
    list_crossing,
    list_way_out,
    seen_from,
)

NEAR = 0.005  # [m], features further apart are looked at again in the next step
NOTHING = -1  # in place of a kind of feature


@compiled_apart
def find_touching(work, horizon):
    """List the features of all bodies that are near each other, or will be soon.

    Args:
        work: scratch memory; its list of contacts is made anew, without impulses.
        horizon: no longer step than this will follow [s].
    """
    bodies, count = work.bodies, work.counts
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
            moves = bodies[first, LIGHTNESS] + bodies[second, LIGHTNESS] > 0.0
            if moves and dx * dx + dy * dy < reach * reach:
                if bodies[first, ROUND] > 0.0 and bodies[second, ROUND] > 0.0:
                    _list_circles(work, first, second, dx, dy)
                    continue
                limit = count[0] + MOST_CONTACTS
                _corners_against(work, first, second, near, True, limit)
                if first != TOOL:
                    _corners_against(work, second, first, near, False, limit)
    _place_features(work)


@compiled
def _list_circles(work, first, second, dx, dy):
    """List the contact of two round bodies, (dx, dy) apart: the one corner of each."""
    contacts, features, number = work.contacts, work.features, work.counts[0]
    point, side = work.first_corner[first], work.first_corner[second]
    contacts[number, GAP] = np.sqrt(dx * dx + dy * dy)
    contacts[number, PAST], contacts[number, LEFT] = 0.0, 0.0
    features[number, POINT_BODY], features[number, SIDE_BODY] = first, second
    features[number, KIND] = ON_CORNER
    features[number, KEY] = (point * work.corners.shape[0] + side) * 2 + ON_CORNER
    work.counts[0] = number + 1


@compiled
def _corners_against(work, point_body, side_body, near, meet, limit):
    """List where corners of one body are near the outline of another.

    Args:
        work: scratch memory.
        point_body: row of the one.
        side_body: row of the other.
        near: largest gap to list [m].
        meet: whether to look at corners against corners as well.
        limit: how many contacts there may be after it.
    """
    bodies, corners, _count = work.bodies, work.corners, work.counts
    cos_side, sin_side = bodies[side_body, COS], bodies[side_body, SIN]
    dx = bodies[point_body, X] - bodies[side_body, X]
    dy = bodies[point_body, Y] - bodies[side_body, Y]
    away_x, away_y = cos_side * dx + sin_side * dy, cos_side * dy - sin_side * dx
    cos = bodies[point_body, COS] * cos_side + bodies[point_body, SIN] * sin_side
    sin = bodies[point_body, SIN] * cos_side - bodies[point_body, COS] * sin_side
    near += bodies[point_body, ROUND] + bodies[side_body, ROUND]  # of the points
    reach = bodies[side_body, REACH] - bodies[side_body, ROUND] + near
    for point in range(work.first_corner[point_body], work.first_corner[point_body + 1]):
        x = away_x + cos * corners[point, CORNER_X] - sin * corners[point, CORNER_Y]
        y = away_y + sin * corners[point, CORNER_X] + cos * corners[point, CORNER_Y]
        if x * x + y * y < reach * reach and corners[point, CONVEX] > 0.0:
            nearest, inside, corner, hole = _nearest(work, side_body, x, y)
            if inside:
                list_way_out(work, point_body, side_body, point, x, y, cos, sin, hole, limit)
            elif nearest < near:
                _list_in_front(
                    work, point_body, side_body, point, x, y, cos, sin, near, meet, limit
                )
                if meet and corner >= 0:
                    list_crossing(work, point_body, side_body, point, corner, x, y, cos, sin, limit)


@compiled
def _nearest(work, side_body, x, y):
    """Look at an outline from a point (x, y), in that outline's frame.

    Returns:
        The distance to the nearest feature [m]. Whether the point is inside: that feature is a
        side that the point is behind, or a concave corner. A convex corner as near as `CROSSED`,
        and the concave corner if it is the nearest feature; -1 if there is none.
    """
    corners = work.corners
    nearest, inside, corner, hole = np.inf, False, -1, -1
    for side in range(work.first_corner[side_body], work.first_corner[side_body + 1]):
        along, off = seen_from(corners, side, x, y)
        squared = along * along + off * off
        if squared < CROSSED * CROSSED and corners[side, CONVEX] > 0.0:
            corner = side
        if along < 0.0 or corners[side, LENGTH] == 0.0:
            if squared < nearest:
                nearest, inside = squared, corners[side, CONVEX] == 0.0
                hole = side if inside else -1
        elif along <= corners[side, LENGTH] and off * off < nearest:
            nearest, inside, hole = off * off, off < 0.0, -1
    return np.sqrt(nearest), inside, corner, hole


@compiled
def _list_in_front(work, point_body, side_body, point, x, y, cos, sin, near, meet, limit):
    """List the features of an outline that a point (x, y) outside of it is in front of."""
    corners, contacts, features, count = work.corners, work.contacts, work.features, work.counts
    first, last = work.first_corner[side_body], work.first_corner[side_body + 1]
    own_first, own_last = work.first_corner[point_body], work.first_corner[point_body + 1]
    along, _ = seen_from(corners, last - 1, x, y)
    past = along >= corners[last - 1, LENGTH]  # the end of the side before
    for side in range(first, last):
        along, off = seen_from(corners, side, x, y)
        length = corners[side, LENGTH]
        kind = ON_SIDE if 0.0 <= along <= length and off >= 0.0 and length > 0.0 else NOTHING
        ends = length == 0.0 or (past and along < 0.0)
        if meet and ends and corners[side, CONVEX] > 0.0:
            dx, dy = x - corners[side, CORNER_X], y - corners[side, CORNER_Y]
            here_x, here_y = -(cos * dx + sin * dy), sin * dx - cos * dy
            if _is_beyond(corners, point, own_first, own_last, here_x, here_y):
                kind, off = ON_CORNER, np.sqrt(dx * dx + dy * dy)
        if kind != NOTHING and off < near and count[0] < limit:
            number = count[0]
            contacts[number, GAP] = off
            contacts[number, PAST], contacts[number, LEFT] = along, length - along
            features[number, POINT_BODY], features[number, SIDE_BODY] = point_body, side_body
            features[number, KIND] = kind
            features[number, KEY] = (point * corners.shape[0] + side) * 2 + kind
            count[0] = number + 1
        past = along > length


@compiled
def _is_beyond(corners, point, first, last, x, y):
    """Tell whether (x, y), seen from a corner, is nearer to it than to either of its sides."""
    before = point - 1 if point > first else last - 1
    after = x * corners[point, SIDE_X] + y * corners[point, SIDE_Y]
    ahead = x * corners[before, SIDE_X] + y * corners[before, SIDE_Y]
    return corners[point, LENGTH] == 0.0 or after <= 0.0 <= ahead


@compiled
def _place_features(work):
    """Place the listed features in the world: corner, what it is near, and the normal between."""
    bodies, corners, contacts, features = work.bodies, work.corners, work.contacts, work.features
    total = corners.shape[0]
    for index in range(work.counts[0]):
        point_body, side_body = features[index, POINT_BODY], features[index, SIDE_BODY]
        pair = features[index, KEY] // 2
        point, side = pair // total, pair % total
        x, y = corners[point, CORNER_X], corners[point, CORNER_Y]
        cos, sin = bodies[point_body, COS], bodies[point_body, SIN]
        point_x, point_y = cos * x - sin * y, sin * x + cos * y
        contacts[index, POINT_X], contacts[index, POINT_Y] = point_x, point_y
        x, y = corners[side, CORNER_X], corners[side, CORNER_Y]
        cos, sin = bodies[side_body, COS], bodies[side_body, SIN]
        corner_x, corner_y = cos * x - sin * y, sin * x + cos * y
        contacts[index, CORNER_AT_X], contacts[index, CORNER_AT_Y] = corner_x, corner_y
        x, y = corners[side, SIDE_Y], -corners[side, SIDE_X]
        nx, ny = cos * x - sin * y, sin * x + cos * y
        distance = contacts[index, GAP]
        if features[index, KIND] == ON_CORNER and distance > 0.0:
            nx = (bodies[point_body, X] + point_x - bodies[side_body, X] - corner_x) / distance
            ny = (bodies[point_body, Y] + point_y - bodies[side_body, Y] - corner_y) / distance
        contacts[index, FACE_X], contacts[index, FACE_Y] = nx, ny
        contacts[index, GAP] = distance - bodies[point_body, ROUND] - bodies[side_body, ROUND]
