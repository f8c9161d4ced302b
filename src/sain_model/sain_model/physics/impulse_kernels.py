"""Impulses that keep outlines apart, compiled: sequential impulses with Coulomb friction.

Erin Catto, "Iterative dynamics with temporal coherence" (Game Developers Conference 2005):
projected Gauss-Seidel sweeps over the contacts, which begin with the impulses of the last step.
"""

import numpy as np

from sain_model.compute.compiling import compiled, compiled_apart
from sain_model.physics.body_kernels import TOOL, forget_change
from sain_model.physics.contact_kernels import ON_CORNER, ON_SIDE
from sain_model.physics.support_kernels import hold_back, hold_supports

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

    Returns:
        The time until the first of those apart touch [s] (at most the horizon), the fastest
        approach of two that touch already [m/s], and the fastest turning of a normal between two
        that press on each other [rad/s].
    """
    bodies, contacts = work.bodies, work.contacts
    impact, approach, turning, leave = horizon, 0.0, 0.0, horizon
    for index in range(work.counts[0]):
        point, side = contacts[index].point_body, contacts[index].side_body
        nx, ny, gap = contacts[index].face_x, contacts[index].face_y, contacts[index].gap
        rounding = bodies[point].round
        x, y = contacts[index].point_x - rounding * nx, contacts[index].point_y - rounding * ny
        from_x = bodies[point].x + x - bodies[side].x
        from_y = bodies[point].y + y - bodies[side].y
        vx = bodies[point].vx - bodies[point].spin * y
        vy = bodies[point].vy + bodies[point].spin * x
        vx -= bodies[side].vx - bodies[side].spin * from_y
        vy -= bodies[side].vy + bodies[side].spin * from_x
        closing = -(vx * nx + vy * ny)
        if gap < TOUCHING:
            softness = _softness(point, physics)
            if softness == 0.0:
                approach = max(approach, closing)
            elif closing > COLLISION:  # it does not collide, but gives
                mass = 1.0 / (bodies[point].lightness + bodies[side].lightness)
                leave = min(leave, SOFT_SHARE * np.sqrt(softness * mass))
            if contacts[index].along > 0.0:
                turning = max(turning, abs(bodies[side].spin))
                if contacts[index].kind == ON_SIDE:
                    cx = vx - rounding * (bodies[point].spin - bodies[side].spin) * ny
                    cy = vy + rounding * (bodies[point].spin - bodies[side].spin) * nx
                    along = cy * nx - cx * ny
                    room = contacts[index].left if along > 0.0 else contacts[index].past
                    if abs(along) * leave > room >= 0.0:
                        leave = max(room / abs(along), LEAVE)
                if contacts[index].kind == ON_CORNER:
                    rolling = abs(vy * nx - vx * ny)
                    round_both = gap + rounding + bodies[side].round
                    turning = max(turning, rolling / max(round_both, SHARPEST))
        elif closing * impact > gap:
            impact = gap / closing
    return min(impact, leave), approach, turning


@compiled
def prepare_impulses(work, step, physics):
    """Set up the contacts for a step [s], or for a collision when the step is 0.

    The impulse of a step acts where the contact is in its middle, and what it has to achieve
    counts where the contact is at its end: that makes the step second order.
    """
    contacts = work.contacts
    for index in range(work.counts[0]):
        point, side = contacts[index].point_body, contacts[index].side_body
        on_corner = contacts[index].kind == ON_CORNER
        nx, ny, a, b, c, d = _place(work, index, point, side, on_corner, 0.5 * step)
        contacts[index].normal_x, contacts[index].normal_y = nx, ny
        contacts[index].arm_point, contacts[index].reach_point = a, b
        contacts[index].arm_side, contacts[index].reach_side = c, d
        nx, ny, a, b, c, d = _place(work, index, point, side, on_corner, step)
        contacts[index].end_x, contacts[index].end_y = nx, ny
        contacts[index].end_arm_point, contacts[index].end_reach_point = a, b
        contacts[index].end_arm_side, contacts[index].end_reach_side = c, d
        _prepare_responses(work, index, point, side)
        leaving = _leaving(work, index, point, side)
        share = physics.tool_restitution if point == TOOL else physics.disk_restitution
        contacts[index].bias = _bias(contacts[index].gap, leaving, step, share)
        contacts[index].give, contacts[index].relaxes = 0.0, 1.0
        softness = _softness(point, physics)
        if softness > 0.0:
            _soften(contacts, index, softness, step)
        _prepare_laws(work, index, point, side)


@compiled
def _prepare_responses(work, index, point, side):
    """Note how a contact's velocities at the end of a step answer to its impulses in the middle."""
    contacts = work.contacts
    nx, ny = contacts[index].normal_x, contacts[index].normal_y
    end_x, end_y = contacts[index].end_x, contacts[index].end_y
    along_along, along_across, across_along, across_across = 0.0, 0.0, 0.0, 0.0
    for each in range(2):
        row = side if each == 1 else point
        if work.bodies[row].lightness == 0.0:
            continue
        if each == 1:
            arm, reach = contacts[index].arm_side, contacts[index].reach_side
            end_arm, end_reach = contacts[index].end_arm_side, contacts[index].end_reach_side
        else:
            arm, reach = contacts[index].arm_point, contacts[index].reach_point
            end_arm, end_reach = contacts[index].end_arm_point, contacts[index].end_reach_point
        if work.bodies[row].creeps:
            vx, vy, spin = _moved(work.bodies, row, nx, ny, arm)
            along_along += vx * end_x + vy * end_y + spin * end_arm
            across_along += vy * end_x - vx * end_y + spin * end_reach
            vx, vy, spin = _moved(work.bodies, row, -ny, nx, reach)
            along_across += vx * end_x + vy * end_y + spin * end_arm
            across_across += vy * end_x - vx * end_y + spin * end_reach
            continue
        lightness, turn = work.bodies[row].lightness, work.bodies[row].turn
        same, other = lightness * (nx * end_x + ny * end_y), lightness * (nx * end_y - ny * end_x)
        along_along += same + turn * arm * end_arm
        along_across += other + turn * reach * end_arm
        across_along += turn * arm * end_reach - other
        across_across += same + turn * reach * end_reach
    contacts[index].along_along, contacts[index].along_across = along_along, along_across
    contacts[index].across_along, contacts[index].across_across = across_along, across_across


