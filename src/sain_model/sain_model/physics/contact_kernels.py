"""Where two outlines are near each other, compiled: corners against sides, corners against corners.

In the plane the closest features of two outlines are a corner of one and a side or a corner of
the other (Ericson, "Real-Time Collision Detection", chapter 5). Corners may be rounded: the tool
and a disk are one corner with a large radius. The outline of a whole body is looked at, not its
convex parts. So the seams between parts catch nothing, and how an outline is cut does not matter.
A body grown by the tool's radius is the union of its outline, of each side moved outward, and of a
circle about each corner. The axis of a tool's disk touches the first of these that its way meets;
the faces of a bar meet corners of the body likewise.
"""

import numpy as np

from sain_core.push import (
    ANGLE,
    BAR,
    BODY,
    LENGTH,
    LOCATION,
    SPAN_X,
    SPAN_Y,
    START_X,
    START_Y,
    TIP_RADIUS,
)
from sain_core.scene import RADIUS, THETA, X, Y
from sain_model.compute.compiling import callable_kernel, compiled, compiled_apart
from sain_model.physics.body_kernels import MOST_CONTACTS, TOOL

NEAR = 0.005  # [m], features further apart are looked at again in the next step
NOTHING = -1  # in place of a kind of feature
FACING = 0.1  # sine of the angle by which a corner's sides may dip into a side that it entered
CROSSED = 0.005  # [m], corners as near as this may have crossed since they were looked at
ON_SIDE, ON_CORNER = 0, 1  # kinds of features


@compiled
def find_touching(work, horizon):
    """List anew, without impulses, the features that are near each other, or will be soon.

    No longer step than the horizon [s] will follow.
    """
    count = work.counts
    count[0] = 0
    fingers = work.first_corner[TOOL + 1]
    for second in range(1, work.bodies.shape[0]):
        other = work.bodies[second]
        for first in range(second):
            body = work.bodies[first]
            dx, dy = other.x - body.x, other.y - body.y
            speed = abs(other.vx - body.vx) + abs(other.vy - body.vy)
            speed += abs(body.spin) * body.reach + abs(other.spin) * other.reach
            near = NEAR + horizon * speed
            reach = body.reach + other.reach + near
            moves = body.lightness + other.lightness > 0.0
            if moves and dx * dx + dy * dy < reach * reach:
                limit = count[0] + MOST_CONTACTS
                one = first != TOOL or fingers == 1
                if one and body.round > 0.0 and other.round > 0.0:  # the one corner of each
                    point, side = work.first_corner[first], work.first_corner[second]
                    px, py = _in_world(body, work.corners[point].x, work.corners[point].y)
                    sx, sy = _in_world(other, work.corners[side].x, work.corners[side].y)
                    x, y = dx + sx - px, dy + sy - py  # centres of mass may be off these
                    gap = np.sqrt(x * x + y * y)
                    _list(work, first, second, point, side, ON_CORNER, gap, 0.0, 0.0, limit)
                    continue
                _corners_against(work, first, second, near, True, limit)
                if first != TOOL or work.corners[TOOL].length > 0.0:
                    _corners_against(work, second, first, near, False, limit)
    _place_features(work)


@compiled
def _list(work, point_body, side_body, point, side, kind, gap, past, left, limit):
    """List a corner near a side or corner (`kind`), unless there are `limit` contacts already.

    The gap [m] is without rounding; the point is `past` [m] the beginning of the side, and has
    `left` [m] to its end.
    """
    number = work.counts[0]
    if number < limit:
        contact = work.contacts[number]
        contact.gap, contact.past, contact.left = gap, past, left
        contact.point_body, contact.side_body = point_body, side_body
        contact.point, contact.side, contact.kind = point, side, kind
        contact.key = (point * work.corners.shape[0] + side) * 2 + kind
        work.counts[0] = number + 1


