"""Where outlines overlap, compiled: corners that have crossed, and sides that corners went through.

The corners that are outside and near are those of `touching_kernels`.
"""

import numpy as np

from sain_model.compute.compiling import compiled
from sain_model.physics.body_kernels import (
    CORNER_X,
    CORNER_Y,
    GAP,
    KEY,
    KIND,
    LEFT,
    LENGTH,
    PAST,
    POINT_BODY,
    SIDE_BODY,
    SIDE_X,
    SIDE_Y,
)

FACING = 0.1  # sine of the angle by which a corner's sides may dip into a side that it entered
CROSSED = 0.005  # [m], corners as near as this may have crossed since they were looked at
ON_SIDE, ON_CORNER = 0, 1  # kinds of features


@compiled
def list_crossing(work, point_body, side_body, point, corner, x, y, cos, sin, limit):
    """List two corners that have crossed, so that neither is inside the other's outline.

    Separating axes of two wedges are the normals of their sides, but those into which the other
    wedge dips. When none of them parts the wedges, the one with the least overlap does.
    """
    corners, features, contacts, count = work.corners, work.features, work.contacts, work.counts
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
        count[0] = min(number + 1, limit)


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
        along, off = seen_from(corners, side, x, y)
        if 0.0 <= along <= corners[side, LENGTH] and off <= 0.0:
            nx, ny = corners[side, SIDE_Y], -corners[side, SIDE_X]
            nx, ny = cos * nx + sin * ny, cos * ny - sin * nx  # in the frame of the point's body
            dips = -(nx * corners[point, SIDE_X] + ny * corners[point, SIDE_Y])
            dips = max(dips, nx * corners[own_back, SIDE_X] + ny * corners[own_back, SIDE_Y])
            score = off if dips < FACING else off - CROSSED
            if score > highest:
                best, highest = side, score
    _list_inside(work, point_body, side_body, point, best, x, y, limit)
    _list_inside(work, point_body, side_body, point, second, x, y, limit)


@compiled
def _list_inside(work, point_body, side_body, point, side, x, y, limit):
    """List a side that a point is behind; none where its number is negative."""
    corners, contacts, features, count = work.corners, work.contacts, work.features, work.counts
    number = count[0]
    along, off = seen_from(corners, max(side, 0), x, y)
    contacts[number, GAP] = off
    contacts[number, PAST], contacts[number, LEFT] = along, corners[max(side, 0), LENGTH] - along
    features[number, POINT_BODY], features[number, SIDE_BODY] = point_body, side_body
    features[number, KIND] = ON_SIDE
    features[number, KEY] = (point * corners.shape[0] + side) * 2 + ON_SIDE
    count[0] = min(number + (1 if side >= 0 else 0), limit)


@compiled
def _side_before(work, body, corner):
    """Return the number of the side that ends at a corner."""
    first, last = work.first_corner[body], work.first_corner[body + 1]
    return corner - 1 if corner > first else last - 1


@compiled
def seen_from(corners, side, x, y):
    """Return how far along a side [m] a point lies, and how far in front of it."""
    dx, dy = x - corners[side, CORNER_X], y - corners[side, CORNER_Y]
    along = dx * corners[side, SIDE_X] + dy * corners[side, SIDE_Y]
    return along, dx * corners[side, SIDE_Y] - dy * corners[side, SIDE_X]
