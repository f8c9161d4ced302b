"""Bodies in the compiled planar world, and its scratch memory.

Bodies are rows of one array: row 0 is the tool, which no impulse moves. The pushed body is row 1.
The tool's corners are the axes of its one or two disks, rounded by their radius. Corners 0 and 1 of
a bar have sides between them: one for each of its faces. Two fingers have none.
"""

from typing import Final, NamedTuple

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
MOST_CONTACTS = 24  # of a pair, a guard; two polygons that lie side by side have two to four


def _record(numbers: str, integers: str = "", flags: str = "") -> np.dtype:
    """Return the type of a record; indices have no sign, so that none is checked for a negative."""
    fields: list[tuple[str, type]] = [(name, np.float64) for name in numbers.split()]
    fields += [(name, np.uint32) for name in integers.split()]
    return np.dtype(fields + [(name, np.bool_) for name in flags.split()], align=True)


BODY: Final = _record(
    # Place of the centre of mass [m], velocities [m/s, rad/s], heading, and what it has turned by.
    "x y vx vy spin cos sin turned"
    # 1 / mass and 1 / moment of inertia, both 0 for what nothing moves; mass / moment of inertia.
    " lightness turn swing"
    # The velocity that an impulse gives a body that creeps: a symmetric matrix of x, y and spin.
    " move_xx move_xy move_yy move_xs move_ys move_ss"
    # The radius that corners are rounded with, that of the circumscribed circle, the arm on which
    # friction resists a turn on the spot [m], by how much sooner it stops what turns, and how light
    # the body is to turn from a support, over its squared arm [1/m^2].
    " round reach twist sooner yields"
    # Deceleration by friction with the table, and acceleration by a slope [m/s^2].
    " slowing slope_x slope_y"
    # From the centroid to the centre of mass in the body's frame, and where the latter began [m].
    " mass_fore mass_left start_x start_y"
    # Friction with bodies nearer to the push, and with the tool.
    " body_grip tool_grip"
    # Velocities at the start of the step, and their rates of change in the last one.
    " before_vx before_vy before_spin change_x change_y change_spin"
    # Speed that the table can take from a slow body, and what it has taken [m/s, rad/s].
    " grip held_x held_y held_spin"
    # Shift of the load on the table by what pushed the body last [m].
    " tilt_x tilt_y"
    # The last velocity of a body that creeps [m/s, rad/s], and how its friction has directions.
    " creep_x creep_y creep_spin grain_x grain_y",
    flags="stuck creeps",
)
# A corner in its body's frame [m], with the side to the next one: its direction and length.
CORNER: Final = _record("x y side_x side_y length", flags="convex")
# A support in its body's frame [m]. `share` is of the load, `lean_x` and `lean_y` how it grows with
# a shift of the load [1/m].
SUPPORT: Final = _record("x y share lean_x lean_y pull_x pull_y arm_x arm_y limit held_x held_y")
CONTACT: Final = _record(
    # Normal, and arms about both bodies' centres where the impulse acts (in the middle of a step):
    # of the impulse along the normal, and across it.
    "normal_x normal_y arm_point reach_point arm_side reach_side"
    # Likewise where it has to keep the bodies apart (at the end of the step).
    " end_x end_y end_arm_point end_reach_point end_arm_side end_reach_side"
    # What the solver needs, with the impulses [N s] and by how much the two are pressed in [m].
    " gap bias give relaxes along across pressed"
    # The velocities along and across that unit impulses along and across give [1/kg].
    " along_along along_across across_along across_across"
    # Friction, and factors of sticking and of slipping to both sides that follow from these.
    " grip stick slip_left slip_right"
    # Where the features are, and how far the point is from both ends of a side [m].
    " point_x point_y corner_at_x corner_at_y face_x face_y past left"
    # How the bodies move before the step, to each other and turning, and when its middle is [s].
    " going_x going_y point_spin side_spin middle",
    integers="point_body side_body point side kind key pair",
    # Whether the response to impulses is prepared for the step.
    flags="ready",
)
KEPT: Final = _record("along across pressed", integers="key pair")  # of a contact of the last step


