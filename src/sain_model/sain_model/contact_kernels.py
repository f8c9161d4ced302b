"""Contacts between round bodies in the plane, compiled: geometry, impulses, friction.

Bodies are rows of one array: row 0 is the tool, which no impulse moves, the others are disks.
The impulses that keep them apart are found by projected Gauss-Seidel sweeps, as Bullet's solver
does, warm-started from the step before.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

TOOL = 0
# Columns of a body. `SPIN` is the speed of the rim [m/s], `TURN` what 1 N s at the rim adds to it.
X, Y, VX, VY, SPIN, RADIUS, LIGHTNESS, TURN, THETA, COS, SIN = range(11)
BODY_SIZE = 11

NORMAL_X, NORMAL_Y, GAP, BIAS, NORMAL_MASS, RIM_MASS = range(6)
CONTACT_SIZE = 6
ALONG, ACROSS = range(2)  # columns of an impulse

SWEEPS = 30  # most sweeps over the contacts in one step
CONVERGED = 1e-5  # [m/s], change of relative velocities in the last sweep
REACH = 0.005  # [m], a pair further apart cannot touch within one step
WARM_START = 0.9  # share of the last step's impulses to begin from
PUSH_OUT = 0.3  # share of an overlap that one step undoes, without giving speed
SLOP = 1e-5  # [m], overlap that is left alone


class Workspace(NamedTuple):
    """Scratch memory of one push. P = N (N + 1) / 2 pairs of bodies, C <= P of them near."""

    bodies: np.ndarray  # (N + 1, BODY_SIZE)
    before: np.ndarray  # (N + 1, 3) velocities at the start of the step
    pairs: np.ndarray  # (C, 3) int64: first body, second body, pair
    contacts: np.ndarray  # (C, CONTACT_SIZE)
    impulses: np.ndarray  # (P, 2) [N s], kept from step to step
    pushed: np.ndarray  # (N + 1,) bool, whom a contact pushed in this step


@njit(cache=True)
def make_workspace(disks):
    """Return scratch memory for this many disks."""
    pairs = disks * (disks + 1) // 2
    return Workspace(
        np.zeros((disks + 1, BODY_SIZE)),
        np.zeros((disks + 1, 3)),
        np.empty((pairs, 3), np.int64),
        np.empty((pairs, CONTACT_SIZE)),
        np.zeros((pairs, 2)),
        np.zeros(disks + 1, np.bool_),
    )


@njit(cache=True)
def find_contacts(step, work):
    """List the pairs that may touch within this step [s]; return how many there are."""
    bodies, impulses = work.bodies, work.impulses
    count = 0
    pair = 0
    for second in range(1, bodies.shape[0]):
        for first in range(second):
            dx = bodies[second, X] - bodies[first, X]
            dy = bodies[second, Y] - bodies[first, Y]
            touching = bodies[first, RADIUS] + bodies[second, RADIUS]
            squared = dx * dx + dy * dy
            if squared < (touching + REACH) * (touching + REACH):
                work.pairs[count, 0], work.pairs[count, 1] = first, second
                work.pairs[count, 2] = pair
                _describe_contact(work, count, dx, dy, np.sqrt(squared) - touching, step)
                count += 1
            else:
                impulses[pair, ALONG] = impulses[pair, ACROSS] = 0.0
            pair += 1
    return count


@njit(cache=True)
def _describe_contact(work, index, dx, dy, gap, step):
    bodies, contacts = work.bodies, work.contacts
    first, second = work.pairs[index, 0], work.pairs[index, 1]
    # The normal half a step ahead makes the step second order, where one at its start is first.
    dx += 0.5 * step * (bodies[second, VX] - bodies[first, VX])
    dy += 0.5 * step * (bodies[second, VY] - bodies[first, VY])
    scale = 1.0 / np.sqrt(dx * dx + dy * dy + 1e-24)
    lightness = bodies[first, LIGHTNESS] + bodies[second, LIGHTNESS]
    turn = bodies[first, TURN] + bodies[second, TURN]
    contacts[index, NORMAL_X], contacts[index, NORMAL_Y] = scale * dx, scale * dy
    contacts[index, GAP] = gap
    contacts[index, BIAS] = max(gap, 0.0) / step
    contacts[index, NORMAL_MASS] = 1.0 / lightness
    contacts[index, RIM_MASS] = 1.0 / (lightness + turn)


@njit(cache=True)
def solve_contacts(count, tool_friction, disk_friction, work):
    """Find the impulses that keep all pairs apart, with Coulomb friction, and apply them."""
    for index in range(count):
        pair = work.pairs[index, 2]
        work.impulses[pair, ALONG] *= WARM_START
        work.impulses[pair, ACROSS] *= WARM_START
        if work.impulses[pair, ALONG] > 0.0:
            _apply(work, index, work.impulses[pair, ALONG], work.impulses[pair, ACROSS])
    for _ in range(SWEEPS):
        change = 0.0
        for index in range(count):
            friction = tool_friction if work.pairs[index, 0] == TOOL else disk_friction
            change = max(change, _solve_one(work, index, friction))
        if change < CONVERGED:
            break


@njit(cache=True)
def _solve_one(work, index, friction):
    """Correct the impulse of one contact; return the change of velocity it made [m/s]."""
    bodies, contacts, impulses = work.bodies, work.contacts, work.impulses
    first, second, pair = work.pairs[index, 0], work.pairs[index, 1], work.pairs[index, 2]
    nx, ny = contacts[index, NORMAL_X], contacts[index, NORMAL_Y]
    vx = bodies[second, VX] - bodies[first, VX]
    vy = bodies[second, VY] - bodies[first, VY]
    leaving = vx * nx + vy * ny
    sliding = vy * nx - vx * ny - bodies[second, SPIN] - bodies[first, SPIN]
    mass = contacts[index, NORMAL_MASS]
    normal = max(impulses[pair, ALONG] - mass * (leaving + contacts[index, BIAS]), 0.0)
    limit = friction * normal
    rim = impulses[pair, ACROSS] - contacts[index, RIM_MASS] * sliding
    rim = min(max(rim, -limit), limit)
    along, across = normal - impulses[pair, ALONG], rim - impulses[pair, ACROSS]
    impulses[pair, ALONG], impulses[pair, ACROSS] = normal, rim
    if along == 0.0 and across == 0.0:
        return 0.0
    _apply(work, index, along, across)
    return max(abs(along), abs(across)) / mass


@njit(cache=True)
def _apply(work, index, along, across):
    """Give both bodies of a contact an impulse along its normal and across it [N s]."""
    bodies, contacts = work.bodies, work.contacts
    first, second = work.pairs[index, 0], work.pairs[index, 1]
    nx, ny = contacts[index, NORMAL_X], contacts[index, NORMAL_Y]
    px, py = along * nx - across * ny, along * ny + across * nx
    bodies[second, VX] += px * bodies[second, LIGHTNESS]
    bodies[second, VY] += py * bodies[second, LIGHTNESS]
    bodies[second, SPIN] -= across * bodies[second, TURN]
    bodies[first, VX] -= px * bodies[first, LIGHTNESS]
    bodies[first, VY] -= py * bodies[first, LIGHTNESS]
    bodies[first, SPIN] -= across * bodies[first, TURN]


@njit(cache=True)
def separate(count, work):
    """Note whom a contact pushed, and move overlapping bodies apart by a share of the overlap."""
    bodies, contacts = work.bodies, work.contacts
    for body in range(bodies.shape[0]):
        work.pushed[body] = False
    for index in range(count):
        first, second, pair = work.pairs[index, 0], work.pairs[index, 1], work.pairs[index, 2]
        if work.impulses[pair, ALONG] > 0.0:
            work.pushed[first] = work.pushed[second] = True
        if contacts[index, GAP] < -SLOP:
            shift = -PUSH_OUT * (contacts[index, GAP] + SLOP) * contacts[index, NORMAL_MASS]
            shift_x = shift * contacts[index, NORMAL_X]
            shift_y = shift * contacts[index, NORMAL_Y]
            bodies[second, X] += shift_x * bodies[second, LIGHTNESS]
            bodies[second, Y] += shift_y * bodies[second, LIGHTNESS]
            bodies[first, X] -= shift_x * bodies[first, LIGHTNESS]
            bodies[first, Y] -= shift_y * bodies[first, LIGHTNESS]
