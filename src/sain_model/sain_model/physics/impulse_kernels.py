"""Impulses that keep outlines apart, compiled: sequential impulses with Coulomb friction.

Erin Catto, "Iterative dynamics with temporal coherence" (Game Developers Conference 2005):
projected Gauss-Seidel sweeps over the contacts, which begin with the impulses of the last step.
"""

import numpy as np

from sain_model.compute.compiling import compiled
from sain_model.physics.body_kernels import TOOL, forget_change
from sain_model.physics.contact_kernels import ON_CORNER, ON_SIDE
from sain_model.physics.support_kernels import hold_back, hold_supports, of_tool

SWEEPS = 30  # most sweeps over the contacts in one step
CONVERGED = 5e-4  # [speeds of the tool], change of relative velocities in the last sweep
PUSH_OUT = 0.3  # share of an overlap that one step undoes, without giving speed
TOUCHING = 1e-5  # [m], a gap as small as this is none
COLLISION = 0.01  # [m/s], touching bodies that approach faster than this collide
LEAVE = 1e-3  # [s]
LEAST_ANSWER = 0.05  # share of a contact's answer to an impulse that friction leaves of it
SOFT_SHARE = 0.3  # longest step when a soft contact is hit, share of its time constant
SHARPEST = 0.001  # [m], the normal of sharper corners is not followed as they pass each other


@compiled
def foresee(work, horizon, physics):
    """Look at how the listed features move.

    Returns the time until the first of those apart touch [s] (at most the horizon), the fastest
    approach of two that touch already [m/s], and the fastest turning of a normal between two that
    press on each other [rad/s].
    """
    impact, approach, turning, leave = horizon, 0.0, 0.0, horizon
    for index in range(work.counts[0]):
        contact = work.contacts[index]
        point, side = work.bodies[contact.point_body], work.bodies[contact.side_body]
        nx, ny, gap, rounding = contact.face_x, contact.face_y, contact.gap, point.round
        x, y = contact.point_x - rounding * nx, contact.point_y - rounding * ny
        from_x, from_y = point.x + x - side.x, point.y + y - side.y
        vx = point.vx - point.spin * y - (side.vx - side.spin * from_y)
        vy = point.vy + point.spin * x - (side.vy + side.spin * from_x)
        closing = -(vx * nx + vy * ny)
        if gap < TOUCHING:
            softness = _softness(contact, physics)
            if softness == 0.0:
                approach = max(approach, closing)
            elif closing > COLLISION:  # it does not collide, but gives
                mass = 1.0 / (point.lightness + side.lightness)
                leave = min(leave, SOFT_SHARE * np.sqrt(softness * mass))
            if contact.along > 0.0:
                turning = max(turning, abs(side.spin))
                if contact.kind == ON_SIDE:
                    cx = vx - rounding * (point.spin - side.spin) * ny
                    cy = vy + rounding * (point.spin - side.spin) * nx
                    along = cy * nx - cx * ny
                    room = contact.left if along > 0.0 else contact.past
                    if abs(along) * leave > room >= 0.0:
                        leave = max(room / abs(along), LEAVE)
                if contact.kind == ON_CORNER:
                    rolling = abs(vy * nx - vx * ny)
                    round_both = gap + rounding + side.round
                    turning = max(turning, rolling / max(round_both, SHARPEST))
        elif closing * impact > gap:
            impact = gap / closing
    return min(impact, leave), approach, turning


