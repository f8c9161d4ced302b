"""What the network sees, compiled; training runs the same kernels.

The scene is seen in the frame of the push: the origin is the pushed body's centre before the push,
the x axis points along the inward normal where the tool begins. A disk's `location` is that normal.
Of a stroke it is the normal where the tool first touches the body.

Of a shape the network sees what acts: where bodies are near each other before the push and after it
as the prior predicts it, with normal, levers, extent and curvature, and how the load is spread over
the supports. It sees no outline, so it can be asked about other shapes. The closest features of two
outlines are a corner of one and a side or a corner of the other. Where two sides lie along each
other, all of both is equally near. So that nothing jumps when they turn a little, a contact is the
mean over all such pairs, of which the weight falls off with their gap.

The tool is one more sender: row i of the relations to body i, where a body would meet itself. Both
disks of a tool are in its one contact. A relation also holds what its sender is, and how the tool
meets the pushed body.
"""

from typing import Final, NamedTuple

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
from sain_core.scene import MASS, RADIUS, THETA, X, Y
from sain_model.compute.compiling import (
    callable_kernel,
    compiled,
    compiled_apart,
    compiled_with_arrays,
)
from sain_model.network.settings import MASS_MIDDLE

SOFTNESS = 0.0015  # [m], a gap larger by this counts e times less
CUT = 6.0 * SOFTNESS
FAR = 0.08  # [m], circumscribed circles that are further apart make no contact

# Rows of a pose, of a tool that of its middle, with half of its span [m]; and of a contact: its
# middle [m], the normal from the first body to the second, the gap [m] and how far it extends along
# its tangent [m].
POSE_X, POSE_Y, POSE_COS, POSE_SIN, POSE_RADIUS, POSE_HALF = range(6)
AT_X, AT_Y, NORMAL_X, NORMAL_Y, APART, EXTENT = range(6)
POSE_SIZE, PATCH_SIZE = 6, 6
SUMS = 9  # that `find_patch` works with


class OutlineTable(NamedTuple):
    """The outlines of N bodies and, behind them, of the tool; in units of the states' radii."""

    first_corner: np.ndarray  # (2, N + 2) int64, with a tool of one disk, and of two
    corners: np.ndarray  # (M, 2), counter-clockwise; two of the tool
    rounding: np.ndarray  # (N + 1,), 1 for what is round, else 0
    reach: np.ndarray  # (N + 1,), circumscribed radius
    inertia: np.ndarray  # (N + 1,), upright moment, share of mass x radius^2
    supports: np.ndarray  # (N, 6): second moment of the loads, their 2nd and 3rd order in the plane


@compiled
def place_corners(starts, table, poses, placed):
    """Write where the corners (M, 2) [m] are of bodies in poses (N + 1, 6); `starts` (N + 2,)."""
    for body in range(poses.shape[0]):
        cos, sin = poses[body, POSE_COS], poses[body, POSE_SIN]
        for corner in range(starts[body], starts[body + 1]):
            x = poses[body, POSE_RADIUS] * table.corners[corner, 0]
            y = poses[body, POSE_RADIUS] * table.corners[corner, 1]
            placed[corner, 0] = poses[body, POSE_X] + cos * x - sin * y
            placed[corner, 1] = poses[body, POSE_Y] + sin * x + cos * y


@compiled
def _foot(placed, corner, here, after, solid):
    """Return the distance of a corner from a side, and the unit vector from the side to it.

    The distance is negative for a corner behind the side of what is solid.
    """
    way_x, way_y = placed[after, 0] - placed[here, 0], placed[after, 1] - placed[here, 1]
    off_x, off_y = placed[corner, 0] - placed[here, 0], placed[corner, 1] - placed[here, 1]
    squared = way_x * way_x + way_y * way_y
    share = 0.0
    if squared > 0.0:
        share = (off_x * way_x + off_y * way_y) / squared
    if solid and 0.0 < share < 1.0:
        scale = 1.0 / np.sqrt(squared)
        normal_x, normal_y = scale * way_y, -scale * way_x  # outward, as outlines turn left
        return off_x * normal_x + off_y * normal_y, normal_x, normal_y
    if share > 0.0:
        share = min(share, 1.0)
        off_x, off_y = off_x - share * way_x, off_y - share * way_y
    distance = np.sqrt(off_x * off_x + off_y * off_y)
    scale = 1.0 / max(distance, 1e-12)
    return distance, scale * off_x, scale * off_y