class Workspace(NamedTuple):
    """Scratch memory of one push of N bodies with M corners and F supports in all.

    Corners of bodies follow those of the tool, of which there are at most two.
    """

    order: np.ndarray  # (N,) int64, the body of each other row
    bodies: np.ndarray  # (N + 1,) BODY; row 0 is the tool
    first_corner: np.ndarray  # (N + 2,) int64
    corners: np.ndarray  # (M + 2,) CORNER
    first_support: np.ndarray  # (N + 2,) int64
    supports: np.ndarray  # (F,) SUPPORT
    contacts: np.ndarray  # (C,) CONTACT
    kept: np.ndarray  # (C,) KEPT
    counts: np.ndarray  # (2,) int64, contacts of this step and of the last


@compiled_with_arrays
def make_workspace(table):
    """Return scratch memory for the bodies of a table."""
    rows = table.rounding.shape[0] + 1
    contacts = rows * (rows - 1) // 2 * MOST_CONTACTS + 1
    return Workspace(
        np.zeros(rows - 1, np.int64),
        np.zeros(rows, BODY),
        np.zeros(rows + 1, np.int64),
        np.zeros(table.corners.shape[0] + 2, CORNER),
        np.zeros(rows + 1, np.int64),
        np.zeros(table.supports.shape[0], SUPPORT),
        np.zeros(contacts, CONTACT),
        np.zeros(contacts, KEPT),
        np.zeros(2, np.int64),
    )


@compiled
def order_bodies(states, pushed, order):
    """Order the bodies (N,) by their distance from the pushed one, which is the first.

    The solver visits contacts one after another, which would let the numbering leak into the
    last digits. The order keeps it out.
    """
    for body in range(states.shape[0]):
        place, apart = body, _apart(states, pushed, body)
        while place > 0 and apart < _apart(states, pushed, order[place - 1]):
            order[place] = order[place - 1]
            place -= 1
        order[place] = body


@compiled
def _apart(states, pushed, body):
    x = states[body, STATE_X] - states[pushed, STATE_X]
    y = states[body, STATE_Y] - states[pushed, STATE_Y]
    return -1.0 if body == pushed else x * x + y * y


@compiled
def load_bodies(states, table, push, physics, own, work):
    """Fill the scratch memory from a scene (N, 8), taken as at rest; bodies are ordered.

    The push is a row of those of `push_bodies_block`.
    """
    bodies, order = work.bodies, work.order
    _load_tool(work, push, physics)
    for index in range(states.shape[0]):
        row, body = index + 1, order[index]
        _load_body(bodies[row], states[body], table, body, physics, own[body])
        _load_corners(work, row, states[body, STATE_RADIUS], table, body)
        _load_supports(work, row, states[body, STATE_RADIUS], table, body, physics, own[body])
    for contact in range(work.counts[0]):  # of the push before
        work.contacts[contact].pressed = 0.0
    forget_steps(work)


@compiled
def _load_tool(work, push, physics):
    """Place the tool, with the offset of its tip, at its start."""
    tool, corners = work.bodies[TOOL], work.corners
    tool.x, tool.y = push[0] + physics.tip_x, push[1] + physics.tip_y
    tool.start_x, tool.start_y, tool.cos = tool.x, tool.y, 1.0
    span_x, span_y, bar = push[5], push[6], push[7] > 0.0
    length = np.sqrt(span_x * span_x + span_y * span_y)
    tool.round, tool.reach = physics.tool_radius, physics.tool_radius + length
    work.first_corner[1] = 2 if length > 0.0 else 1
    for index in range(work.first_corner[1]):
        corner, scale = corners[index], 0.0
        corner.x, corner.y = index * span_x, index * span_y
        if bar and length > 0.0:
            scale = (1.0 - 2.0 * index) / length
        corner.side_x, corner.side_y = scale * span_x, scale * span_y
        corner.length = abs(scale) * length * length
        corner.convex = True


