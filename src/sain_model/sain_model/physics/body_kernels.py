"""Bodies in the compiled planar world, and its scratch memory.

Bodies are rows of one array: row 0 is the tool, which no impulse moves. The pushed body is row 1.
"""

from typing import NamedTuple

import numpy as np

from sain_core.scene import MASS as STATE_MASS
from sain_core.scene import OMEGA as STATE_OMEGA
from sain_core.scene import RADIUS as STATE_RADIUS
from sain_core.scene import THETA as STATE_THETA
from sain_core.scene import VX as STATE_VX
from sain_core.scene import X as STATE_X
from sain_core.scene import Y as STATE_Y
from sain_model.compute.compiling import compiled, compiled_with_arrays

TOOL = 0
DISK_INERTIA = 0.5  # share of mass x radius^2, of the uniform disk that the inertia is of
DISK_FEET = 0.7  # radii, where the disks stand that the radius of feet is of
LEAST_SHARE = 0.15  # of its load, that an offset of the centre of mass leaves each support
LEAST_ARM = 0.09  # radii, supports nearer to the middle press as one that stands there

# Columns of a body [SI units]. `LIGHTNESS` is 1 / mass and `TURN` 1 / moment of inertia, both 0
# for what nothing moves. `ROUND` is the radius that its corners are rounded with, `REACH` that of
# the circumscribed circle, `TWIST` the arm on which friction resists a turn on the spot. `SLOWING`
# is the deceleration by friction with the table. `MASS_FORE` and `MASS_LEFT` lead from the centroid
# to the centre of mass in the body's frame. `X` and `Y` are those of the latter.
X, Y, VX, VY, SPIN, COS, SIN, TURNED, LIGHTNESS, TURN, ROUND, REACH, TWIST = range(13)
SLOWING, SLOPE_X, SLOPE_Y, MASS_FORE, MASS_LEFT, BODY_GRIP, TOOL_GRIP = range(13, 20)
BODY_SIZE = 20
# Columns of a corner in its body's frame, with the side to the next one: its direction and length.
CORNER_X, CORNER_Y, SIDE_X, SIDE_Y, LENGTH, CONVEX = range(6)
CORNER_SIZE = 6
# Columns of a support in its body's frame. `SHARE` is of the load, `LEAN_X` and `LEAN_Y` how it
# grows with a shift of the load [1/m]. `YIELD` says how light the body is to turn from here.
FOOT_X, FOOT_Y, SHARE, LEAN_X, LEAN_Y, YIELD, PULL_X, PULL_Y = range(8)
ARM_X, ARM_Y, LIMIT, HELD_X, HELD_Y = range(8, 13)
SUPPORT_SIZE = 13
# Columns of a contact: normal and arms about both bodies' centres where the impulse acts (in the
# middle of a step), and where it has to keep the bodies apart (at its end). Arms: of the impulse
# along the normal, and across it. Then what the solver needs, and where the features are.
NORMAL_X, NORMAL_Y, ARM_POINT, REACH_POINT, ARM_SIDE, REACH_SIDE = range(6)
END_X, END_Y, END_ARM_POINT, END_REACH_POINT, END_ARM_SIDE, END_REACH_SIDE = range(6, 12)
GAP, BIAS, NORMAL_MASS, RIM_MASS, ALONG, ACROSS = range(12, 18)
POINT_X, POINT_Y, CORNER_AT_X, CORNER_AT_Y, FACE_X, FACE_Y, PAST, LEFT = range(18, 26)
CONTACT_SIZE = 26
POINT_BODY, SIDE_BODY, KIND, KEY = range(4)  # integer columns of a contact
MOST_CONTACTS = 24  # of a pair, a guard; two polygons that lie side by side have two to four


class Workspace(NamedTuple):
    """Scratch memory of one push of N bodies with M corners and F supports in all."""

    bodies: np.ndarray  # (N + 1, BODY_SIZE)
    first_corner: np.ndarray  # (N + 2,) int64
    corners: np.ndarray  # (M + 1, CORNER_SIZE)
    first_support: np.ndarray  # (N + 2,) int64
    supports: np.ndarray  # (F, SUPPORT_SIZE)
    before: np.ndarray  # (N + 1, 3) vx, vy, spin at the start of the step
    change: np.ndarray  # (N + 1, 3) their rates of change in the last step
    grip: np.ndarray  # (N + 1,) speed that the table can take from a slow body [m/s]
    held: np.ndarray  # (N + 1, 3) and what it has taken
    stuck: np.ndarray  # (N + 1,) bool
    tilt: np.ndarray  # (N + 1, 2) shift of the load on the table by what pushed a body last [m]
    contacts: np.ndarray  # (C, CONTACT_SIZE)
    features: np.ndarray  # (C, 4) int64
    kept: np.ndarray  # (C, 2) impulses of the last step [N s]
    kept_keys: np.ndarray  # (C,) int64
    counts: np.ndarray  # (2,) int64, contacts of this step and of the last
    touched: np.ndarray  # (N + 1,) bool


