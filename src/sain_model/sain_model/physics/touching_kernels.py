"""Where two outlines are near each other, compiled: corners against sides, corners against corners.

In the plane the closest features of two outlines are a corner of one and a side or a corner of
the other (Ericson, "Real-Time Collision Detection", chapter 5). Corners may be rounded: the tool
and a disk are one corner with a large radius. The outline of a whole body is looked at, not its
convex parts. So the seams between parts catch nothing, and how an outline is cut does not matter.
"""

import numpy as np

from sain_model.compute.compiling import compiled, compiled_apart
from sain_model.physics.outline_kernels import (
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

NEAR = 0.005  # [m], features further apart are looked at again in the next step
FACING = 0.1  # sine of the angle by which a corner's sides may dip into a side that it entered
CROSSED = 0.005  # [m], corners as near as this may have crossed since they were looked at
ON_SIDE, ON_CORNER, NOTHING = 0, 1, 2


@compiled_apart
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
            moves = bodies[first, LIGHTNESS] + bodies[second, LIGHTNESS] > 0.0
            if moves and dx * dx + dy * dy < reach * reach:
                limit = count[0] + MOST_CONTACTS
                _corners_against(work, first, second, near, True, limit)
                if first != TOOL:
                    _corners_against(work, second, first, near, False, limit)
    _place_features(work)


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
    bodies, corners, count = work.bodies, work.corners, work.count
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
            start = count[0]
            inside, corner = _list_in_front(
                work, point_body, side_body, point, x, y, cos, sin, near, meet, limit
            )
            if meet and corner >= 0 and not inside:
                _list_crossing(work, point_body, side_body, point, corner, x, y, cos, sin)
            if inside:
                count[0] = start  # what is in front of a point inside is no obstacle
                _list_way_out(work, point_body, side_body, point, x, y, cos, sin)


@compiled
def _list_in_front(work, point_body, side_body, point, x, y, cos, sin, near, meet, limit):
    """List the features of an outline near a point (x, y).

    Returns:
        Whether the point is inside: the nearest feature is a side that it is behind, or a concave
        corner. And a convex corner as near as `CROSSED`, -1 if there is none.
    """
    corners, contacts, features, count = work.corners, work.contacts, work.features, work.count
    first, last = work.first_corner[side_body], work.first_corner[side_body + 1]
    own_first, own_last = work.first_corner[point_body], work.first_corner[point_body + 1]
    total = corners.shape[0]
    nearest, inside, past, close = np.inf, False, True, -1
    if last - first > 1:
        past = _along(corners, last - 1, x, y) >= corners[last - 1, LENGTH]
    for side in range(first, last):
        dx, dy = x - corners[side, CORNER_X], y - corners[side, CORNER_Y]
        along = dx * corners[side, SIDE_X] + dy * corners[side, SIDE_Y]
        off = dx * corners[side, SIDE_Y] - dy * corners[side, SIDE_X]
        kind = NOTHING
        if dx * dx + dy * dy < CROSSED * CROSSED and corners[side, CONVEX] > 0.0:
            close = side
        if along < 0.0 or last - first == 1:
            off = np.sqrt(dx * dx + dy * dy)
            if off < nearest:
                nearest, inside = off, corners[side, CONVEX] == 0.0
            if meet and past and corners[side, CONVEX] > 0.0:
                here_x, here_y = -(cos * dx + sin * dy), sin * dx - cos * dy
                if _is_beyond(corners, point, own_first, own_last, here_x, here_y):
                    kind = ON_CORNER
        elif along <= corners[side, LENGTH]:
            if abs(off) < nearest:
                nearest, inside = abs(off), off < 0.0
            if off >= 0.0:
                kind = ON_SIDE
        if kind != NOTHING and off < near and count[0] < limit:
            number = count[0]
            contacts[number, GAP] = off
            contacts[number, PAST], contacts[number, LEFT] = along, corners[side, LENGTH] - along
            features[number, POINT_BODY], features[number, SIDE_BODY] = point_body, side_body
            features[number, KIND] = kind
            features[number, KEY] = (point * total + side) * 2 + kind
            count[0] = number + 1
        past = along > corners[side, LENGTH]
    return inside, close


@compiled
def _along(corners, side, x, y):
    """Return how far along a side [m] a point lies."""
    dx, dy = x - corners[side, CORNER_X], y - corners[side, CORNER_Y]
    return dx * corners[side, SIDE_X] + dy * corners[side, SIDE_Y]


@compiled
def _is_beyond(corners, point, first, last, x, y):
    """Tell whether (x, y), seen from a corner, is nearer to it than to either of its sides."""
    before = point - 1 if point > first else last - 1
    after = x * corners[point, SIDE_X] + y * corners[point, SIDE_Y]
    ahead = x * corners[before, SIDE_X] + y * corners[before, SIDE_Y]
    return after <= 0.0 <= ahead


@compiled
def _list_crossing(work, point_body, side_body, point, corner, x, y, cos, sin):
    """List two corners that have crossed, so that neither is inside the other's outline.

    Separating axes of two wedges are the normals of their sides, but those into which the other
    wedge dips. When none of them parts the wedges, the one with the least overlap does.
    """
    corners, features, contacts, count = work.corners, work.features, work.contacts, work.count
    back = _side_before(work, side_body, corner)
    own_back = _side_before(work, point_body, point)
    dx, dy = x - corners[corner, CORNER_X], y - corners[corner, CORNER_Y]
    widest, best, swapped = -np.inf, -1, False
    for axis in range(4):
        own = axis > 1
        first, second = (own_back, point) if own else (back, corner)
        side = first if axis % 2 == 0 else second
        nx, ny = corners[side, SIDE_Y], -corners[side, SIDE_X]
        if own:  # into the frame of the other outline
            nx, ny = cos * nx - sin * ny, sin * nx + cos * ny
            apart = -(nx * dx + ny * dy)
            ax, ay = corners[corner, SIDE_X], corners[corner, SIDE_Y]
            bx, by = -corners[back, SIDE_X], -corners[back, SIDE_Y]
        else:
            apart = nx * dx + ny * dy
            ax = cos * corners[point, SIDE_X] - sin * corners[point, SIDE_Y]
            ay = sin * corners[point, SIDE_X] + cos * corners[point, SIDE_Y]
            bx = -(cos * corners[own_back, SIDE_X] - sin * corners[own_back, SIDE_Y])
            by = -(sin * corners[own_back, SIDE_X] + cos * corners[own_back, SIDE_Y])
        if min(nx * ax + ny * ay, nx * bx + ny * by) >= 0.0 and apart > widest:
            widest, best, swapped = apart, side, own
    number = count[0]
    if best >= 0 and widest < 0.0:
        contacts[number, GAP] = widest
        contacts[number, PAST], contacts[number, LEFT] = 0.0, np.inf
        features[number, POINT_BODY] = side_body if swapped else point_body
        features[number, SIDE_BODY] = point_body if swapped else side_body
        features[number, KIND] = ON_SIDE
        which = corner if swapped else point
        features[number, KEY] = (which * corners.shape[0] + best) * 2 + ON_SIDE
        count[0] = number + 1


@compiled
def _side_before(work, body, corner):
    """Return the number of the side that ends at a corner."""
    first, last = work.first_corner[body], work.first_corner[body + 1]
    return corner - 1 if corner > first else last - 1


@compiled
def _list_way_out(work, point_body, side_body, point, x, y, cos, sin):
    """List the side through which a point inside an outline leaves it soonest.

    A corner will not have entered through a side that one of its own sides dips into.
    """
    corners, contacts, features, count = work.corners, work.contacts, work.features, work.count
    own_first, own_last = work.first_corner[point_body], work.first_corner[point_body + 1]
    before = point - 1 if point > own_first else own_last - 1
    best, highest, deepest, past = -1, -np.inf, 0.0, 0.0
    first, last = work.first_corner[side_body], work.first_corner[side_body + 1]
    for side in range(first, last):
        after = side + 1 if side + 1 < last else first
        dx, dy = x - corners[side, CORNER_X], y - corners[side, CORNER_Y]
        along = dx * corners[side, SIDE_X] + dy * corners[side, SIDE_Y]
        off = dx * corners[side, SIDE_Y] - dy * corners[side, SIDE_X]
        # Behind a concave corner no side is; there, those that meet in it reach a little further.
        back = -CROSSED if corners[side, CONVEX] == 0.0 else 0.0
        ahead = CROSSED if corners[after, CONVEX] == 0.0 else 0.0
        if back <= along <= corners[side, LENGTH] + ahead and off <= 0.0:
            nx, ny = corners[side, SIDE_Y], -corners[side, SIDE_X]
            nx, ny = cos * nx + sin * ny, cos * ny - sin * nx  # in the frame of the point's body
            dips = -(nx * corners[point, SIDE_X] + ny * corners[point, SIDE_Y])
            dips = max(dips, nx * corners[before, SIDE_X] + ny * corners[before, SIDE_Y])
            score = off if dips < FACING else off - CROSSED
            if score > highest:
                best, highest, deepest, past = side, score, off, along
    number = count[0]
    contacts[number, GAP] = deepest
    contacts[number, PAST], contacts[number, LEFT] = past, corners[best, LENGTH] - past
    features[number, POINT_BODY], features[number, SIDE_BODY] = point_body, side_body
    features[number, KIND] = ON_SIDE
    features[number, KEY] = (point * corners.shape[0] + best) * 2 + ON_SIDE
    count[0] = number + (1 if best >= 0 else 0)


@compiled
def _place_features(work):
    """Place the listed features in the world: corner, what it is near, and the normal between."""
    bodies, corners, contacts, features = work.bodies, work.corners, work.contacts, work.features
    total = corners.shape[0]
    for index in range(work.count[0]):
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