@compiled
def _least_gap(starts, placed, of, on, joined, solid, rounding):
    """Return the smallest gap [m] between corners of a body and sides of another.

    Those of fingers, which no sides join, are points; those of a bar have nothing behind them.
    """
    least = np.inf
    for corner in range(starts[of], starts[of + 1]):
        here = starts[on + 1] - 1
        for after in range(starts[on], starts[on + 1]):
            distance = _foot(placed, corner, here if joined else after, after, solid)[0]
            least = min(least, abs(distance - rounding))
            here = after
    return least


@compiled
def _add_near(starts, table, placed, poses, of, on, joined, solid, least, way, sums):
    """Add up what is near: corners of body `of` about sides of body `on`, weighted.

    `least` is the smallest gap of the two [m], `way` 1 where the normal is from `of` to `on`, else
    -1. The sums (9,) are weight, then weighted x, y, normal, gap, xx, xy and yy.
    """
    round_of = table.rounding[of] * poses[of, POSE_RADIUS]
    round_on = table.rounding[on] * poses[on, POSE_RADIUS]
    for corner in range(starts[of], starts[of + 1]):
        here = starts[on + 1] - 1
        for after in range(starts[on], starts[on + 1]):
            here = here if joined else after
            distance, normal_x, normal_y = _foot(placed, corner, here, after, solid)
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
def find_patch(starts, table, placed, poses, first, second, bar, sums, patch):
    """Write the contact (6,) of two bodies, or an infinite gap where they are far apart.

    The second one may be the tool, and a bar.
    """
    solid = second < poses.shape[0] - 1
    joined = solid or bar
    x = poses[second, POSE_X] - poses[first, POSE_X]
    y = poses[second, POSE_Y] - poses[first, POSE_Y]
    reach = table.reach[first] * poses[first, POSE_RADIUS]
    reach += table.reach[second] * poses[second, POSE_RADIUS] + poses[second, POSE_HALF]
    for row in range(PATCH_SIZE):
        patch[row] = 0.0
    if np.sqrt(x * x + y * y) - reach > FAR:
        patch[APART] = np.inf
        return
    rounding = table.rounding[first] * poses[first, POSE_RADIUS]
    rounding += table.rounding[second] * poses[second, POSE_RADIUS]
    least = min(
        _least_gap(starts, placed, first, second, joined, solid, rounding),
        _least_gap(starts, placed, second, first, True, True, rounding),
    )
    for row in range(sums.shape[0]):
        sums[row] = 0.0
    _add_near(starts, table, placed, poses, first, second, joined, solid, least, 1.0, sums)
    _add_near(starts, table, placed, poses, second, first, True, True, least, -1.0, sums)
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


# --- features -------------------------------------------------------------------------------------

PLACE_FEATURES: Final = 10  # columns of a body behind the others, for a network that sees the world
GAP_BEFORE: Final = 10  # columns of a relation: 0 where two bodies touch, 1 far apart
GAP_AFTER: Final = 15

PLACE_SCALE: Final = 0.1  # [m]
MOVE_SCALE: Final = 0.05  # [m]
TURN_SCALE: Final = 0.2  # [rad]
GAP_SCALE: Final = 0.02  # [m], beyond which it hardly matters how far apart two bodies are
MASS_SCALE: Final = 1.0  # [kg]
REACH_MIDDLE: Final = 0.08  # [m]
REACH_SCALE: Final = 0.02  # [m]
INERTIA_MIDDLE: Final = 0.3
INERTIA_SCALE: Final = 0.2
ORDER_3_SCALE: Final = 3.0
TABLE_X, TABLE_Y = 0.5, 0.0  # [m], the middle of the table
TABLE_SCALE: Final = 0.2  # [m]

LANES: Final = 64  # pushes side by side: few, so that all threads have some of a small batch


class NetworkWork(NamedTuple):
    """Features of pushes, one in each lane, and scratch memory.

    Relation i N + j is to body i from body j; i N + i is to body i from the tool.
    """

    poses: np.ndarray  # (2, N + 1, 6) of bodies and tool in the push frame, before and after
    placed: np.ndarray  # (2, M, 2) corners [m]
    sums: np.ndarray  # (9,)
    patch: np.ndarray  # (6,) of one contact
    bodies: np.ndarray  # (N, inputs of f_dyn, LANES) float32
    relations: np.ndarray  # (N N, inputs of f_rel, LANES) float32
    packed: np.ndarray  # (inputs of f_rel, LANES) float32, relations of bodies that are near
    packed_from: np.ndarray  # (LANES, 2) uint32, body and lane of a packed relation
    messages: np.ndarray  # (M, N, message, LANES) float32, sums of what bodies are told
    hidden: np.ndarray  # (2, widest layer, LANES) float32
    residual: np.ndarray  # (N, 3, LANES) dx, dy [m] in the push frame, dtheta [rad]