@compiled
def _prepare_laws(work, index, point, side):
    """Note by what a contact's impulses follow from its velocities: sticking, and slipping."""
    bodies, contacts = work.bodies, work.contacts
    if point == TOOL:
        grip = bodies[side].tool_grip
    else:
        grip = bodies[max(point, side)].body_grip
    along_along, along_across = contacts[index].along_along, contacts[index].along_across
    contacts[index].grip = grip
    least = LEAST_ANSWER * along_along
    contacts[index].stick = 1.0 / (
        along_along * contacts[index].across_across - along_across * contacts[index].across_along
    )
    contacts[index].slip_left = 1.0 / max(along_along + grip * along_across, least)
    contacts[index].slip_right = 1.0 / max(along_along - grip * along_across, least)


@compiled
def _moved(bodies, row, x, y, turn):
    """Return the velocity that an impulse (x, y) [N s] with a moment gives a body."""
    if not bodies[row].creeps:
        lightness = bodies[row].lightness
        return lightness * x, lightness * y, bodies[row].turn * turn
    return (
        bodies[row].move_xx * x + bodies[row].move_xy * y + bodies[row].move_xs * turn,
        bodies[row].move_xy * x + bodies[row].move_yy * y + bodies[row].move_ys * turn,
        bodies[row].move_xs * x + bodies[row].move_ys * y + bodies[row].move_ss * turn,
    )


@compiled
def _softness(point, physics):
    """Return the compliance [m/N] of a contact whose point is of this body."""
    return physics.tool_compliance if point == TOOL else physics.body_compliance


