"""Impulses that keep outlines apart, compiled: sequential impulses with Coulomb friction.

Erin Catto, "Iterative dynamics with temporal coherence" (Game Developers Conference 2005):
projected Gauss-Seidel sweeps over the contacts, which begin with the impulses of the last step.
"""

import numpy as np

from sain_model.compute.compiling import compiled, compiled_apart
from sain_model.physics.body_kernels import (
    ACROSS,
    ALONG,
    ARM_POINT,
    ARM_SIDE,
    BIAS,
    BODY_GRIP,
    CORNER_AT_X,
    CORNER_AT_Y,
    END_ARM_POINT,
    END_ARM_SIDE,
    END_REACH_POINT,
    END_REACH_SIDE,
    END_X,
    END_Y,
    FACE_X,
    FACE_Y,
    GAP,
    KIND,
    LEFT,
    LIGHTNESS,
    NORMAL_MASS,
    NORMAL_X,
    NORMAL_Y,
    PAST,
    POINT_BODY,
    POINT_X,
    POINT_Y,
    REACH_POINT,
    REACH_SIDE,
    RIM_MASS,
    ROUND,
    SIDE_BODY,
    SPIN,
    TOOL,
    TOOL_GRIP,
    TURN,
    VX,
    VY,
    X,
    Y,
)
from sain_model.physics.overlap_kernels import ON_CORNER, ON_SIDE
from sain_model.physics.support_kernels import hold_back, hold_supports

SWEEPS = 30  # most sweeps over the contacts in one step
CONVERGED = 5e-4  # [speeds of the tool], change of relative velocities in the last sweep
PUSH_OUT = 0.3  # share of an overlap that one step undoes, without giving speed
TOUCHING = 1e-5  # [m], a gap as small as this is none
LEAVE = 1e-3  # [s]
SHARPEST = 0.001  # [m], the normal of sharper corners is not followed as they pass each other


@compiled
def foresee(work, horizon):
    """Look at how the listed features move.

    Returns:
        The time until the first of those apart touch [s] (at most the horizon), the fastest
        approach of two that touch already [m/s], and the fastest turning of a normal between two
        that press on each other [rad/s].
    """
    bodies, contacts, features = work.bodies, work.contacts, work.features
    impact, approach, turning, leave = horizon, 0.0, 0.0, horizon
    for index in range(work.counts[0]):
        point, side = features[index, POINT_BODY], features[index, SIDE_BODY]
        nx, ny, gap = contacts[index, FACE_X], contacts[index, FACE_Y], contacts[index, GAP]
        rounding = bodies[point, ROUND]
        x, y = contacts[index, POINT_X] - rounding * nx, contacts[index, POINT_Y] - rounding * ny
        from_x = bodies[point, X] + x - bodies[side, X]
        from_y = bodies[point, Y] + y - bodies[side, Y]
        vx = bodies[point, VX] - bodies[point, SPIN] * y
        vy = bodies[point, VY] + bodies[point, SPIN] * x
        vx -= bodies[side, VX] - bodies[side, SPIN] * from_y
        vy -= bodies[side, VY] + bodies[side, SPIN] * from_x
        closing = -(vx * nx + vy * ny)
        if gap < TOUCHING:
            approach = max(approach, closing)
            if contacts[index, ALONG] > 0.0:
                turning = max(turning, abs(bodies[side, SPIN]))
                if features[index, KIND] == ON_SIDE:
                    _dx, _dy = contacts[index, POINT_X], contacts[index, POINT_Y]
                    cx = vx - rounding * (bodies[point, SPIN] - bodies[side, SPIN]) * ny
                    cy = vy + rounding * (bodies[point, SPIN] - bodies[side, SPIN]) * nx
                    along = cy * nx - cx * ny
                    room = contacts[index, LEFT] if along > 0.0 else contacts[index, PAST]
                    if abs(along) * leave > room >= 0.0:
                        leave = room / abs(along)
                if features[index, KIND] == ON_CORNER:
                    rolling = abs(vy * nx - vx * ny)
                    round_both = gap + rounding + bodies[side, ROUND]
                    turning = max(turning, rolling / max(round_both, SHARPEST))
        elif closing * impact > gap:
            impact = gap / closing
    return min(impact, max(leave, LEAVE)), approach, turning