@compiled_with_arrays
def make_workspace(table):
    """Return scratch memory for the bodies of a table."""
    rows = table.rounding.shape[0] + 1
    contacts = rows * (rows - 1) // 2 * MOST_CONTACTS + 1
    return Workspace(
        np.zeros((rows, BODY_SIZE)),
        np.zeros(rows + 1, np.int64),
        np.zeros((table.corners.shape[0] + 1, CORNER_SIZE)),
        np.zeros(rows + 1, np.int64),
        np.zeros((table.supports.shape[0], SUPPORT_SIZE)),
        np.zeros((rows, 3)),
        np.zeros((rows, 3)),
        np.zeros(rows),
        np.zeros((rows, 3)),
        np.zeros(rows, np.bool_),
        np.zeros((rows, 2)),
        np.zeros((contacts, CONTACT_SIZE)),
        np.zeros((contacts, 4), np.int64),
        np.zeros((contacts, 2)),
        np.zeros(contacts, np.int64),
        np.zeros(2, np.int64),
        np.zeros(rows, np.bool_),
    )


@compiled
def load_bodies(states, order, table, start_x, start_y, physics, own, work):
    """Fill the scratch memory from a scene (N, 8), taken as at rest.

    Args:
        states: the scene.
        order: number of the body of each row but the tool's, (N,).
        table: of the bodies.
        start_x: where the tool's axis stands [m].
        start_y: likewise.
        physics: numbers of the push.
        own: numbers of the bodies, (N,).
        work: to fill.
    """
    bodies = work.bodies
    bodies[TOOL, X], bodies[TOOL, Y] = start_x, start_y
    bodies[TOOL, COS] = 1.0
    bodies[TOOL, ROUND] = bodies[TOOL, REACH] = physics.tool_radius
    work.first_corner[1] = 1
    work.corners[TOOL, CONVEX] = 1.0  # the tool's one corner is its axis
    for index in range(states.shape[0]):
        row, body = index + 1, order[index]
        _load_body(bodies, row, states[body], table, body, physics, own[body])
        _load_corners(work, row, states[body, STATE_RADIUS], table, body)
        _load_supports(work, row, states[body, STATE_RADIUS], table, body, physics, own[body])
    for row in range(bodies.shape[0]):
        work.touched[row] = False
    forget_steps(work)


@compiled
def _load_body(bodies, row, state, table, body, physics, own):
    radius = state[STATE_RADIUS]
    bodies[row, VX] = bodies[row, VY] = bodies[row, SPIN] = bodies[row, TURNED] = 0.0
    bodies[row, COS], bodies[row, SIN] = np.cos(state[STATE_THETA]), np.sin(state[STATE_THETA])
    bodies[row, ROUND] = table.rounding[body] * radius
    # Half of the ratio goes to body 0: masses stay near those of the scene.
    root = np.sqrt(physics.mass_ratio)
    mass = state[STATE_MASS] / root if body == 0 else state[STATE_MASS] * root
    lightness = 0.0 if table.fixed[body] else 1.0 / mass
    inertia = own.inertia / DISK_INERTIA * table.inertia[body] * radius * radius
    bodies[row, LIGHTNESS], bodies[row, TURN] = lightness, lightness / inertia
    bodies[row, SLOWING] = own.friction_scale * physics.friction * physics.gravity
    bodies[row, SLOPE_X], bodies[row, SLOPE_Y] = own.slope_x, own.slope_y
    bodies[row, BODY_GRIP], bodies[row, TOOL_GRIP] = own.disk_friction, own.tool_friction
    fore, left = radius * own.centre_x, radius * own.centre_y
    bodies[row, MASS_FORE], bodies[row, MASS_LEFT] = fore, left
    bodies[row, REACH] = table.reach[body] * radius + np.sqrt(fore * fore + left * left)
    x, y = mass_offset(bodies, row, bodies[row, COS], bodies[row, SIN])
    bodies[row, X], bodies[row, Y] = state[STATE_X] + x, state[STATE_Y] + y