@compiled
def _soften(contacts, index, softness, step):
    """Let a contact give: a spring and a damper, critical for the masses that it lies between.

    At the end of a step h it is pressed in by d = (s f + a d_0) / (1 + a), where f is the force,
    s the softness, d_0 what it was pressed in by, and a = 2 sqrt(s m) / h. This is implicit, so it
    is stable for any step. As s goes to 0, so do d and all terms that it adds.
    """
    if step == 0.0:  # it takes no part in collisions of others
        contacts[index].bias = np.inf
        return
    damping = 2.0 * np.sqrt(softness / contacts[index].along_along) / step
    relaxes, pressed = 1.0 / (1.0 + damping), contacts[index].pressed
    gap = contacts[index].gap + pressed
    contacts[index].bias = (max(gap, 0.0) - relaxes * pressed) / step
    contacts[index].give = softness * relaxes / (step * step)
    contacts[index].relaxes = relaxes
    contacts[index].along_along += contacts[index].give


@compiled
def press_in(work, step):
    """Note how far contacts are pressed in [m] after a step [s].

    While they are pressed in fast, the next step is not foreseen from this one.
    """
    bodies, contacts = work.bodies, work.contacts
    for index in range(work.counts[0]):
        by_force = step * contacts[index].give * contacts[index].along
        rest = (1.0 - contacts[index].relaxes) * contacts[index].pressed
        if abs(by_force + rest - contacts[index].pressed) > COLLISION * step:
            forget_change(bodies, contacts[index].point_body)
            forget_change(bodies, contacts[index].side_body)
        contacts[index].pressed = by_force + rest


@compiled
def _place(work, index, point, side, on_corner, time):
    """Foresee a contact some time ahead [s].

    Returns:
        Its normal, and of both bodies the arms of a force along it and of one across it [m].
    """
    bodies, contacts = work.bodies, work.contacts
    px, py = _turned(contacts[index].point_x, contacts[index].point_y, time * bodies[point].spin)
    x = bodies[point].x - bodies[side].x + time * (bodies[point].vx - bodies[side].vx)
    y = bodies[point].y - bodies[side].y + time * (bodies[point].vy - bodies[side].vy)
    angle = time * bodies[side].spin
    nx, ny = _turned(contacts[index].face_x, contacts[index].face_y, angle)
    cx, cy = _turned(contacts[index].corner_at_x, contacts[index].corner_at_y, angle)
    dx, dy = x + px - cx, y + py - cy
    distance = np.sqrt(dx * dx + dy * dy)
    if on_corner and distance > SHARPEST:
        nx, ny = dx / distance, dy / distance
    px, py = px - bodies[point].round * nx, py - bodies[point].round * ny
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
    vx = bodies[point].vx - bodies[side].vx
    vy = bodies[point].vy - bodies[side].vy
    turning = bodies[point].spin * contacts[index].end_arm_point
    turning -= bodies[side].spin * contacts[index].end_arm_side
    return vx * contacts[index].end_x + vy * contacts[index].end_y + turning


@compiled
def _sliding(work, index, point, side):
    """Return how fast the bodies of a contact slide past each other [m/s]."""
    bodies, contacts = work.bodies, work.contacts
    vx = bodies[point].vx - bodies[side].vx
    vy = bodies[point].vy - bodies[side].vy
    turning = bodies[point].spin * contacts[index].end_reach_point
    turning -= bodies[side].spin * contacts[index].end_reach_side
    return vy * contacts[index].end_x - vx * contacts[index].end_y + turning


@compiled_apart
def solve_impulses(work, tool_speed):
    """Find the impulses that keep all contacts apart, with Coulomb friction; apply them.

    Bodies with a `grip` are held back by the table meanwhile. `tool_speed` is its highest [m/s].
    """
    contacts = work.contacts
    for index in range(work.counts[0]):
        if contacts[index].along > 0.0:
            _apply_to_both(work, index, contacts[index].along, contacts[index].across)
    for _ in range(SWEEPS):
        change, alone = 0.0, work.counts[0] == 1
        for index in range(work.counts[0]):
            change = max(change, _solve_contact(work, index))
        for row in range(1, work.bodies.shape[0]):
            if work.bodies[row].grip > 0.0:
                change, alone = max(change, hold_back(work, row)), False
            if work.bodies[row].stuck:
                change, alone = max(change, hold_supports(work, row)), False
        if alone or change < CONVERGED * tool_speed:
            break
    _note_touched(work)