@compiled
def _load_body(loaded, state, table, body, physics, own):
    radius = state[STATE_RADIUS]
    loaded.vx = loaded.vy = loaded.spin = loaded.turned = 0.0
    loaded.cos, loaded.sin = np.cos(state[STATE_THETA]), np.sin(state[STATE_THETA])
    loaded.round = table.rounding[body] * radius
    # Half of the ratio goes to body 0: masses stay near those of the scene.
    root = np.sqrt(physics.mass_ratio)
    mass = state[STATE_MASS] / root if body == 0 else state[STATE_MASS] * root
    lightness = 0.0 if table.fixed[body] else 1.0 / mass
    inertia = own.inertia / DISK_INERTIA * table.inertia[body] * radius * radius
    loaded.lightness, loaded.turn, loaded.swing = lightness, lightness / inertia, 1.0 / inertia
    loaded.creeps = False
    loaded.slowing = own.friction_scale * physics.friction * physics.gravity
    loaded.slope_x, loaded.slope_y = own.slope_x, own.slope_y
    loaded.grain_x, loaded.grain_y = own.grain_x, own.grain_y
    loaded.body_grip, loaded.tool_grip = own.disk_friction, own.tool_friction
    fore, left = radius * own.centre_x, radius * own.centre_y
    loaded.mass_fore, loaded.mass_left = fore, left
    loaded.reach = table.reach[body] * radius + np.sqrt(fore * fore + left * left)
    x, y = mass_offset(loaded, loaded.cos, loaded.sin)
    loaded.x, loaded.y = state[STATE_X] + x, state[STATE_Y] + y
    loaded.start_x, loaded.start_y = loaded.x, loaded.y


@compiled
def _load_corners(work, row, radius, table, body):
    """Scale an outline about the centre of mass; a corner is convex where the way turns left."""
    corners = work.corners
    fore, left = work.bodies[row].mass_fore, work.bodies[row].mass_left
    first, last = table.first_corner[body], table.first_corner[body + 1]
    start = work.first_corner[row]
    end = start + last - first
    work.first_corner[row + 1] = end
    for index in range(start, end):
        corners[index].x = radius * table.corners[first + index - start, 0] - fore
        corners[index].y = radius * table.corners[first + index - start, 1] - left
    before = end - 1
    for index in range(start, end):
        after = index + 1 if index + 1 < end else start
        x = corners[after].x - corners[index].x
        y = corners[after].y - corners[index].y
        length = np.sqrt(x * x + y * y)
        if length == 0.0:  # a disk's one corner: any direction will do
            x, y = 1.0, 0.0
        scale = 1.0 / np.sqrt(x * x + y * y)
        corners[index].side_x, corners[index].side_y = scale * x, scale * y
        corners[index].length = length
    for index in range(start, end):
        turn = corners[before].side_x * corners[index].side_y
        turn -= corners[before].side_y * corners[index].side_x
        corners[index].convex = turn >= 0.0
        before = index


@compiled
def _load_supports(work, row, radius, table, body, physics, own):
    """Place the supports about the centre of mass, and share the load among them.

    `foot_radius` says where those of a disk stand, `torsion` how far those of this body are spread.
    """
    loaded = work.bodies[row]
    scale = physics.foot_radius / DISK_FEET * radius * own.torsion
    fore, left = loaded.mass_fore, loaded.mass_left
    first, last = table.first_support[body], table.first_support[body + 1]
    start = work.first_support[row]
    end = start + last - first
    work.first_support[row + 1] = end
    for foot in range(start, end):
        support, given = work.supports[foot], first + foot - start
        x, y = table.supports[given, 0], table.supports[given, 1]
        support.x, support.y = scale * x - fore, scale * y - left
        weight = table.supports[given, 3]
        if own.pressure != 0.0:
            weight *= max(np.sqrt(x * x + y * y), LEAST_ARM * table.reach[body]) ** own.pressure
        support.share = weight
    _share_load(work.supports, start, end)
    # As heavy to turn as a disk on its feet, however far this body's feet are from each other.
    heaviness = own.inertia / (physics.foot_radius * physics.foot_radius)
    lightness = loaded.swing if loaded.lightness > 0.0 else 0.0
    loaded.yields = heaviness * lightness
    twist = 0.0
    for foot in range(start, end):
        support = work.supports[foot]
        twist += support.share * np.sqrt(support.x**2 + support.y**2)
    loaded.twist = twist
    # At its rim, friction takes this much more from what turns than from what slides, but for a
    # factor of 2 that steps leave room for.
    loaded.sooner = max(0.5 * twist * loaded.reach * lightness, 1.0)


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
        support = supports[foot]
        total += support.share
        mean_x += support.share * support.x
        mean_y += support.share * support.y
    mean_x, mean_y = mean_x / total, mean_y / total
    xx, xy, yy = 0.0, 0.0, 0.0
    for foot in range(start, end):
        support = supports[foot]
        x, y, weight = support.x - mean_x, support.y - mean_y, support.share
        xx, xy, yy = xx + weight * x * x, xy + weight * x * y, yy + weight * y * y
    scale = 1.0 / (xx * yy - xy * xy)
    inwards = 1.0
    for foot in range(start, end):
        support = supports[foot]
        x, y, weight = support.x - mean_x, support.y - mean_y, support.share
        support.lean_x = weight * scale * (yy * x - xy * y)
        support.lean_y = weight * scale * (xx * y - xy * x)
        support.share = weight / total
        grows = -(support.lean_x * mean_x + support.lean_y * mean_y)
        least = (LEAST_SHARE - 1.0) * support.share
        if inwards * grows < least:
            inwards = least / grows
    for foot in range(start, end):
        support = supports[foot]
        grows = support.lean_x * mean_x + support.lean_y * mean_y
        support.share -= inwards * grows