@compiled
def _load_corners(work, row, radius, table, body):
    """Scale an outline about the centre of mass; a corner is convex where the way turns left."""
    corners = work.corners
    fore, left = work.bodies[row, MASS_FORE], work.bodies[row, MASS_LEFT]
    first, last = table.first_corner[body], table.first_corner[body + 1]
    start = work.first_corner[row]
    end = start + last - first
    work.first_corner[row + 1] = end
    for index in range(start, end):
        corners[index, CORNER_X] = radius * table.corners[first + index - start, 0] - fore
        corners[index, CORNER_Y] = radius * table.corners[first + index - start, 1] - left
    before = end - 1
    for index in range(start, end):
        after = index + 1 if index + 1 < end else start
        x = corners[after, CORNER_X] - corners[index, CORNER_X]
        y = corners[after, CORNER_Y] - corners[index, CORNER_Y]
        length = np.sqrt(x * x + y * y)
        if length == 0.0:  # a disk's one corner: any direction will do
            x, y = 1.0, 0.0
        scale = 1.0 / np.sqrt(x * x + y * y)
        corners[index, SIDE_X], corners[index, SIDE_Y] = scale * x, scale * y
        corners[index, LENGTH] = length
    for index in range(start, end):
        turn = corners[before, SIDE_X] * corners[index, SIDE_Y]
        turn -= corners[before, SIDE_Y] * corners[index, SIDE_X]
        corners[index, CONVEX] = 1.0 if turn >= 0.0 else 0.0
        before = index


@compiled
def _load_supports(work, row, radius, table, body, physics, own):
    """Place the supports about the centre of mass, and share the load among them.

    `foot_radius` says where those of a disk stand, `torsion` how far those of this body are spread.
    """
    bodies, supports = work.bodies, work.supports
    scale = physics.foot_radius / DISK_FEET * radius * own.torsion
    fore, left = bodies[row, MASS_FORE], bodies[row, MASS_LEFT]
    first, last = table.first_support[body], table.first_support[body + 1]
    start = work.first_support[row]
    end = start + last - first
    work.first_support[row + 1] = end
    for foot in range(start, end):
        x, y = table.supports[first + foot - start, 0], table.supports[first + foot - start, 1]
        supports[foot, FOOT_X], supports[foot, FOOT_Y] = scale * x - fore, scale * y - left
        weight = table.supports[first + foot - start, 3]
        if own.pressure != 0.0:
            weight *= max(np.sqrt(x * x + y * y), LEAST_ARM * table.reach[body]) ** own.pressure
        supports[foot, SHARE] = weight
    _share_load(supports, start, end)
    # As heavy to turn as a disk on its feet, however far this body's feet are from each other.
    heaviness = own.inertia / (physics.foot_radius * physics.foot_radius)
    lightness = 0.0
    if bodies[row, LIGHTNESS] > 0.0:
        lightness = bodies[row, TURN] / bodies[row, LIGHTNESS]
    twist = 0.0
    for foot in range(start, end):
        squared = supports[foot, FOOT_X] ** 2 + supports[foot, FOOT_Y] ** 2
        supports[foot, YIELD] = heaviness * squared * lightness
        twist += supports[foot, SHARE] * np.sqrt(squared)
    bodies[row, TWIST] = twist


