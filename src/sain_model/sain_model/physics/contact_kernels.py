"""Contacts between round bodies in the plane, compiled: geometry, impulses, friction.

The impulses that keep bodies apart are found by projected Gauss-Seidel sweeps, as Bullet's
solver does, warm-started from the step before.
"""

import numpy as np

from sain_model.compute.compiling import compiled
from sain_model.physics.body_kernels import (
    ACROSS,
    ALONG,
    BIAS,
    END_X,
    END_Y,
    GAP,
    LIGHTNESS,
    NORMAL_MASS,
    NORMAL_X,
    NORMAL_Y,
    RADIUS,
    RIM_GRIP,
    RIM_MASS,
    SPIN,
    TOOL,
    TOOL_GRIP,
    TURN,
    VX,
    VY,
    X,
    Y,
    apply_impulse,
)
from sain_model.physics.table_kernels import hold

SWEEPS = 30  # most sweeps over the contacts in one step
CONVERGED = 5e-4  # [speeds of the tool], change of relative velocities in the last sweep
NEAR = 0.005  # [m], a pair further apart is looked at again in the next step
WARM_START = 1.0  # share of the last step's impulses to begin from
PUSH_OUT = 0.3  # share of an overlap that one step undoes, without giving speed
TOUCHING = 1e-5  # [m], a gap as small as this is none
TINY = 1e-12  # [m], keeps the normal of concentric disks finite


@compiled
def find_contacts(work, horizon):
    """Look at all pairs of bodies as they stand and move.

    Args:
        work: scratch memory; its list of near pairs is made anew.
        horizon: no longer step than this will follow [s].

    Returns:
        How many pairs are near, the time until the first of those apart touch [s] (at most the
        horizon), the fastest approach of two that touch already [m/s], and the fastest turning
        of a normal between two that press on each other [rad/s].
    """
    bodies, impulses = work.bodies, work.impulses
    count, pair = 0, 0
    impact, approach, turning = horizon, 0.0, 0.0
    for second in range(1, bodies.shape[0]):
        for first in range(second):
            dx = bodies[second, X] - bodies[first, X]
            dy = bodies[second, Y] - bodies[first, Y]
            vx = bodies[second, VX] - bodies[first, VX]
            vy = bodies[second, VY] - bodies[first, VY]
            rims = bodies[first, RADIUS] + bodies[second, RADIUS]
            squared = dx * dx + dy * dy
            reach = rims + NEAR + horizon * (abs(vx) + abs(vy))
            if squared < reach * reach:
                distance = np.sqrt(squared) + TINY
                gap = distance - rims
                closing = -(vx * dx + vy * dy) / distance
                if gap < TOUCHING:
                    approach = max(approach, closing)
                    if impulses[pair, ALONG] > 0.0:
                        turning = max(turning, abs(vy * dx - vx * dy) / squared)
                elif closing * impact > gap:
                    impact = gap / closing
                work.pairs[count, 0], work.pairs[count, 1] = first, second
                work.pairs[count, 2] = pair
                work.contacts[count, GAP] = gap
                count += 1
            else:
                impulses[pair, ALONG] = impulses[pair, ACROSS] = 0.0
            pair += 1
    return count, impact, approach, turning


@compiled
def prepare_contacts(count, step, physics, work):
    """Set up the near pairs for a step [s], or for a collision when the step is 0."""
    bodies, contacts = work.bodies, work.contacts
    for index in range(count):
        first, second = work.pairs[index, 0], work.pairs[index, 1]
        half_x = 0.5 * step * (bodies[second, VX] - bodies[first, VX])
        half_y = 0.5 * step * (bodies[second, VY] - bodies[first, VY])
        # The impulse of a step acts along the normal in its middle, and what it has to achieve
        # counts along the normal at its end: that makes the step second order.
        dx = bodies[second, X] - bodies[first, X] + half_x
        dy = bodies[second, Y] - bodies[first, Y] + half_y
        scale = 1.0 / (np.sqrt(dx * dx + dy * dy) + TINY)
        contacts[index, NORMAL_X], contacts[index, NORMAL_Y] = scale * dx, scale * dy
        dx, dy = dx + half_x, dy + half_y
        scale = 1.0 / (np.sqrt(dx * dx + dy * dy) + TINY)
        contacts[index, END_X], contacts[index, END_Y] = scale * dx, scale * dy
        contacts[index, BIAS] = _bias(work, index, step, physics)
        lightness = bodies[first, LIGHTNESS] + bodies[second, LIGHTNESS]
        turn = bodies[first, TURN] + bodies[second, TURN]
        contacts[index, NORMAL_MASS] = 1.0 / lightness
        contacts[index, RIM_MASS] = 1.0 / (lightness + turn)


@compiled
def _bias(work, index, step, physics):
    """Return how fast a pair may approach [m/s] in a step, or must leave (< 0) a collision."""
    bodies, contacts = work.bodies, work.contacts
    gap = contacts[index, GAP]
    if step > 0.0:
        return max(gap, 0.0) / step
    if gap >= TOUCHING:
        return np.inf
    first, second = work.pairs[index, 0], work.pairs[index, 1]
    vx = bodies[second, VX] - bodies[first, VX]
    vy = bodies[second, VY] - bodies[first, VY]
    leaving = vx * contacts[index, NORMAL_X] + vy * contacts[index, NORMAL_Y]
    share = physics.tool_restitution if first == TOOL else physics.disk_restitution
    return min(share * leaving, 0.0)