@compiled
def forget_change(body):
    """Let the next step of a body not be foreseen from the last one."""
    body.change_x = body.change_y = body.change_spin = 0.0


@compiled
def forget_steps(work):
    """Clear what is kept from step to step, but for how far contacts are pressed in."""
    for row in range(work.bodies.shape[0]):
        body = work.bodies[row]
        body.grip = body.tilt_x = body.tilt_y = 0.0
        body.stuck = False
        forget_change(body)
    for index in range(work.counts[0]):
        work.contacts[index].along = work.contacts[index].across = 0.0
    work.counts[1] = 0


@compiled
def unload_bodies(states, work):
    """Write the bodies, at rest, back to the scene."""
    for index in range(states.shape[0]):
        body, state = work.bodies[index + 1], states[work.order[index]]
        _unload_place(body, state)
        if body.turned != 0.0:
            heading = state[STATE_THETA] + body.turned
            state[STATE_THETA] = np.pi - (np.pi - heading) % (2.0 * np.pi)
        for column in range(STATE_VX, STATE_OMEGA + 1):
            state[column] = 0.0


@compiled
def _unload_place(body, state):
    """Write the centroid's place; a body that did not move stays where it is, to the last bit."""
    if body.x != body.start_x or body.y != body.start_y or body.turned != 0.0:
        x, y = mass_offset(body, body.cos, body.sin)
        state[STATE_X], state[STATE_Y] = body.x - x, body.y - y


@compiled
def mass_offset(body, cos, sin):
    """Return the way from a body's centroid to its centre of mass at a heading [m]."""
    return cos * body.mass_fore - sin * body.mass_left, sin * body.mass_fore + cos * body.mass_left


@compiled
def outer_speed(body):
    """Return a bound on the speed of any point of a body [m/s]."""
    return np.sqrt(body.vx**2 + body.vy**2) + abs(body.spin) * body.reach


@compiled
def keep_impulses(work):
    """Put aside the impulses of the step that is over, and how far contacts are pressed in."""
    number = 0
    for index in range(work.counts[0]):
        contact = work.contacts[index]
        if contact.along > 0.0 or contact.pressed > 0.0:
            kept = work.kept[number]
            kept.along, kept.across, kept.pressed = contact.along, contact.across, contact.pressed
            kept.key, kept.pair = contact.key, contact.pair
            number += 1
    work.counts[1] = number


@compiled
def recall_impulses(work):
    """Give the contacts that are still there what was put aside.

    A new contact of two bodies is pressed in as far as another one of theirs was.
    """
    for index in range(work.counts[0]):
        contact, same = work.contacts[index], False
        contact.along = contact.across = contact.pressed = 0.0
        for number in range(work.counts[1]):
            kept = work.kept[number]
            if kept.key == contact.key:
                contact.along, contact.across, same = kept.along, kept.across, True
                contact.pressed = kept.pressed
            elif kept.pair == contact.pair and not same:
                contact.pressed = max(contact.pressed, kept.pressed)