@compiled
def _share_load(supports, start, end):
    """Replace the weights of supports by their shares of a load that acts at their origin.

    Statics asks that shares w_i sum to 1 and balance at p. Supports as stiff as their weights m_i
    carry w_i = m_i (a + b x_i + c y_i): with the weights' centroid and second moments, a, b, c are
    linear in p. A load too far out is moved in until no support carries less than `LEAST_SHARE` of
    what it does below the centroid: the load lies off the supports otherwise, and the body tips.
    """
    total, mean_x, mean_y = 0.0, 0.0, 0.0
    for foot in range(start, end):
        total += supports[foot, SHARE]
        mean_x += supports[foot, SHARE] * supports[foot, FOOT_X]
        mean_y += supports[foot, SHARE] * supports[foot, FOOT_Y]
    mean_x, mean_y = mean_x / total, mean_y / total
    xx, xy, yy = 0.0, 0.0, 0.0
    for foot in range(start, end):
        x, y = supports[foot, FOOT_X] - mean_x, supports[foot, FOOT_Y] - mean_y
        weight = supports[foot, SHARE]
        xx, xy, yy = xx + weight * x * x, xy + weight * x * y, yy + weight * y * y
    scale = 1.0 / (xx * yy - xy * xy)
    inwards = 1.0
    for foot in range(start, end):
        x, y = supports[foot, FOOT_X] - mean_x, supports[foot, FOOT_Y] - mean_y
        weight = supports[foot, SHARE]
        supports[foot, LEAN_X] = weight * scale * (yy * x - xy * y)
        supports[foot, LEAN_Y] = weight * scale * (xx * y - xy * x)
        supports[foot, SHARE] = weight / total
        grows = -(supports[foot, LEAN_X] * mean_x + supports[foot, LEAN_Y] * mean_y)
        least = (LEAST_SHARE - 1.0) * supports[foot, SHARE]
        if inwards * grows < least:
            inwards = least / grows
    for foot in range(start, end):
        grows = supports[foot, LEAN_X] * mean_x + supports[foot, LEAN_Y] * mean_y
        supports[foot, SHARE] -= inwards * grows


@compiled
def forget_steps(work):
    """Clear what is kept from step to step."""
    for body in range(work.bodies.shape[0]):
        work.grip[body] = 0.0
        work.stuck[body] = False
        work.tilt[body, 0] = work.tilt[body, 1] = 0.0
        work.change[body, 0] = work.change[body, 1] = work.change[body, 2] = 0.0
    for contact in range(work.counts[0]):
        work.contacts[contact, ALONG] = work.contacts[contact, ACROSS] = 0.0
    work.counts[1] = 0


@compiled
def unload_bodies(states, order, work, touched):
    """Write the bodies, at rest, back to the scene, and which of them the tool has touched."""
    bodies = work.bodies
    for index in range(states.shape[0]):
        row, body = index + 1, order[index]
        touched[body] = work.touched[row]
        _unload_place(bodies, row, states[body])
        if bodies[row, TURNED] != 0.0:
            heading = states[body, STATE_THETA] + bodies[row, TURNED]
            states[body, STATE_THETA] = np.pi - (np.pi - heading) % (2.0 * np.pi)
        for column in range(STATE_VX, STATE_OMEGA + 1):
            states[body, column] = 0.0


@compiled
def _unload_place(bodies, row, state):
    """Write the centroid's place; a body that did not move stays where it is, to the last bit."""
    x, y = mass_offset(bodies, row, np.cos(state[STATE_THETA]), np.sin(state[STATE_THETA]))
    moved = bodies[row, X] != state[STATE_X] + x or bodies[row, Y] != state[STATE_Y] + y
    if moved or bodies[row, TURNED] != 0.0:
        x, y = mass_offset(bodies, row, bodies[row, COS], bodies[row, SIN])
        state[STATE_X], state[STATE_Y] = bodies[row, X] - x, bodies[row, Y] - y


@compiled
def mass_offset(bodies, row, cos, sin):
    """Return the way from a body's centroid to its centre of mass at a heading [m]."""
    fore, left = bodies[row, MASS_FORE], bodies[row, MASS_LEFT]
    return cos * fore - sin * left, sin * fore + cos * left


@compiled
def outer_speed(bodies, row):
    """Return a bound on the speed of any point of a body [m/s]."""
    sliding = np.sqrt(bodies[row, VX] ** 2 + bodies[row, VY] ** 2)
    return sliding + abs(bodies[row, SPIN]) * bodies[row, REACH]


@compiled
def keep_impulses(work):
    """Put the impulses of the step that is over aside."""
    count = work.counts
    count[1] = 0
    for index in range(count[0]):
        if work.contacts[index, ALONG] > 0.0:
            work.kept[count[1], 0] = work.contacts[index, ALONG]
            work.kept[count[1], 1] = work.contacts[index, ACROSS]
            work.kept_keys[count[1]] = work.features[index, KEY]
            count[1] += 1


@compiled
def recall_impulses(work):
    """Give the contacts that are still there the impulses that were put aside."""
    contacts = work.contacts
    for index in range(work.counts[0]):
        contacts[index, ALONG] = contacts[index, ACROSS] = 0.0
        for kept in range(work.counts[1]):
            if work.kept_keys[kept] == work.features[index, KEY]:
                contacts[index, ALONG] = work.kept[kept, 0]
                contacts[index, ACROSS] = work.kept[kept, 1]
