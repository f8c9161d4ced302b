"""How a block of Push-T moves while an agent that is no disk is pressed against it, compiled.

Such an agent has a mass, and the speed that its controller gives it is lost with every step of the
simulation. So it only creeps towards its target. Where it is in the block, both are moved apart by
a share of the depth in every step: that alone pushes the block. All is in metres and radians; a
body is its convex parts' corners (M, 2), with where they begin (P + 1,), its centre of mass (2,),
all about its origin, and its radius of gyration.
"""

import numba
import numpy as np

from pusht.contact import place_corners, resolve

PACE = 0.01  # of the way to the target, in a step of the simulation: k_p x time step^2
SUBSTEPS = 10  # in a step of control
APART = 1.0 - (1.0 - 0.1) ** (60 * 0.01)  # of a depth, likewise: pymunk's collision_bias
WAITS = 2  # steps of control at the end
SLOWEST = 4.0  # how much longer than without a block a stroke may take
MOST = 36  # contacts
ROUNDS = 6


@numba.njit(cache=True)
def press_blocks(poses, starts, ways, angle, tool, block, reach, slop, far, low, high):
    """Return the poses (B, 3) of blocks after strokes of an agent, and where it began (B, 2).

    Its centre of mass goes through starts (B, 2) in the direction of the ways (B, 2). It begins
    where it does not touch the block. `reach` is the farthest target.
    """
    after, begun = poses.copy(), np.empty_like(starts)
    for row in range(len(poses)):
        length = np.hypot(ways[row, 0], ways[row, 1])
        along = ways[row] / max(length, 1e-9)
        agent = begin(after[row], starts[row], along, angle, tool, block, far)
        begun[row] = agent[:2]
        if length > 0.0:
            _stroke(agent, after[row], along, length, tool, block, reach, slop, low, high)
    return after, begun


@numba.njit(cache=True)
def begin(pose, start, along, angle, tool, block, far):
    """Return the pose (3,) of an agent at rest behind a block from which a stroke begins."""
    cos, sin = np.cos(angle), np.sin(angle)
    x = start[0] - (cos * tool[2][0] - sin * tool[2][1])
    y = start[1] - (sin * tool[2][0] + cos * tool[2][1])
    agent, contacts = np.array([x, y, angle]), np.empty((MOST, 5))
    first, second = np.empty_like(tool[0]), np.empty_like(block[0])
    place_corners(pose, block[0], second)
    step, back = far / 60.0, 0.0
    while back < far:
        agent[0], agent[1] = x - back * along[0], y - back * along[1]
        place_corners(agent, tool[0], first)
        if find_contacts(first, tool[1], second, block[1], contacts) == 0:
            break
        back += step
    agent[0] -= step * along[0]
    agent[1] -= step * along[1]
    return agent


@numba.njit(cache=True)
def most_steps(length, drive):
    """Return the steps of control after which a stroke ends, wherever the agent is."""
    return int(SLOWEST * length / (drive * (1.0 - (1.0 - PACE) ** SUBSTEPS))) + 2


@numba.njit(cache=True)
def _stroke(agent, pose, along, length, tool, block, reach, slop, low, high):
    """Drive an agent on until it has gone a length, then let it rest."""
    x, y = agent[0], agent[1]
    drive = along * (reach / max(abs(along[0]), abs(along[1])))
    for _ in range(most_steps(length, np.hypot(drive[0], drive[1]))):
        if (agent[0] - x) * along[0] + (agent[1] - y) * along[1] >= length:
            break
        to_x, to_y = agent[0] + drive[0], agent[1] + drive[1]
        for _ in range(SUBSTEPS):
            creep(agent, pose, to_x, to_y, tool, block, slop, low, high)
    for _ in range(WAITS):
        to_x, to_y = agent[0], agent[1]
        for _ in range(SUBSTEPS):
            creep(agent, pose, to_x, to_y, tool, block, slop, low, high)


@numba.njit(cache=True)
def creep(agent, pose, to_x, to_y, tool, block, slop, low, high):
    """Move an agent and a block (3,) by a step of the simulation, with a target."""
    agent[0], agent[1] = agent[0] + PACE * (to_x - agent[0]), agent[1] + PACE * (to_y - agent[1])
    first, second = np.empty_like(tool[0]), np.empty_like(block[0])
    place_corners(agent, tool[0], first)
    place_corners(pose, block[0], second)
    contacts = np.empty((MOST, 5))  # point, normal into the block, depth
    count = find_contacts(first, tool[1], second, block[1], contacts)
    if count == 0:
        return
    levers, impulses = np.empty((MOST, 2)), np.zeros(MOST)
    moves = np.zeros((2, 3))  # of the centres of mass, and turns
    for one in range(count):
        levers[one, 0] = _lever(agent, contacts[one], tool)
        levers[one, 1] = _lever(pose, contacts[one], block)
    for _ in range(ROUNDS):
        for one in range(count):
            _, _, normal_x, normal_y, deep = contacts[one]
            apart = (moves[1, 0] - moves[0, 0]) * normal_x + (moves[1, 1] - moves[0, 1]) * normal_y
            apart += levers[one, 1] * moves[1, 2] - levers[one, 0] * moves[0, 2]
            by_tool, by_block = levers[one, 0] / tool[3] ** 2, levers[one, 1] / block[3] ** 2
            soft = 2.0 + by_tool * levers[one, 0] + by_block * levers[one, 1]
            more = max((APART * max(deep - slop, 0.0) - apart) / soft, -impulses[one])
            impulses[one] += more
            moves[0] -= more * np.array([normal_x, normal_y, by_tool])
            moves[1] += more * np.array([normal_x, normal_y, by_block])
    _move(agent, moves[0], tool[2])
    _move(pose, moves[1], block[2])
    resolve(pose, 0.0, 0.0, -1.0, block[0], block[1], block[2], block[3], low, high, second)