@compiled
def prepare_impulses(work, step, physics):
    """Set up the contacts for a step [s], or for a collision when the step is 0.

    The impulse of a step acts where the contact is in its middle, and what it has to achieve
    counts where the contact is at its end: that makes the step second order.
    """
    bodies, contacts, features = work.bodies, work.contacts, work.features
    for index in range(work.counts[0]):
        point, side = features[index, POINT_BODY], features[index, SIDE_BODY]
        on_corner = features[index, KIND] == ON_CORNER
        nx, ny, a, b, c, d = _place(work, index, point, side, on_corner, 0.5 * step)
        contacts[index, NORMAL_X], contacts[index, NORMAL_Y] = nx, ny
        contacts[index, ARM_POINT], contacts[index, REACH_POINT] = a, b
        contacts[index, ARM_SIDE], contacts[index, REACH_SIDE] = c, d
        lightness = bodies[point, LIGHTNESS] + bodies[side, LIGHTNESS]
        contacts[index, NORMAL_MASS] = 1.0 / (
            lightness + a * a * bodies[point, TURN] + c * c * bodies[side, TURN]
        )
        contacts[index, RIM_MASS] = 1.0 / (
            lightness + b * b * bodies[point, TURN] + d * d * bodies[side, TURN]
        )
        nx, ny, a, b, c, d = _place(work, index, point, side, on_corner, step)
        contacts[index, END_X], contacts[index, END_Y] = nx, ny
        contacts[index, END_ARM_POINT], contacts[index, END_REACH_POINT] = a, b
        contacts[index, END_ARM_SIDE], contacts[index, END_REACH_SIDE] = c, d
        leaving = _leaving(work, index, point, side)
        share = physics.tool_restitution if point == TOOL else physics.disk_restitution
        contacts[index, BIAS] = _bias(contacts[index, GAP], leaving, step, share)


@compiled
def _place(work, index, point, side, on_corner, time):
    """Foresee a contact some time ahead [s].

    Returns:
        Its normal, and of both bodies the arms of a force along it and of one across it [m].
    """
    bodies, contacts = work.bodies, work.contacts
    px, py = _turned(contacts[index, POINT_X], contacts[index, POINT_Y], time * bodies[point, SPIN])
    x = bodies[point, X] - bodies[side, X] + time * (bodies[point, VX] - bodies[side, VX])
    y = bodies[point, Y] - bodies[side, Y] + time * (bodies[point, VY] - bodies[side, VY])
    angle = time * bodies[side, SPIN]
    nx, ny = _turned(contacts[index, FACE_X], contacts[index, FACE_Y], angle)
    cx, cy = _turned(contacts[index, CORNER_AT_X], contacts[index, CORNER_AT_Y], angle)
    dx, dy = x + px - cx, y + py - cy
    distance = np.sqrt(dx * dx + dy * dy)
    if on_corner and distance > SHARPEST:
        nx, ny = dx / distance, dy / distance
    px, py = px - bodies[point, ROUND] * nx, py - bodies[point, ROUND] * ny
    x, y = x + px, y + py
    return nx, ny, px * ny - py * nx, px * nx + py * ny, x * ny - y * nx, x * nx + y * ny


@compiled
def _turned(x, y, angle):
    """Return a vector turned by a small angle [rad]."""
    keep = 1.0 - 0.5 * angle * angle
    return keep * x - angle * y, keep * y + angle * x


@compiled
def _bias(gap, leaving, step, restitution):
    """Return how fast a pair may approach [m/s] in a step, or must leave (< 0) a collision."""
    if step > 0.0:
        return max(gap, 0.0) / step
    return min(restitution * leaving, 0.0) if gap < TOUCHING else np.inf


@compiled
def _leaving(work, index, point, side):
    """Return how fast the bodies of a contact part [m/s]."""
    bodies, contacts = work.bodies, work.contacts
    vx = bodies[point, VX] - bodies[side, VX]
    vy = bodies[point, VY] - bodies[side, VY]
    turning = bodies[point, SPIN] * contacts[index, END_ARM_POINT]
    turning -= bodies[side, SPIN] * contacts[index, END_ARM_SIDE]
    return vx * contacts[index, END_X] + vy * contacts[index, END_Y] + turning


@compiled
def _sliding(work, index, point, side):
    """Return how fast the bodies of a contact slide past each other [m/s]."""
    bodies, contacts = work.bodies, work.contacts
    vx = bodies[point, VX] - bodies[side, VX]
    vy = bodies[point, VY] - bodies[side, VY]
    turning = bodies[point, SPIN] * contacts[index, END_REACH_POINT]
    turning -= bodies[side, SPIN] * contacts[index, END_REACH_SIDE]
    return vy * contacts[index, END_X] - vx * contacts[index, END_Y] + turning