@compiled
def solve(count, physics, work):
    """Find the impulses that keep all near pairs apart, with Coulomb friction; apply them.

    Disks with a `grip` are held back by the table meanwhile.
    """
    impulses = work.impulses
    for index in range(count):
        pair = work.pairs[index, 2]
        impulses[pair, ALONG] *= WARM_START
        impulses[pair, ACROSS] *= WARM_START
        if impulses[pair, ALONG] > 0.0:
            _apply(work, index, impulses[pair, ALONG], impulses[pair, ACROSS])
    torsion = physics.foot_radius / physics.inertia, physics.inertia / physics.foot_radius**2
    for _ in range(SWEEPS):
        change = 0.0
        for index in range(count):
            change = max(change, _solve_one(work, index, physics))
        for disk in range(1, work.bodies.shape[0]):
            if work.grip[disk] > 0.0:
                change = max(change, hold(work, disk, *torsion))
        if change < CONVERGED * physics.speed:
            break


@compiled
def _solve_one(work, index, physics):
    """Correct the impulse of one contact; return the change of velocity it made [m/s]."""
    bodies, contacts, impulses = work.bodies, work.contacts, work.impulses
    first, second, pair = work.pairs[index, 0], work.pairs[index, 1], work.pairs[index, 2]
    nx, ny = contacts[index, END_X], contacts[index, END_Y]
    vx = bodies[second, VX] - bodies[first, VX]
    vy = bodies[second, VY] - bodies[first, VY]
    leaving = vx * nx + vy * ny
    sliding = vy * nx - vx * ny - bodies[second, SPIN] - bodies[first, SPIN]
    mass = contacts[index, NORMAL_MASS]
    normal = max(impulses[pair, ALONG] - mass * (leaving + contacts[index, BIAS]), 0.0)
    if first == TOOL:
        limit = normal * physics.tool_friction * bodies[second, TOOL_GRIP]
    else:
        limit = normal * physics.disk_friction * bodies[second, RIM_GRIP]
    rim = impulses[pair, ACROSS] - contacts[index, RIM_MASS] * sliding
    rim = min(max(rim, -limit), limit)
    along, across = normal - impulses[pair, ALONG], rim - impulses[pair, ACROSS]
    if along == 0.0 and across == 0.0:
        return 0.0
    impulses[pair, ALONG], impulses[pair, ACROSS] = normal, rim
    _apply(work, index, along, across)
    return max(abs(along), abs(across)) / mass


@compiled
def _apply(work, index, along, across):
    """Give both bodies of a contact an impulse along its normal and across it [N s]."""
    contacts = work.contacts
    first, second = work.pairs[index, 0], work.pairs[index, 1]
    nx, ny = contacts[index, NORMAL_X], contacts[index, NORMAL_Y]
    px, py = along * nx - across * ny, along * ny + across * nx
    apply_impulse(work, second, px, py, -across)
    apply_impulse(work, first, -px, -py, -across)  # the tool, heavy without end, takes no notice


@compiled
def note_tilt(work, count, physics, step):
    """Note how the contacts of this step shift the load of each disk to some of its feet."""
    bodies, contacts, tilt = work.bodies, work.contacts, work.tilt
    for body in range(bodies.shape[0]):
        tilt[body, 0] = tilt[body, 1] = 0.0
    for index in range(count):
        first, second, pair = work.pairs[index, 0], work.pairs[index, 1], work.pairs[index, 2]
        height = physics.tool_height if first == TOOL else physics.disk_height
        arm = (height - physics.middle_height) / (physics.gravity * step)
        along, across = arm * work.impulses[pair, ALONG], arm * work.impulses[pair, ACROSS]
        nx, ny = contacts[index, NORMAL_X], contacts[index, NORMAL_Y]
        px, py = along * nx - across * ny, along * ny + across * nx
        tilt[second, 0] += px * bodies[second, LIGHTNESS]
        tilt[second, 1] += py * bodies[second, LIGHTNESS]
        tilt[first, 0] -= px * bodies[first, LIGHTNESS]
        tilt[first, 1] -= py * bodies[first, LIGHTNESS]


@compiled
def separate(count, work):
    """Move overlapping bodies apart by a share of their overlap, without giving them speed."""
    bodies, contacts = work.bodies, work.contacts
    for index in range(count):
        if contacts[index, GAP] < -TOUCHING:
            first, second = work.pairs[index, 0], work.pairs[index, 1]
            overlap = -(contacts[index, GAP] + TOUCHING)
            shift = PUSH_OUT * overlap * contacts[index, NORMAL_MASS]
            shift_x = shift * contacts[index, NORMAL_X]
            shift_y = shift * contacts[index, NORMAL_Y]
            bodies[second, X] += shift_x * bodies[second, LIGHTNESS]
            bodies[second, Y] += shift_y * bodies[second, LIGHTNESS]
            bodies[first, X] -= shift_x * bodies[first, LIGHTNESS]
            bodies[first, Y] -= shift_y * bodies[first, LIGHTNESS]