@compiled
def prepare_impulses(work, step, physics):
    """Set up the contacts for a step [s], or for a collision when the step is 0.

    The impulse of a step acts where the contact is in its middle, and what it has to achieve
    counts where the contact is at its end: that makes the step second order. The former is found
    when a contact is first pressed: most that are only near never are.
    """
    for index in range(work.counts[0]):
        contact = work.contacts[index]
        point, side = work.bodies[contact.point_body], work.bodies[contact.side_body]
        contact.going_x, contact.going_y = point.vx - side.vx, point.vy - side.vy
        contact.point_spin, contact.side_spin = point.spin, side.spin
        nx, ny, a, b, c, d = _place(contact, point, side, step)
        contact.end_x, contact.end_y = nx, ny
        contact.end_arm_point, contact.end_reach_point = a, b
        contact.end_arm_side, contact.end_reach_side = c, d
        contact.middle, contact.ready = 0.5 * step, False
        share = physics.tool_restitution if of_tool(contact) else physics.disk_restitution
        contact.bias = _bias(contact.gap, _leaving(contact, point, side), step, share)
        contact.give, contact.relaxes = 0.0, 1.0
        softness = _softness(contact, physics)
        if softness > 0.0 or contact.along > 0.0 or contact.gap < TOUCHING:
            _make_ready(contact, point, side)
        if softness > 0.0:
            _soften(contact, softness, step)
            _prepare_laws(contact, point, side)


@compiled
def _make_ready(contact, point, side):
    """Note how a contact answers to impulses in the middle of the step."""
    nx, ny, a, b, c, d = _place(contact, point, side, contact.middle)
    contact.normal_x, contact.normal_y = nx, ny
    contact.arm_point, contact.reach_point = a, b
    contact.arm_side, contact.reach_side = c, d
    _prepare_responses(contact, point, side)
    _prepare_laws(contact, point, side)
    contact.ready = True


@compiled
def _prepare_responses(contact, point, side):
    """Note how a contact's velocities at the end of a step answer to its impulses in the middle."""
    nx, ny = contact.normal_x, contact.normal_y
    end_x, end_y = contact.end_x, contact.end_y
    along_along, along_across, across_along, across_across = 0.0, 0.0, 0.0, 0.0
    for each in range(2):
        body = side if each == 1 else point
        if body.lightness == 0.0:
            continue
        if each == 1:
            arm, reach = contact.arm_side, contact.reach_side
            end_arm, end_reach = contact.end_arm_side, contact.end_reach_side
        else:
            arm, reach = contact.arm_point, contact.reach_point
            end_arm, end_reach = contact.end_arm_point, contact.end_reach_point
        if body.creeps:
            vx, vy, spin = _moved(body, nx, ny, arm)
            along_along += vx * end_x + vy * end_y + spin * end_arm
            across_along += vy * end_x - vx * end_y + spin * end_reach
            vx, vy, spin = _moved(body, -ny, nx, reach)
            along_across += vx * end_x + vy * end_y + spin * end_arm
            across_across += vy * end_x - vx * end_y + spin * end_reach
            continue
        lightness, turn = body.lightness, body.turn
        same, other = lightness * (nx * end_x + ny * end_y), lightness * (nx * end_y - ny * end_x)
        along_along += same + turn * arm * end_arm
        along_across += other + turn * reach * end_arm
        across_along += turn * arm * end_reach - other
        across_across += same + turn * reach * end_reach
    contact.along_along, contact.along_across = along_along, along_across
    contact.across_along, contact.across_across = across_along, across_across


@compiled
def _prepare_laws(contact, point, side):
    """Note by what a contact's impulses follow from its velocities: sticking, and slipping."""
    if of_tool(contact):
        grip = max(point.tool_grip, side.tool_grip)  # the tool itself has none
    else:
        grip = (side if contact.side_body > contact.point_body else point).body_grip
    along_along, along_across = contact.along_along, contact.along_across
    contact.grip = grip
    least = LEAST_ANSWER * along_along
    contact.stick = 1.0 / (
        along_along * contact.across_across - along_across * contact.across_along
    )
    contact.slip_left = 1.0 / max(along_along + grip * along_across, least)
    contact.slip_right = 1.0 / max(along_along - grip * along_across, least)