IS_TOOL, EXTENT_BEFORE, EXTENT_AFTER = 0, 9, 11  # columns of a relation; gaps: `GAP_BEFORE`, ...
CONTACT_BEFORE, CONTACT_AFTER = 16, 24  # eight columns each
HEADINGS = 32  # eight columns, 0 for a network that does not see the world
SENDER = 40  # the features of the sender, 0 for the tool
TOOL_CONTACT = SENDER + 30  # twenty columns: gaps, extents and contacts of the tool
RELATION_FEATURES = TOOL_CONTACT + 20

CURVATURE_SCALE = 0.02  # [m], times 1 / radius
EXTENT_SCALE = 0.03  # [m]

# Columns that change their sign in a mirror, of a network that does not see the world.
_CONTACT = (1, 3, 5, 6, 7)
MIRRORED_RELATION = (
    13,
    *(CONTACT_BEFORE + column for column in _CONTACT),
    *(CONTACT_AFTER + column for column in _CONTACT),
    *(SENDER + column for column in (4, 6, 8, 10, 13, 14, 18)),
    *(TOOL_CONTACT + 4 + column for column in _CONTACT),
    *(TOOL_CONTACT + 12 + column for column in _CONTACT),
)


@compiled
def write_who(body, other, stroke, table, features, poses, lane, relation):
    """Write who tells and who is told; a tool has no mass and no inertia."""
    tool = other == features.shape[0]
    relation[IS_TOOL, lane] = 1.0 if tool else 0.0
    relation[1, lane] = features[body, 0, lane]
    relation[2, lane] = 0.0 if tool else features[other, 0, lane]
    relation[3, lane] = features[body, 1, lane]
    relation[4, lane] = 0.0 if tool else features[other, 1, lane]
    relation[5, lane] = features[body, 15, lane]
    relation[6, lane] = 0.0 if tool else features[other, 15, lane]
    curved, bent = table.rounding[body], table.rounding[other]
    relation[7, lane] = CURVATURE_SCALE * curved / poses[0, body, POSE_RADIUS]
    relation[8, lane] = CURVATURE_SCALE * bent / poses[0, other, POSE_RADIUS]
    relation[12, lane], relation[13, lane] = np.cos(stroke[ANGLE]), np.sin(stroke[ANGLE])
    relation[14, lane] = stroke[LENGTH] / PLACE_SCALE


@compiled
def write_contact(patch, poses, body, other, way, when, lane, relation):
    """Write how a body meets another one: `way` is 1 where the normal leads there, else -1."""
    first = CONTACT_AFTER if when == 1 else CONTACT_BEFORE
    gap = GAP_AFTER if when == 1 else GAP_BEFORE
    extent = EXTENT_AFTER if when == 1 else EXTENT_BEFORE
    for column in range(first, first + 8):
        relation[column, lane] = 0.0
    relation[extent, lane] = 0.0
    relation[gap, lane] = 1.0
    if patch[APART] == np.inf:
        return
    relation[gap, lane] = np.tanh(max(patch[APART], 0.0) / GAP_SCALE)
    relation[extent, lane] = patch[EXTENT] / EXTENT_SCALE
    x, y = patch[AT_X] - poses[body, POSE_X], patch[AT_Y] - poses[body, POSE_Y]
    off_x, off_y = patch[AT_X] - poses[other, POSE_X], patch[AT_Y] - poses[other, POSE_Y]
    normal_x, normal_y = way * patch[NORMAL_X], way * patch[NORMAL_Y]
    relation[first, lane], relation[first + 1, lane] = x / PLACE_SCALE, y / PLACE_SCALE
    relation[first + 2, lane], relation[first + 3, lane] = off_x / PLACE_SCALE, off_y / PLACE_SCALE
    relation[first + 4, lane], relation[first + 5, lane] = normal_x, normal_y
    relation[first + 6, lane] = (x * normal_y - y * normal_x) / PLACE_SCALE
    relation[first + 7, lane] = (off_x * normal_y - off_y * normal_x) / PLACE_SCALE