@compiled
def _note_touched(work):
    """Note which bodies the tool presses on."""
    contacts = work.contacts
    for index in range(work.counts[0]):
        if contacts[index].along > 0.0 and contacts[index].point_body == TOOL:
            work.bodies[contacts[index].side_body].touched = True


@compiled
def _solve_contact(work, index):
    """Solve one contact as if it were alone; return the change of velocity that this made [m/s].

    It sticks if Coulomb's law allows that. If not, it slips against the friction.
    """
    contacts = work.contacts
    point, side = work.contacts[index].point_body, work.contacts[index].side_body
    along_along, along_across = contacts[index].along_along, contacts[index].along_across
    across_along, across_across = contacts[index].across_along, contacts[index].across_across
    before, rim_before = contacts[index].along, contacts[index].across
    excess = _leaving(work, index, point, side) + contacts[index].bias
    excess += contacts[index].give * before - along_along * before - along_across * rim_before
    sliding = _sliding(work, index, point, side)
    sliding -= across_along * before + across_across * rim_before
    along, across = 0.0, 0.0
    if excess < 0.0:
        stick, grip = contacts[index].stick, contacts[index].grip
        along = stick * (along_across * sliding - across_across * excess)
        across = stick * (across_along * excess - along_along * sliding)
        if abs(across) > grip * along:
            if sliding * along_along > across_along * excess:  # so it would without any friction
                along = -excess * contacts[index].slip_right
                across = -grip * along
            else:
                along = -excess * contacts[index].slip_left
                across = grip * along
    contacts[index].along, contacts[index].across = along, across
    along, across = along - before, across - rim_before
    if along == 0.0 and across == 0.0:
        return 0.0
    _apply_to_both(work, index, along, across)
    return max(abs(along) * along_along, abs(across) * across_across)


@compiled
def _apply_to_both(work, index, along, across):
    """Give both bodies of a contact an impulse along its normal and across it [N s]."""
    bodies, contacts = work.bodies, work.contacts
    point, side = work.contacts[index].point_body, work.contacts[index].side_body
    nx, ny = contacts[index].normal_x, contacts[index].normal_y
    px, py = along * nx - across * ny, along * ny + across * nx
    if point != TOOL:
        turn = along * contacts[index].arm_point + across * contacts[index].reach_point
        _give(bodies, point, px, py, turn)
    turn = along * contacts[index].arm_side + across * contacts[index].reach_side
    _give(bodies, side, -px, -py, -turn)


@compiled
def _give(bodies, row, x, y, turn):
    """Give a body an impulse (x, y) [N s] with a moment [N m s]."""
    vx, vy, spin = _moved(bodies, row, x, y, turn)
    bodies[row].vx += vx
    bodies[row].vy += vy
    bodies[row].spin += spin


@compiled
def part_overlaps(work):
    """Move overlapping bodies apart by a share of their overlap, without giving them speed.

    Where a contact gives, it is no overlap.
    """
    bodies, contacts = work.bodies, work.contacts
    for index in range(work.counts[0]):
        gap = contacts[index].gap + contacts[index].pressed
        if gap < -TOUCHING:
            point, side = contacts[index].point_body, contacts[index].side_body
            same = 0  # contacts of this pair: each undoes its part
            for other in range(work.counts[0]):
                first, second = contacts[other].point_body, contacts[other].side_body
                pair = (first == point and second == side) or (first == side and second == point)
                same += pair and contacts[other].gap + contacts[other].pressed < -TOUCHING
            lightness = bodies[point].lightness + bodies[side].lightness
            shift = -PUSH_OUT * (gap + TOUCHING) / (lightness * same)
            shift_x, shift_y = shift * contacts[index].normal_x, shift * contacts[index].normal_y
            bodies[point].x += shift_x * bodies[point].lightness
            bodies[point].y += shift_y * bodies[point].lightness
            bodies[side].x -= shift_x * bodies[side].lightness
            bodies[side].y -= shift_y * bodies[side].lightness