@compiled
def _moved(body, x, y, turn):
    """Return the velocity that an impulse (x, y) [N s] with a moment gives a body."""
    if not body.creeps:
        return body.lightness * x, body.lightness * y, body.turn * turn
    return (
        body.move_xx * x + body.move_xy * y + body.move_xs * turn,
        body.move_xy * x + body.move_yy * y + body.move_ys * turn,
        body.move_xs * x + body.move_ys * y + body.move_ss * turn,
    )


@compiled
def _softness(contact, physics):
    """Return the compliance [m/N] of a contact."""
    return physics.tool_compliance if of_tool(contact) else physics.body_compliance


@compiled
def _soften(contact, softness, step):
    """Let a contact give: a spring and a damper, critical for the masses that it lies between.

    At the end of a step h it is pressed in by d = (s f + a d_0) / (1 + a), where f is the force,
    s the softness, d_0 what it was pressed in by, and a = 2 sqrt(s m) / h. This is implicit, so it
    is stable for any step. As s goes to 0, so do d and all terms that it adds.
    """
    if step == 0.0:  # it takes no part in collisions of others
        contact.bias = np.inf
        return
    damping = 2.0 * np.sqrt(softness / contact.along_along) / step
    relaxes, pressed = 1.0 / (1.0 + damping), contact.pressed
    contact.bias = (max(contact.gap + pressed, 0.0) - relaxes * pressed) / step
    contact.give = softness * relaxes / (step * step)
    contact.relaxes = relaxes
    contact.along_along += contact.give


@compiled
def press_in(work, step):
    """Note how far contacts are pressed in [m] after a step [s].

    While they are pressed in fast, the next step is not foreseen from this one.
    """
    for index in range(work.counts[0]):
        contact = work.contacts[index]
        pressed = step * contact.give * contact.along
        pressed += (1.0 - contact.relaxes) * contact.pressed
        if abs(pressed - contact.pressed) > COLLISION * step:
            forget_change(work.bodies[contact.point_body])
            forget_change(work.bodies[contact.side_body])
        contact.pressed = pressed


@compiled
def _place(contact, point, side, time):
    """Foresee a contact some time ahead [s] of when it was prepared.

    Returns its normal, and of both bodies the arms of a force along it and of one across it [m].
    """
    px, py = _turned(contact.point_x, contact.point_y, time * contact.point_spin)
    x = point.x - side.x + time * contact.going_x
    y = point.y - side.y + time * contact.going_y
    angle = time * contact.side_spin
    nx, ny = _turned(contact.face_x, contact.face_y, angle)
    cx, cy = _turned(contact.corner_at_x, contact.corner_at_y, angle)
    dx, dy = x + px - cx, y + py - cy
    distance = np.sqrt(dx * dx + dy * dy)
    if contact.kind == ON_CORNER and distance > SHARPEST:
        nx, ny = dx / distance, dy / distance
    px, py = px - point.round * nx, py - point.round * ny
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
def _leaving(contact, point, side):
    """Return how fast the bodies of a contact part [m/s]."""
    vx, vy = point.vx - side.vx, point.vy - side.vy
    turning = point.spin * contact.end_arm_point - side.spin * contact.end_arm_side
    return vx * contact.end_x + vy * contact.end_y + turning


@compiled
def _sliding(contact, point, side):
    """Return how fast the bodies of a contact slide past each other [m/s]."""
    vx, vy = point.vx - side.vx, point.vy - side.vy
    turning = point.spin * contact.end_reach_point - side.spin * contact.end_reach_side
    return vy * contact.end_x - vx * contact.end_y + turning