@compiled
def _corners_against(work, point_body, side_body, near, meet, limit):
    """List where corners of one body are within `near` [m] of the outline of another.

    With `meet`, corners against corners as well; up to `limit` contacts.
    """
    body, other = work.bodies[point_body], work.bodies[side_body]
    cos_side, sin_side = other.cos, other.sin
    dx, dy = body.x - other.x, body.y - other.y
    away_x, away_y = cos_side * dx + sin_side * dy, cos_side * dy - sin_side * dx
    cos = body.cos * cos_side + body.sin * sin_side
    sin = body.sin * cos_side - body.cos * sin_side
    near += body.round + other.round  # of the points
    reach = other.reach - other.round + near
    for point in range(work.first_corner[point_body], work.first_corner[point_body + 1]):
        corner_of = work.corners[point]
        x = away_x + cos * corner_of.x - sin * corner_of.y
        y = away_y + sin * corner_of.x + cos * corner_of.y
        if x * x + y * y < reach * reach and corner_of.convex:
            nearest, inside, corner, hole = _nearest(work, side_body, x, y)
            if inside:
                list_way_out(work, point_body, side_body, point, x, y, cos, sin, hole, limit)
            elif nearest < near:
                _list_in_front(
                    work, point_body, side_body, point, x, y, cos, sin, near, meet, limit
                )
                if meet and corner >= 0 and body.round == 0.0:
                    list_crossing(work, point_body, side_body, point, corner, x, y, cos, sin, limit)


@compiled
def _nearest(work, side_body, x, y):
    """Look at an outline from a point (x, y), in that outline's frame.

    Returns the distance to the nearest feature [m]; whether the point is inside: behind a side that
    is that feature, or at a concave corner (nothing is inside a bar); a convex corner as near as
    `CROSSED`, and the concave corner if it is the nearest feature; -1 if there is none.
    """
    nearest, inside, corner, hole = np.inf, False, -1, -1
    for side in range(work.first_corner[side_body], work.first_corner[side_body + 1]):
        here = work.corners[side]
        along, off = seen_from(here, x, y)
        squared = along * along + off * off
        if squared < CROSSED * CROSSED and here.convex:
            corner = side
        if along < 0.0 or here.length == 0.0:
            if squared < nearest:
                nearest, inside = squared, not here.convex
                hole = side if inside else -1
        elif along <= here.length and off * off < nearest:
            nearest, inside, hole = off * off, off < 0.0, -1
    return np.sqrt(nearest), inside and side_body != TOOL, corner, hole


@compiled
def _list_in_front(work, point_body, side_body, point, x, y, cos, sin, near, meet, limit):
    """List the features of an outline that a point (x, y) outside of it is in front of."""
    corners = work.corners
    first, last = work.first_corner[side_body], work.first_corner[side_body + 1]
    own_first, own_last = work.first_corner[point_body], work.first_corner[point_body + 1]
    along, _ = seen_from(corners[last - 1], x, y)
    past = along >= corners[last - 1].length  # the end of the side before
    for side in range(first, last):
        here = corners[side]
        along, off = seen_from(here, x, y)
        length = here.length
        kind = ON_SIDE if 0.0 <= along <= length and off >= 0.0 and length > 0.0 else NOTHING
        ends = length == 0.0 or (past and along < 0.0)
        if meet and ends and here.convex:
            dx, dy = x - here.x, y - here.y
            here_x, here_y = -(cos * dx + sin * dy), sin * dx - cos * dy
            if _is_beyond(corners, point, own_first, own_last, here_x, here_y):
                kind, off = ON_CORNER, np.sqrt(dx * dx + dy * dy)
        if kind != NOTHING and off < near:
            rest = length - along
            _list(work, point_body, side_body, point, side, kind, off, along, rest, limit)
        past = along > length


@compiled
def _is_beyond(corners, point, first, last, x, y):
    """Tell whether (x, y), seen from a corner, is nearer to it than to either of its sides."""
    before = point - 1 if point > first else last - 1
    after = x * corners[point].side_x + y * corners[point].side_y
    ahead = x * corners[before].side_x + y * corners[before].side_y
    return corners[point].length == 0.0 or after <= 0.0 <= ahead