@compiled_apart
def solve_impulses(work, tool_speed):
    """Find the impulses that keep all contacts apart, with Coulomb friction; apply them.

    Bodies with a `grip` are held back by the table meanwhile. `tool_speed` is its highest [m/s].
    """
    contacts = work.contacts
    for index in range(work.counts[0]):
        if contacts[index, ALONG] > 0.0:
            _apply_to_both(work, index, contacts[index, ALONG], contacts[index, ACROSS])
    for _ in range(SWEEPS):
        change = 0.0
        for index in range(work.counts[0]):
            change = max(change, _solve_contact(work, index))
        for row in range(1, work.bodies.shape[0]):
            if work.grip[row] > 0.0:
                change = max(change, hold_back(work, row))
            if work.stuck[row]:
                change = max(change, hold_supports(work, row))
        if change < CONVERGED * tool_speed:
            break
    _note_touched(work)


@compiled
def _note_touched(work):
    """Note which bodies the tool presses on."""
    contacts, features = work.contacts, work.features
    for index in range(work.counts[0]):
        if contacts[index, ALONG] > 0.0 and features[index, POINT_BODY] == TOOL:
            work.touched[features[index, SIDE_BODY]] = True


@compiled
def _solve_contact(work, index):
    """Correct the impulse of one contact; return the change of velocity it made [m/s]."""
    bodies, contacts = work.bodies, work.contacts
    point, side = work.features[index, POINT_BODY], work.features[index, SIDE_BODY]
    excess = _leaving(work, index, point, side) + contacts[index, BIAS]
    normal = max(contacts[index, ALONG] - contacts[index, NORMAL_MASS] * excess, 0.0)
    if point == TOOL:
        limit = normal * bodies[side, TOOL_GRIP]
    else:
        limit = normal * bodies[max(point, side), BODY_GRIP]
    rim = contacts[index, ACROSS] - contacts[index, RIM_MASS] * _sliding(work, index, point, side)
    rim = min(max(rim, -limit), limit)
    along, across = normal - contacts[index, ALONG], rim - contacts[index, ACROSS]
    if along == 0.0 and across == 0.0:
        return 0.0
    contacts[index, ALONG], contacts[index, ACROSS] = normal, rim
    _apply_to_both(work, index, along, across)
    return max(abs(along), abs(across)) / contacts[index, NORMAL_MASS]


@compiled
def _apply_to_both(work, index, along, across):
    """Give both bodies of a contact an impulse along its normal and across it [N s]."""
    bodies, contacts = work.bodies, work.contacts
    point, side = work.features[index, POINT_BODY], work.features[index, SIDE_BODY]
    nx, ny = contacts[index, NORMAL_X], contacts[index, NORMAL_Y]
    px, py = along * nx - across * ny, along * ny + across * nx
    bodies[point, VX] += px * bodies[point, LIGHTNESS]
    bodies[point, VY] += py * bodies[point, LIGHTNESS]
    turn = along * contacts[index, ARM_POINT] + across * contacts[index, REACH_POINT]
    bodies[point, SPIN] += turn * bodies[point, TURN]
    bodies[side, VX] -= px * bodies[side, LIGHTNESS]
    bodies[side, VY] -= py * bodies[side, LIGHTNESS]
    turn = along * contacts[index, ARM_SIDE] + across * contacts[index, REACH_SIDE]
    bodies[side, SPIN] -= turn * bodies[side, TURN]


@compiled
def part_overlaps(work):
    """Move overlapping bodies apart by a share of their overlap, without giving them speed."""
    bodies, contacts, features = work.bodies, work.contacts, work.features
    for index in range(work.counts[0]):
        if contacts[index, GAP] < -TOUCHING:
            point, side = features[index, POINT_BODY], features[index, SIDE_BODY]
            same = 0  # contacts of this pair: each undoes its part
            for other in range(work.counts[0]):
                first, second = features[other, POINT_BODY], features[other, SIDE_BODY]
                pair = (first == point and second == side) or (first == side and second == point)
                same += pair and contacts[other, GAP] < -TOUCHING
            lightness = bodies[point, LIGHTNESS] + bodies[side, LIGHTNESS]
            shift = -PUSH_OUT * (contacts[index, GAP] + TOUCHING) / (lightness * same)
            shift_x, shift_y = shift * contacts[index, NORMAL_X], shift * contacts[index, NORMAL_Y]
            bodies[point, X] += shift_x * bodies[point, LIGHTNESS]
            bodies[point, Y] += shift_y * bodies[point, LIGHTNESS]
            bodies[side, X] -= shift_x * bodies[side, LIGHTNESS]
            bodies[side, Y] -= shift_y * bodies[side, LIGHTNESS]