@compiled
def solve_impulses(work, tool_speed):
    """Find the impulses that keep all contacts apart, with Coulomb friction; apply them.

    Bodies with a `grip` are held back by the table meanwhile. `tool_speed` is its highest [m/s].
    """
    for index in range(work.counts[0]):
        contact = work.contacts[index]
        if contact.along > 0.0:
            point, side = work.bodies[contact.point_body], work.bodies[contact.side_body]
            _apply_to_both(contact, point, side, contact.along, contact.across)
    for _ in range(SWEEPS):
        first, others = 0.0, 0.0
        for index in range(work.counts[0]):
            change = _solve_contact(work, work.contacts[index])
            if index == 0:
                first = change
            else:
                others = max(others, change)
        for row in range(1, work.bodies.shape[0]):
            if work.bodies[row].grip > 0.0:
                others = max(others, hold_back(work.bodies[row]))
            if work.bodies[row].stuck:
                others = max(others, hold_supports(work, row))
        # Where all others saw what the first contact did and stayed, another sweep changes nothing.
        if others == 0.0 or max(first, others) < CONVERGED * tool_speed:
            break


@compiled
def _solve_contact(work, contact):
    """Solve one contact as if it were alone; return the change of velocity that this made [m/s].

    It sticks if Coulomb's law allows that. If not, it slips against the friction.
    """
    point, side = work.bodies[contact.point_body], work.bodies[contact.side_body]
    excess = _leaving(contact, point, side) + contact.bias
    if not contact.ready:
        if excess >= 0.0:
            return 0.0
        _make_ready(contact, point, side)
    along_along, along_across = contact.along_along, contact.along_across
    across_along, across_across = contact.across_along, contact.across_across
    before, rim_before = contact.along, contact.across
    excess += contact.give * before - along_along * before - along_across * rim_before
    along, across = 0.0, 0.0
    if excess < 0.0:
        sliding = _sliding(contact, point, side)
        sliding -= across_along * before + across_across * rim_before
        stick, grip = contact.stick, contact.grip
        along = stick * (along_across * sliding - across_across * excess)
        across = stick * (across_along * excess - along_along * sliding)
        if abs(across) > grip * along:
            if sliding * along_along > across_along * excess:  # so it would without any friction
                along = -excess * contact.slip_right
                across = -grip * along
            else:
                along = -excess * contact.slip_left
                across = grip * along
    contact.along, contact.across = along, across
    along, across = along - before, across - rim_before
    if along == 0.0 and across == 0.0:
        return 0.0
    _apply_to_both(contact, point, side, along, across)
    return max(abs(along) * along_along, abs(across) * across_across)


@compiled
def _apply_to_both(contact, point, side, along, across):
    """Give both bodies of a contact an impulse along its normal and across it [N s]."""
    nx, ny = contact.normal_x, contact.normal_y
    px, py = along * nx - across * ny, along * ny + across * nx
    if contact.point_body != TOOL:
        _give(point, px, py, along * contact.arm_point + across * contact.reach_point)
    _give(side, -px, -py, -(along * contact.arm_side + across * contact.reach_side))


@compiled
def _give(body, x, y, turn):
    """Give a body an impulse (x, y) [N s] with a moment [N m s]."""
    vx, vy, spin = _moved(body, x, y, turn)
    body.vx += vx
    body.vy += vy
    body.spin += spin


@compiled
def part_overlaps(work):
    """Move overlapping bodies apart by a share of their overlap, without giving them speed.

    Where a contact gives, it is no overlap.
    """
    for index in range(work.counts[0]):
        contact = work.contacts[index]
        gap = contact.gap + contact.pressed
        if gap < -TOUCHING:
            same = 0  # contacts of this pair: each undoes its part
            for other in range(work.counts[0]):
                another = work.contacts[other]
                overlaps = another.gap + another.pressed < -TOUCHING
                same += overlaps and another.pair == contact.pair
            point, side = work.bodies[contact.point_body], work.bodies[contact.side_body]
            shift = -PUSH_OUT * (gap + TOUCHING) / ((point.lightness + side.lightness) * same)
            shift_x, shift_y = shift * contact.normal_x, shift * contact.normal_y
            point.x += shift_x * point.lightness
            point.y += shift_y * point.lightness
            side.x -= shift_x * side.lightness
            side.y -= shift_y * side.lightness