@compiled
def write_headings(patch, poses, body, other, way, when, lane, relation):
    """Write the headings of both bodies about the normal: where their masses lie to one side."""
    first = HEADINGS + 4 * when
    for column in range(first, first + 4):
        relation[column, lane] = 0.0
    if patch[APART] == np.inf:
        return
    normal_x, normal_y = way * patch[NORMAL_X], way * patch[NORMAL_Y]
    cos, sin = poses[body, POSE_COS], poses[body, POSE_SIN]
    relation[first, lane] = cos * normal_x + sin * normal_y
    relation[first + 1, lane] = sin * normal_x - cos * normal_y
    cos, sin = poses[other, POSE_COS], poses[other, POSE_SIN]
    relation[first + 2, lane] = cos * normal_x + sin * normal_y
    relation[first + 3, lane] = sin * normal_x - cos * normal_y


@compiled
def write_context(work, pushed, sent, lane):
    """Write to each relation what its sender is, and how the tool meets the pushed body."""
    count = work.bodies.shape[0]
    tool = work.relations[pushed * count + pushed]
    for body in range(count):
        for slot in range(count):
            relation = work.relations[body * count + slot]
            if slot != body:
                _copy(work.bodies[slot], 0, sent, lane, relation, SENDER)
            _copy(tool, EXTENT_BEFORE, 3, lane, relation, TOOL_CONTACT)
            _copy(tool, GAP_AFTER, 17, lane, relation, TOOL_CONTACT + 3)


@compiled
def _copy(source, first, count, lane, relation, at):
    for row in range(count):
        relation[at + row, lane] = source[first + row, lane]


# A change of meaning, order or scale below needs another `sain_core.provenance.FORMAT`.
VECTORS_FROM = 3  # columns of what is believed of a body, before its vectors
WAY = 9  # column of a body: how far physics moves it
BODY_FEATURES = 20  # and the `PLACE_FEATURES` of a network that sees the world
TURN = 2.0 * np.pi

# The kernels take pushes as strokes of which `LOCATION` is the normal's heading in the world, and
# `ANGLE` the way's to the left of it.

MIRRORED_BODY = (4, 6, 8, 10, 13, 14, 18)  # columns that change their sign in a mirror


@compiled
def wrap(angle):
    """Wrap an angle [rad] to (-pi, pi]."""
    return np.pi - (np.pi - angle) % TURN


@compiled_with_arrays
def make_work(bodies, corners, relation_inputs, body_inputs, widest, members, message):
    """Return scratch memory for so many bodies and corners; inputs that pad a layer stay zero."""
    return NetworkWork(
        np.zeros((2, bodies + 1, POSE_SIZE)),
        np.empty((2, corners, 2)),
        np.empty(SUMS),
        np.empty(PATCH_SIZE),
        np.zeros((bodies, body_inputs, LANES), np.float32),
        np.zeros((bodies * bodies, relation_inputs, LANES), np.float32),
        np.zeros((relation_inputs, LANES), np.float32),
        np.empty((LANES, 2), np.uint32),
        np.empty((members, bodies, message, LANES), np.float32),
        np.empty((2, widest, LANES), np.float32),
        np.zeros((bodies, 3, LANES)),
    )


@compiled_apart
def write_lane(before, stroke, after, believed, table, lane, places, work):
    """Write the features of one push into its lane.

    The push is a stroke in its own frame, as `push_frames` makes it. `believed` (N, P) is what the
    network sees of what is believed of the physics; `places`: whether it sees places and headings.
    """
    count, pushed = before.shape[0], int(stroke[BODY])
    origin_x, origin_y = before[pushed, X], before[pushed, Y]
    poses, placed = work.poses, work.placed
    two = stroke[SPAN_X] != 0.0 or stroke[SPAN_Y] != 0.0
    starts = table.first_corner[1 if two else 0]
    for when in range(2):
        scene = after if when == 1 else before
        for body in range(count):
            _write_pose(scene[body], origin_x, origin_y, stroke[LOCATION], poses[when, body])
        _write_tool(stroke, origin_x, origin_y, when * stroke[LENGTH], poses[when, count])
        place_corners(starts, table, poses[when], placed[when])
        if two:
            _part_disks(stroke, placed[when], starts[count])
    for body in range(count):
        _write_body(before[body], stroke, after[body], table, body, poses, lane, work.bodies[body])
        if places:
            _write_world(before[body], stroke, after[body], lane, work.bodies[body])
        first, pose = BODY_FEATURES + PLACE_FEATURES * places, poses[0, body]
        _write_believed(believed[body], stroke, pose, first, lane, work.bodies[body])
    sums, patch = work.sums, work.patch
    for body in range(count):
        for other in range(body + 1, count + 1):
            _write_relation(body, other, stroke, table, lane, work)
            for when in range(2):
                seen = placed[when], poses[when], body, other, stroke[BAR] > 0.0
                find_patch(starts, table, *seen, sums, patch)
                _write_meeting(patch, body, other, when, lane, places, work)
    write_context(work, pushed, BODY_FEATURES + PLACE_FEATURES * places, lane)