@numba.njit(cache=True)
def _lever(pose, contact, body):
    """Return the lever of a contact's normal about the centre of mass."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x = contact[0] - pose[0] - (cos * body[2][0] - sin * body[2][1])
    y = contact[1] - pose[1] - (sin * body[2][0] + cos * body[2][1])
    return x * contact[3] - y * contact[2]


@numba.njit(cache=True)
def _move(pose, move, centre):
    """Move a pose (3,) by that of its centre of mass, and a turn about it."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    x, y = cos * centre[0] - sin * centre[1], sin * centre[0] + cos * centre[1]
    cos, sin = np.cos(move[2]), np.sin(move[2])
    pose[0] += move[0] + x - (cos * x - sin * y)
    pose[1] += move[1] + y - (sin * x + cos * y)
    pose[2] += move[2]


@numba.njit(cache=True)
def find_contacts(first, firsts, second, seconds, contacts):
    """Note contacts (5,) of the convex parts of two bodies; return how many there are."""
    count = 0
    for one in range(len(firsts) - 1):
        for other in range(len(seconds) - 1):
            count = _meet(
                first[firsts[one] : firsts[one + 1]],
                second[seconds[other] : seconds[other + 1]],
                contacts,
                count,
            )
    return count


@numba.njit(cache=True)
def _least(one, other):
    """Return by how much, and beyond which side of `one`, another convex polygon is least inside.

    Above 0, they do not meet.
    """
    best, side = -np.inf, 0
    for corner in range(len(one)):
        after = (corner + 1) % len(one)
        out_x, out_y = one[after, 1] - one[corner, 1], one[corner, 0] - one[after, 0]
        length = np.hypot(out_x, out_y)
        nearest = np.inf
        for point in range(len(other)):
            away = (other[point, 0] - one[corner, 0]) * out_x
            away += (other[point, 1] - one[corner, 1]) * out_y
            nearest = min(nearest, away / length)
        if nearest > best:
            best, side = nearest, corner
        if best >= 0.0:
            break
    return best, side


@numba.njit(cache=True)
def _meet(one, other, contacts, count):
    """Note the contacts of two convex polygons: of the side that is least inside, both ends."""
    by_one, side_one = _least(one, other)
    if by_one >= 0.0 or count + 2 > len(contacts):
        return count
    by_other, side_other = _least(other, one)
    if by_other >= 0.0:
        return count
    swapped = by_other > by_one
    flat, side, opposite = (other, side_other, one) if swapped else (one, side_one, other)
    after = (side + 1) % len(flat)
    along_x, along_y = flat[after, 0] - flat[side, 0], flat[after, 1] - flat[side, 1]
    length = np.hypot(along_x, along_y)
    along_x, along_y = along_x / length, along_y / length
    out_x, out_y = along_y, -along_x
    facing, edge = np.inf, 0
    for corner in range(len(opposite)):
        to = (corner + 1) % len(opposite)
        way_x, way_y = opposite[to, 0] - opposite[corner, 0], opposite[to, 1] - opposite[corner, 1]
        against = (way_y * out_x - way_x * out_y) / np.hypot(way_x, way_y)
        if against < facing:
            facing, edge = against, corner
    ends = np.empty((2, 2))  # along the flat side, and beyond it
    for end in range(2):
        corner = (edge + end) % len(opposite)
        x, y = opposite[corner, 0] - flat[side, 0], opposite[corner, 1] - flat[side, 1]
        ends[end, 0], ends[end, 1] = x * along_x + y * along_y, x * out_x + y * out_y
    span = ends[1, 0] - ends[0, 0]
    sign = -1.0 if swapped else 1.0
    for end in range(2):
        at = min(max(ends[end, 0], 0.0), length)
        share = (at - ends[0, 0]) / span if abs(span) > 1e-12 else float(end)
        share = min(max(share, 0.0), 1.0)
        beyond = ends[0, 1] + share * (ends[1, 1] - ends[0, 1])
        if beyond < 0.0:
            contacts[count, 0] = flat[side, 0] + at * along_x + 0.5 * beyond * out_x
            contacts[count, 1] = flat[side, 1] + at * along_y + 0.5 * beyond * out_y
            contacts[count, 2], contacts[count, 3] = sign * out_x, sign * out_y
            contacts[count, 4] = -beyond
            count += 1
    return count