@compiled
def _place_features(work):
    """Place the listed features in the world: corner, what it is near, and the normal between."""
    bodies = work.bodies
    for index in range(work.counts[0]):
        contact = work.contacts[index]
        first = min(contact.point_body, contact.side_body)
        contact.pair = first * bodies.shape[0] + max(contact.point_body, contact.side_body)
        body, other = bodies[contact.point_body], bodies[contact.side_body]
        corner, side = work.corners[contact.point], work.corners[contact.side]
        contact.point_x, contact.point_y = _in_world(body, corner.x, corner.y)
        contact.corner_at_x, contact.corner_at_y = _in_world(other, side.x, side.y)
        nx, ny = _in_world(other, side.side_y, -side.side_x)
        if contact.kind == ON_CORNER and contact.gap > 0.0:
            nx = (body.x + contact.point_x - other.x - contact.corner_at_x) / contact.gap
            ny = (body.y + contact.point_y - other.y - contact.corner_at_y) / contact.gap
        contact.face_x, contact.face_y = nx, ny
        contact.gap -= body.round + other.round


@compiled
def _in_world(body, x, y):
    """Return a vector of a body's frame in the world's."""
    return body.cos * x - body.sin * y, body.sin * x + body.cos * y


# --- overlaps: corners that have crossed, and sides that corners went through -------------------


@compiled
def list_crossing(work, point_body, side_body, point, corner, x, y, cos, sin, limit):
    """List two corners that have crossed, so that neither is inside the other's outline.

    Separating axes of two wedges are the normals of their sides, but those into which the other
    wedge dips. When none of them parts the wedges, the one with the least overlap does.
    """
    corners = work.corners
    back = _side_before(work, side_body, corner)
    own_back = _side_before(work, point_body, point)
    dx, dy = x - corners[corner].x, y - corners[corner].y
    widest, best, swapped = -np.inf, -1, False
    for axis in range(4):
        own = axis > 1
        first, second = (own_back, point) if own else (back, corner)
        side = first if axis % 2 == 0 else second
        nx, ny = corners[side].side_y, -corners[side].side_x
        if own:  # into the frame of the other outline
            nx, ny = cos * nx - sin * ny, sin * nx + cos * ny
            apart = -(nx * dx + ny * dy)
            ax, ay = corners[corner].side_x, corners[corner].side_y
            bx, by = -corners[back].side_x, -corners[back].side_y
        else:
            apart = nx * dx + ny * dy
            ax = cos * corners[point].side_x - sin * corners[point].side_y
            ay = sin * corners[point].side_x + cos * corners[point].side_y
            bx = -(cos * corners[own_back].side_x - sin * corners[own_back].side_y)
            by = -(sin * corners[own_back].side_x + cos * corners[own_back].side_y)
        if min(nx * ax + ny * ay, nx * bx + ny * by) >= 0.0 and apart > widest:
            widest, best, swapped = apart, side, own
    if best >= 0 and widest < 0.0:
        if swapped:
            point_body, side_body, point = side_body, point_body, corner
        _list(work, point_body, side_body, point, best, ON_SIDE, widest, 0.0, np.inf, limit)


@compiled
def list_way_out(work, point_body, side_body, point, x, y, cos, sin, hole, limit):
    """List the side through which a point inside an outline leaves it soonest.

    A corner will not have entered through a side that one of its own sides dips into. A point
    behind a concave corner (`hole`) is behind both sides that meet there, and has to leave both.
    """
    corners = work.corners
    own_back = _side_before(work, point_body, point)
    first, last = work.first_corner[side_body], work.first_corner[side_body + 1]
    best, second, highest = hole, -1, -np.inf
    if hole >= 0:
        second = _side_before(work, side_body, hole)
        first = last
    for side in range(first, last):
        here = corners[side]
        along, off = seen_from(here, x, y)
        if 0.0 <= along <= here.length and off <= 0.0:
            nx, ny = here.side_y, -here.side_x
            nx, ny = cos * nx + sin * ny, cos * ny - sin * nx  # in the frame of the point's body
            dips = -(nx * corners[point].side_x + ny * corners[point].side_y)
            dips = max(dips, nx * corners[own_back].side_x + ny * corners[own_back].side_y)
            score = off if dips < FACING else off - CROSSED
            if score > highest:
                best, highest = side, score
    _list_inside(work, point_body, side_body, point, best, x, y, limit)
    _list_inside(work, point_body, side_body, point, second, x, y, limit)