@compiled
def _write_relation(body, other, stroke, table, lane, work):
    """Write who a body and another one, or the tool, are; both ways round."""
    count = work.bodies.shape[0]
    slot = body if other == count else other
    there = work.relations[body * count + slot]
    write_who(body, other, stroke, table, work.bodies, work.poses, lane, there)
    if other < count:
        back = work.relations[other * count + body]
        write_who(other, body, stroke, table, work.bodies, work.poses, lane, back)


@compiled
def _write_meeting(patch, body, other, when, lane, places, work):
    """Write how they meet; both ways round."""
    count, poses = work.bodies.shape[0], work.poses[when]
    slot = body if other == count else other
    there = work.relations[body * count + slot]
    write_contact(patch, poses, body, other, 1.0, when, lane, there)
    if places:
        write_headings(patch, poses, body, other, 1.0, when, lane, there)
    if other < count:
        back = work.relations[other * count + body]
        write_contact(patch, poses, other, body, -1.0, when, lane, back)
        if places:
            write_headings(patch, poses, other, body, -1.0, when, lane, back)


@compiled
def _write_pose(state, origin_x, origin_y, normal, pose):
    cos, sin = np.cos(normal), np.sin(normal)
    x, y = state[X] - origin_x, state[Y] - origin_y
    pose[POSE_X], pose[POSE_Y] = cos * x + sin * y, cos * y - sin * x
    pose[POSE_COS], pose[POSE_SIN] = np.cos(state[THETA] - normal), np.sin(state[THETA] - normal)
    pose[POSE_RADIUS] = state[RADIUS]


@compiled
def _write_tool(stroke, origin_x, origin_y, way, pose):
    cos, sin = np.cos(stroke[LOCATION]), np.sin(stroke[LOCATION])
    x, y = stroke[START_X] - origin_x, stroke[START_Y] - origin_y
    pose[POSE_X] = cos * x + sin * y + way * np.cos(stroke[ANGLE])
    pose[POSE_Y] = cos * y - sin * x + way * np.sin(stroke[ANGLE])
    span_x, span_y = stroke[SPAN_X], stroke[SPAN_Y]
    pose[POSE_X] += 0.5 * (cos * span_x + sin * span_y)
    pose[POSE_Y] += 0.5 * (cos * span_y - sin * span_x)
    pose[POSE_HALF] = 0.5 * np.sqrt(span_x * span_x + span_y * span_y)
    pose[POSE_COS], pose[POSE_SIN], pose[POSE_RADIUS] = 1.0, 0.0, stroke[TIP_RADIUS]


@compiled
def _part_disks(stroke, placed, first):
    """Move the two corners of a tool from its middle to the axes of its disks."""
    cos, sin = np.cos(stroke[LOCATION]), np.sin(stroke[LOCATION])
    span_x, span_y = stroke[SPAN_X], stroke[SPAN_Y]
    for disk in range(2):
        placed[first + disk, 0] += (disk - 0.5) * (cos * span_x + sin * span_y)
        placed[first + disk, 1] += (disk - 0.5) * (cos * span_y - sin * span_x)


