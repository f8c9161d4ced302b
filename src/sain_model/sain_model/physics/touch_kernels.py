"""Where strokes begin, and where their tool first touches the body that it pushes, compiled.

A body grown by the tool's radius is the union of its outline, of each side moved outward, and of a
circle about each corner. The tool's axis touches the first of these that its way meets.
"""

import numpy as np

from sain_core.push import ANGLE, BODY, LENGTH, LOCATION, START_X, START_Y, TIP_RADIUS
from sain_core.scene import RADIUS, THETA, X, Y
from sain_model.compute.compiling import callable_kernel, compiled

# Columns of what is found: the smallest gap between tool and a body at the start [m], which body
# that is, how far the tool travels until it touches the pushed body [m] (infinite: never), and the
# heading of that body's inward normal there [rad].
GAP, GAP_BODY, DISTANCE, NORMAL = range(4)
TOUCH_SIZE = 4


@callable_kernel
def find_touches(scenes, strokes, table, touches):
    """Write into (B, 4) where the tools of strokes (B, 8) begin and first touch."""
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
def _gap_to(state, table, body, stroke):
    """Return the gap [m] between the tool at its start and a body; negative where they overlap."""
    cos, sin = np.cos(state[THETA]), np.sin(state[THETA])
    dx, dy = stroke[START_X] - state[X], stroke[START_Y] - state[Y]
    x, y, radius = cos * dx + sin * dy, cos * dy - sin * dx, state[RADIUS]
    first, last = table.first_corner[body], table.first_corner[body + 1]
    nearest, inside = np.inf, False
    here_x, here_y = radius * table.corners[last - 1, 0], radius * table.corners[last - 1, 1]
    for corner in range(first, last):
        after_x, after_y = radius * table.corners[corner, 0], radius * table.corners[corner, 1]
        way_x, way_y, off_x, off_y = after_x - here_x, after_y - here_y, x - here_x, y - here_y
        squared = way_x * way_x + way_y * way_y
        share = 0.0
        if squared > 0.0:
            share = min(max((off_x * way_x + off_y * way_y) / squared, 0.0), 1.0)
        apart_x, apart_y = off_x - share * way_x, off_y - share * way_y
        nearest = min(nearest, apart_x * apart_x + apart_y * apart_y)
        if (here_y > y) != (after_y > y) and off_x < off_y / way_y * way_x:
            inside = not inside
        here_x, here_y = after_x, after_y
    distance = -np.sqrt(nearest) if inside else np.sqrt(nearest)
    return distance - table.rounding[body] * radius - stroke[TIP_RADIUS]


@compiled
def _touch_first(state, table, body, stroke, touch):
    """Write how far the tool travels until it touches a body, and the normal there.

    Of parts that the tool overlaps already, the one that it will have met first on its way counts.
    """
    cos, sin = np.cos(state[THETA]), np.sin(state[THETA])
    dx, dy = stroke[START_X] - state[X], stroke[START_Y] - state[Y]
    x, y, radius = cos * dx + sin * dy, cos * dy - sin * dx, state[RADIUS]
    heading = stroke[LOCATION] + stroke[ANGLE]
    ux, uy = np.cos(heading - state[THETA]), np.sin(heading - state[THETA])
    rounding = table.rounding[body] * radius + stroke[TIP_RADIUS]
    first, last = table.first_corner[body], table.first_corner[body + 1]
    nearest, nx, ny = np.inf, ux, uy
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
            closing = uy * side_x - ux * side_y
            off = from_x * side_y - from_y * side_x
            if closing > 0.0 and off >= 0.0:
                met = (off - rounding) / closing
                ahead = max(met, 0.0)
                along = (from_x + ahead * ux) * side_x + (from_y + ahead * uy) * side_y
                if 0.0 <= along <= length and met < nearest:
                    nearest, nx, ny = met, -side_y, side_x
        ahead = -(from_x * ux + from_y * uy)
        squared = rounding * rounding - (from_x * from_x + from_y * from_y - ahead * ahead)
        if squared > 0.0 and ahead > 0.0:
            met = ahead - np.sqrt(squared)
            if met < nearest:
                way = max(met, 0.0)
                nearest, nx, ny = met, -(from_x + way * ux), -(from_y + way * uy)
    touch[DISTANCE] = max(nearest, 0.0)
    if touch[DISTANCE] >= stroke[LENGTH]:
        touch[DISTANCE], nx, ny = np.inf, ux, uy
    touch[NORMAL] = np.arctan2(sin * nx + cos * ny, cos * nx - sin * ny)