@compiled
def _list_inside(work, point_body, side_body, point, side, x, y, limit):
    """List a side that a point is behind; none where its number is negative."""
    if side >= 0:
        along, off = seen_from(work.corners[side], x, y)
        rest = work.corners[side].length - along
        _list(work, point_body, side_body, point, side, ON_SIDE, off, along, rest, limit)


@compiled
def _side_before(work, body, corner):
    """Return the number of the side that ends at a corner."""
    first, last = work.first_corner[body], work.first_corner[body + 1]
    return corner - 1 if corner > first else last - 1


@compiled
def seen_from(corner, x, y):
    """Return how far along the side from a corner [m] a point lies, and how far in front of it."""
    dx, dy = x - corner.x, y - corner.y
    return dx * corner.side_x + dy * corner.side_y, dx * corner.side_y - dy * corner.side_x


# --- where the tool first touches a body ----------------------------------------------------------


@compiled
def first_touch_of(work, way_x, way_y):
    """Return how far [m] the tool travels until it touches any body; infinite if never."""
    bodies = work.bodies
    nearest = np.inf
    for row in range(1, bodies.shape[0]):
        dx, dy = bodies[TOOL].x - bodies[row].x, bodies[TOOL].y - bodies[row].y
        reach = bodies[row].reach + bodies[TOOL].round
        across = dx * way_y - dy * way_x
        if abs(across) < reach and dx * way_x + dy * way_y < reach:
            nearest = min(nearest, _distance_to(work, row, dx, dy, way_x, way_y))
    if work.first_corner[TOOL + 1] > 1:
        nearest = min(nearest, _further_touch(work, way_x, way_y))
    return nearest


@compiled
def _distance_to(work, row, dx, dy, way_x, way_y):
    """Return how far [m] a disk of the tool travels until it touches a body.

    Its axis, at (dx, dy) from the body's centre, meets the outline grown by both radii: sides moved
    outward, and circles about convex corners.
    """
    bodies, corners = work.bodies, work.corners
    cos, sin = bodies[row].cos, bodies[row].sin
    x, y = cos * dx + sin * dy, cos * dy - sin * dx
    ux, uy = cos * way_x + sin * way_y, cos * way_y - sin * way_x
    rounding = bodies[row].round + bodies[TOOL].round
    nearest = np.inf
    for side in range(work.first_corner[row], work.first_corner[row + 1]):
        from_x, from_y = x - corners[side].x, y - corners[side].y
        closing = uy * corners[side].side_x - ux * corners[side].side_y
        off = from_x * corners[side].side_y - from_y * corners[side].side_x
        if closing > 0.0 and off >= 0.0:
            distance = max((off - rounding) / closing, 0.0)
            along = (from_x + distance * ux) * corners[side].side_x
            along += (from_y + distance * uy) * corners[side].side_y
            if 0.0 <= along <= corners[side].length:
                nearest = min(nearest, distance)
        if corners[side].convex:
            ahead = -(from_x * ux + from_y * uy)
            squared = rounding * rounding - (from_x * from_x + from_y * from_y - ahead * ahead)
            if squared > 0.0 and ahead > 0.0:
                nearest = min(nearest, max(ahead - np.sqrt(squared), 0.0))
    return nearest


@compiled
def _until_side(from_x, from_y, ux, uy, side_x, side_y, length, rounding):
    """Return how far [m] a round point travels along (ux, uy) until it touches a side.

    The point is at (from_x, from_y) from where the side begins [m], in front of it. Negative: they
    overlap; infinite: it never does.
    """
    closing = uy * side_x - ux * side_y
    off = from_x * side_y - from_y * side_x
    if closing > 0.0 and off >= 0.0:
        met = (off - rounding) / closing
        ahead = max(met, 0.0)
        along = (from_x + ahead * ux) * side_x
        along += (from_y + ahead * uy) * side_y
        if 0.0 <= along <= length:
            return met
    return np.inf