@compiled
def _write_body(before, stroke, after, table, body, poses, lane, features):
    here, there = poses[0, body], poses[1, body]
    features[0, lane] = 1.0 if body == int(stroke[BODY]) else 0.0
    features[1, lane] = (before[MASS] - MASS_MIDDLE) / MASS_SCALE
    reach = table.reach[body] * before[RADIUS]
    features[2, lane] = (reach - REACH_MIDDLE) / REACH_SCALE
    features[3, lane], features[4, lane] = here[POSE_X] / PLACE_SCALE, here[POSE_Y] / PLACE_SCALE
    cos, sin = here[POSE_COS], here[POSE_SIN]
    twice_cos, twice_sin = cos * cos - sin * sin, 2.0 * cos * sin
    thrice_cos, thrice_sin = twice_cos * cos - twice_sin * sin, twice_cos * sin + twice_sin * cos
    load = table.supports[body]
    features[5, lane] = ORDER_3_SCALE * (thrice_cos * load[3] - thrice_sin * load[4])
    features[6, lane] = ORDER_3_SCALE * (thrice_sin * load[3] + thrice_cos * load[4])
    moved_x, moved_y = there[POSE_X] - here[POSE_X], there[POSE_Y] - here[POSE_Y]
    features[7, lane], features[8, lane] = moved_x / MOVE_SCALE, moved_y / MOVE_SCALE
    features[9, lane] = np.sqrt(moved_x * moved_x + moved_y * moved_y) / MOVE_SCALE
    features[10, lane] = wrap(after[THETA] - before[THETA]) / TURN_SCALE
    way, across = stroke[LENGTH] / PLACE_SCALE, np.sin(stroke[ANGLE])
    features[11, lane], features[12, lane] = way, np.cos(stroke[ANGLE])
    features[13, lane], features[14, lane] = across, way * across
    features[15, lane] = (table.inertia[body] - INERTIA_MIDDLE) / INERTIA_SCALE
    features[16, lane] = load[0]
    features[17, lane] = twice_cos * load[1] - twice_sin * load[2]
    features[18, lane] = twice_sin * load[1] + twice_cos * load[2]
    features[19, lane] = table.rounding[body]


@compiled
def _write_world(before, stroke, after, lane, features):
    """Write what tells places and headings apart: what is learned with it holds for one table."""
    first, normal = BODY_FEATURES, stroke[LOCATION]
    features[first, lane] = (before[X] - TABLE_X) / TABLE_SCALE
    features[first + 1, lane] = (before[Y] - TABLE_Y) / TABLE_SCALE
    features[first + 2, lane] = (after[X] - TABLE_X) / TABLE_SCALE
    features[first + 3, lane] = (after[Y] - TABLE_Y) / TABLE_SCALE
    features[first + 4, lane], features[first + 5, lane] = np.cos(normal), np.sin(normal)
    features[first + 6, lane] = np.cos(2.0 * normal)
    features[first + 7, lane] = np.sin(2.0 * normal)
    features[first + 8, lane] = np.cos(before[THETA] - normal)
    features[first + 9, lane] = np.sin(before[THETA] - normal)


@compiled
def _write_believed(believed, stroke, pose, first, lane, features):
    """Write what is believed of a body's physics: numbers, then vectors in the push frame.

    Those are the body's centre of mass and the grain of its friction, the table's grain, and the
    offset of the tool's tip. Grains turn twice as the frame turns once.
    """
    for column in range(min(VECTORS_FROM, believed.shape[0])):
        features[first + column, lane] = believed[column]
    for column in range(VECTORS_FROM, believed.shape[0], 2):
        vector, cos, sin = (column - VECTORS_FROM) // 2, pose[POSE_COS], pose[POSE_SIN]
        if vector > 1:  # of the table
            cos, sin = np.cos(stroke[LOCATION]), -np.sin(stroke[LOCATION])
        if vector == 1 or vector == 2:
            cos, sin = cos * cos - sin * sin, 2.0 * cos * sin
        x, y = believed[column], believed[column + 1]
        features[first + column, lane] = cos * x - sin * y
        features[first + column + 1, lane] = sin * x + cos * y


@callable_kernel
def write_block(first, scenes, strokes, physics_next, believed, table, places, bodies, relations):
    """Write features (B, N, D) and (B, N N, R) of up to `LANES` pushes from number `first` on."""
    corners = table.corners.shape[0]
    work = make_work(scenes.shape[1], corners, relations.shape[2], bodies.shape[2], LANES, 0, 0)
    for index in range(first, min(first + LANES, scenes.shape[0])):
        lane, row = index - first, min(index, believed.shape[0] - 1)
        given = scenes[index], strokes[index], physics_next[index], believed[row]
        write_lane(*given, table, lane, places, work)
        for body in range(bodies.shape[1]):
            for column in range(bodies.shape[2]):
                bodies[index, body, column] = work.bodies[body, column, lane]
        for pair in range(relations.shape[1]):
            for column in range(relations.shape[2]):
                relations[index, pair, column] = work.relations[pair, column, lane]