@compiled_apart
def _further_touch(work, way_x, way_y):
    """Return how far [m] its second disk or the faces of a bar travel until they touch any body.

    A face meets corners of bodies, grown by both radii.
    """
    bodies, corners = work.bodies, work.corners
    tool, nearest = bodies[TOOL], np.inf
    for row in range(1, bodies.shape[0]):
        body = bodies[row]
        dx, dy = tool.x + corners[1].x - body.x, tool.y + corners[1].y - body.y
        nearest = min(nearest, _distance_to(work, row, dx, dy, way_x, way_y))
        for face in range(2):
            here = corners[face]
            dx, dy = tool.x + here.x - body.x, tool.y + here.y - body.y
            for corner in range(work.first_corner[row], work.first_corner[row + 1]):
                x, y = _in_world(body, corners[corner].x, corners[corner].y)
                met = _until_side(
                    x - dx, y - dy, -way_x, -way_y,
                    here.side_x, here.side_y, here.length, body.round + tool.round,
                )  # fmt: skip
                nearest = min(nearest, max(met, 0.0))
    return nearest


# --- strokes, before any body moves ---------------------------------------------------------------

# Columns of what is found: the smallest gap between tool and a body at the start [m], which body
# that is, how far the tool travels until it touches the pushed body [m] (infinite: never), and the
# heading of that body's inward normal there [rad].
GAP, GAP_BODY, DISTANCE, NORMAL = range(4)
TOUCH_SIZE = 4


@callable_kernel
def find_touches(scenes, strokes, table, touches):
    """Write into (B, 4) where the tools of strokes (B, 11) begin and first touch."""
    for index in range(scenes.shape[0]):
        stroke, touch = strokes[index], touches[index]
        touch[GAP] = np.inf
        for body in range(scenes.shape[1]):
            gap = _gap_to(scenes[index, body], table, body, stroke)
            if gap < touch[GAP]:
                touch[GAP], touch[GAP_BODY] = gap, body
        pushed = int(stroke[BODY])
        _touch_first(scenes[index, pushed], table, pushed, stroke, touch)


@compiled
def _tool_seen(state, stroke):
    """Return a tool in the frame of a body: a disk, the way to the other [m], how many it has."""
    cos, sin = np.cos(state[THETA]), np.sin(state[THETA])
    dx, dy = stroke[START_X] - state[X], stroke[START_Y] - state[Y]
    x, y = cos * dx + sin * dy, cos * dy - sin * dx
    span_x, span_y = stroke[SPAN_X], stroke[SPAN_Y]
    disks = 2 if span_x != 0.0 or span_y != 0.0 else 1
    return x, y, cos * span_x + sin * span_y, cos * span_y - sin * span_x, disks


@compiled
def _squared_from(off_x, off_y, way_x, way_y):
    """Return the squared distance [m^2] of a point from a side (way_x, way_y) that begins at 0."""
    squared = way_x * way_x + way_y * way_y
    share = 0.0
    if squared > 0.0:
        share = min(max((off_x * way_x + off_y * way_y) / squared, 0.0), 1.0)
    apart_x, apart_y = off_x - share * way_x, off_y - share * way_y
    return apart_x * apart_x + apart_y * apart_y


@compiled
def _gap_to(state, table, body, stroke):
    """Return the gap [m] between the tool at its start and a body; negative where they overlap.

    Of a bar of which only the middle crosses the outline, it is what its rounding overlaps.
    """
    start_x, start_y, span_x, span_y, disks = _tool_seen(state, stroke)
    radius, bar = state[RADIUS], stroke[BAR] > 0.0
    first, last = table.first_corner[body], table.first_corner[body + 1]
    gap, squared = np.inf, np.inf
    for disk in range(disks):
        x, y = start_x + disk * span_x, start_y + disk * span_y
        nearest, inside = np.inf, False
        here_x, here_y = radius * table.corners[last - 1, 0], radius * table.corners[last - 1, 1]
        for corner in range(first, last):
            after_x, after_y = radius * table.corners[corner, 0], radius * table.corners[corner, 1]
            way_x, way_y, off_x, off_y = after_x - here_x, after_y - here_y, x - here_x, y - here_y
            nearest = min(nearest, _squared_from(off_x, off_y, way_x, way_y))
            if (here_y > y) != (after_y > y) and off_x < off_y / way_y * way_x:
                inside = not inside
            if bar:
                off_x, off_y = start_x - after_x, start_y - after_y
                squared = min(squared, _squared_from(-off_x, -off_y, span_x, span_y))
                if _cross(off_x, off_y, span_x, span_y, -way_x, -way_y):
                    squared = 0.0
            here_x, here_y = after_x, after_y
        gap = min(gap, -np.sqrt(nearest) if inside else np.sqrt(nearest))
    return min(gap, np.sqrt(squared)) - table.rounding[body] * radius - stroke[TIP_RADIUS]


@compiled
def _cross(x, y, ux, uy, vx, vy):
    """Tell whether the side u that begins at (x, y) crosses the side v that begins at 0."""
    start, end = vx * y - vy * x, vx * (y + uy) - vy * (x + ux)
    here, there = uy * x - ux * y, uy * (x - vx) - ux * (y - vy)
    return start * end < 0.0 and here * there < 0.0


@compiled
def _touch_first(state, table, body, stroke, touch):
    """Write how far the tool travels until it touches a body, and the normal there.

    Of parts that the tool overlaps already, the one that it will have met first on its way counts.
    """
    start_x, start_y, span_x, span_y, disks = _tool_seen(state, stroke)
    cos, sin, radius = np.cos(state[THETA]), np.sin(state[THETA]), state[RADIUS]
    heading = stroke[LOCATION] + stroke[ANGLE]
    ux, uy = np.cos(heading - state[THETA]), np.sin(heading - state[THETA])
    rounding = table.rounding[body] * radius + stroke[TIP_RADIUS]
    first, last = table.first_corner[body], table.first_corner[body + 1]
    span = np.sqrt(span_x * span_x + span_y * span_y)
    nearest, nx, ny = np.inf, ux, uy
    for disk in range(disks):
        x, y = start_x + disk * span_x, start_y + disk * span_y
        for corner in range(first, last):
            after = corner + 1 if corner + 1 < last else first
            from_x, from_y = (
                x - radius * table.corners[corner, 0],
                y - radius * table.corners[corner, 1],
            )
            way_x = radius * (table.corners[after, 0] - table.corners[corner, 0])
            way_y = radius * (table.corners[after, 1] - table.corners[corner, 1])
            length = np.sqrt(way_x * way_x + way_y * way_y)
            if length > 0.0:
                side_x, side_y = way_x / length, way_y / length
                met = _until_side(from_x, from_y, ux, uy, side_x, side_y, length, rounding)
                if met < nearest:
                    nearest, nx, ny = met, -side_y, side_x
            ahead = -(from_x * ux + from_y * uy)
            squared = rounding * rounding - (from_x * from_x + from_y * from_y - ahead * ahead)
            if squared > 0.0 and ahead > 0.0:
                met = ahead - np.sqrt(squared)
                if met < nearest:
                    way = max(met, 0.0)
                    nearest, nx, ny = met, -(from_x + way * ux), -(from_y + way * uy)
            if disks > 1 and stroke[BAR] > 0.0:  # one of its faces, from this disk to the other
                turn = (1.0 - 2.0 * disk) / span
                side_x, side_y = turn * span_x, turn * span_y
                met = _until_side(-from_x, -from_y, -ux, -uy, side_x, side_y, span, rounding)
                if met < nearest:
                    nearest, nx, ny = met, side_y, -side_x
    touch[DISTANCE] = max(nearest, 0.0)
    if touch[DISTANCE] >= stroke[LENGTH]:
        touch[DISTANCE], nx, ny = np.inf, ux, uy
    touch[NORMAL] = np.arctan2(sin * nx + cos * ny, cos * nx - sin * ny)
