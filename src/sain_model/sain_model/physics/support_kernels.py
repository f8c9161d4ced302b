"""Friction between bodies and table, compiled: Coulomb's law at each support."""

import numpy as np

from sain_model.compute.compiling import compiled, compiled_apart
from sain_model.physics.body_kernels import (
    ACROSS,
    ALONG,
    ARM_X,
    ARM_Y,
    COS,
    FOOT_X,
    FOOT_Y,
    HELD_X,
    HELD_Y,
    LEAN_X,
    LEAN_Y,
    LIGHTNESS,
    LIMIT,
    NORMAL_X,
    NORMAL_Y,
    POINT_BODY,
    PULL_X,
    PULL_Y,
    REACH,
    SHARE,
    SIDE_BODY,
    SIN,
    SPIN,
    TOOL,
    TURN,
    TWIST,
    VX,
    VY,
    YIELD,
)

NEWTON_STEPS = 20  # most of them; three or four are usual
ON_SURFACE = 1e-9  # share by which friction may exceed the limit
SLOW = 1.0  # a support is slow that friction could stop in this many steps under a whole load


@compiled_apart
def brake(work, row, slowing, physics, step):
    """Slow a sliding body down by the friction of one step.

    The direction is taken at the velocity expected in the middle of the step, from the change
    in the last one; that makes the step second order.

    Args:
        work: scratch memory.
        row: of the body.
        slowing: what friction takes from a support in this step, under the whole load [m/s].
        physics: for the heights at which forces act.
        step: duration [s].
    """
    bodies, change, tilt = work.bodies, work.change, work.tilt
    vx = bodies[row, VX] + 0.5 * step * change[row, 0]
    vy = bodies[row, VY] + 0.5 * step * change[row, 1]
    spin = bodies[row, SPIN] + 0.5 * step * change[row, 2]
    # What slides straight on evenly loaded supports goes on straight, to the last bit.
    straight = spin == 0.0 and tilt[row, 0] == 0.0 and tilt[row, 1] == 0.0
    turns = 0.0 if straight else 1.0
    x, y = _pull_back(work, row, vx, vy, spin, slowing, turns, physics)
    # Braking acts below the centre of mass, a push mostly above: both load what is in front.
    arm = physics.middle_height / (physics.gravity * step)
    _slow_down(work, row, arm * x + tilt[row, 0], arm * y + tilt[row, 1], slowing, turns)


@compiled
def _pull_back(work, row, vx, vy, spin, slowing, turns, physics):
    """Write what friction takes from each support under a whole load; return its mean [m/s]."""
    supports, bodies = work.supports, work.bodies
    cos, sin = bodies[row, COS], bodies[row, SIN]
    mean_x, mean_y = 0.0, 0.0
    axes_yield = turns * physics.axes_yield
    across_yield = turns * (1.0 / physics.yield_across - 1.0)
    for foot in range(work.first_support[row], work.first_support[row + 1]):
        arm_x = cos * supports[foot, FOOT_X] - sin * supports[foot, FOOT_Y]
        arm_y = sin * supports[foot, FOOT_X] + cos * supports[foot, FOOT_Y]
        supports[foot, ARM_X], supports[foot, ARM_Y] = arm_x, arm_y
        x, y = vx - spin * arm_y, vy + spin * arm_x
        supports[foot, LIMIT] = x * x + y * y < (SLOW * slowing) ** 2
        squared = arm_x * arm_x + arm_y * arm_y
        if squared > 0.0:
            # A solver gives way to where a support is lighter to move: across its arm.
            if axes_yield > 0.0:
                light = axes_yield * supports[foot, YIELD] / squared
                x /= 1.0 + light * arm_y * arm_y
                y /= 1.0 + light * arm_x * arm_x
            if across_yield > 0.0:
                light = across_yield * supports[foot, YIELD]
                less = light / (1.0 + light) * (arm_x * y - arm_y * x) / squared
                x, y = x + less * arm_y, y - less * arm_x
        # Friction never turns a support back: below `slowing` it falls linearly.
        share = slowing / max(np.sqrt(x * x + y * y), slowing)
        supports[foot, PULL_X], supports[foot, PULL_Y] = share * x, share * y
        mean_x += supports[foot, SHARE] * share * x
        mean_y += supports[foot, SHARE] * share * y
    return mean_x, mean_y


@compiled
def _slow_down(work, row, shift_x, shift_y, slowing, turns):
    """Take from a body what its supports have found, loaded as its weight acts at a shift [m]."""
    supports, bodies = work.supports, work.bodies
    first, last = work.first_support[row], work.first_support[row + 1]
    cos, sin = bodies[row, COS], bodies[row, SIN]
    fore, left = cos * shift_x + sin * shift_y, cos * shift_y - sin * shift_x
    lean = 1.0  # share of the shift at which the first support lifts off
    for foot in range(first, last):
        grows = supports[foot, LEAN_X] * fore + supports[foot, LEAN_Y] * left
        if supports[foot, SHARE] + lean * grows < 0.0:
            lean = -supports[foot, SHARE] / grows
    total_x, total_y, across = 0.0, 0.0, 0.0
    for foot in range(first, last):
        grows = supports[foot, LEAN_X] * fore + supports[foot, LEAN_Y] * left
        load = supports[foot, SHARE] + lean * grows
        if supports[foot, LIMIT] == 0.0:
            x, y = load * supports[foot, PULL_X], load * supports[foot, PULL_Y]
            total_x += x
            total_y += y
            across += supports[foot, ARM_X] * y - supports[foot, ARM_Y] * x
        else:
            work.stuck[row] = True
            supports[foot, LIMIT] = load * slowing
            supports[foot, HELD_X] = supports[foot, HELD_Y] = 0.0
    bodies[row, VX] -= total_x
    bodies[row, VY] -= total_y
    bodies[row, SPIN] -= turns * across * bodies[row, TURN] / bodies[row, LIGHTNESS]


@compiled
def hold_supports(work, row):
    """Let the table hold slow supports of a body back, each by Coulomb's law."""
    supports, bodies = work.supports, work.bodies
    turn = bodies[row, TURN] / bodies[row, LIGHTNESS]
    change = 0.0
    for foot in range(work.first_support[row], work.first_support[row + 1]):
        limit = supports[foot, LIMIT]
        if limit > 0.0:
            arm_x, arm_y = supports[foot, ARM_X], supports[foot, ARM_Y]
            x = bodies[row, VX] - bodies[row, SPIN] * arm_y
            y = bodies[row, VY] + bodies[row, SPIN] * arm_x
            # Across its arm a support is lighter to move than along it.
            less = turn * (arm_x * y - arm_y * x) / (1.0 + turn * (arm_x**2 + arm_y**2))
            x, y = x + less * arm_y, y - less * arm_x
            x, y = supports[foot, HELD_X] - x, supports[foot, HELD_Y] - y
            size = np.sqrt(x * x + y * y)
            if size > limit:
                x, y = x * limit / size, y * limit / size
            dx, dy = x - supports[foot, HELD_X], y - supports[foot, HELD_Y]
            supports[foot, HELD_X], supports[foot, HELD_Y] = x, y
            bodies[row, VX] += dx
            bodies[row, VY] += dy
            bodies[row, SPIN] += turn * (arm_x * dy - arm_y * dx)
            change = max(change, abs(dx), abs(dy))
    return change


@compiled
def slide_on(slide, turn, grip, ratio):
    """Return how a body goes on that the table cannot hold: along its limit surface's normal.

    Friction takes h from the velocity u so that h lies on the ellipsoid h_xy^2 + (h_w / t)^2 =
    grip^2, and what is left of u is along the ellipsoid's normal at h (the principle of maximal
    dissipation): h_xy = -u_xy / (1 + m), h_w = -u_w / (1 + ratio m). The m > 0 for which h lies on
    the ellipsoid is found by Newton's method on 1 / |h|, which is almost linear in m: it
    converges from m = 0 without overshooting (More and Sorensen, "Computing a trust region step",
    SIAM J. Sci. Stat. Comput. 4, 1983).

    Args:
        slide: |u_xy| [m/s].
        turn: |u_w| / t [m/s].
        grip: [m/s], less than what both are together.
        ratio: moment of inertia over mass x torsion length^2.

    Returns:
        m.
    """
    more = 0.0
    for _ in range(NEWTON_STEPS):
        straight, spun = 1.0 / (1.0 + more), 1.0 / (1.0 + ratio * more)
        first, second = (slide * straight) ** 2, (turn * spun) ** 2
        squared = first + second
        excess = np.sqrt(squared) / grip - 1.0
        if excess < ON_SURFACE:
            break
        more += squared * excess / (first * straight + ratio * second * spun)
    return more


@compiled
def hold_back(work, row):
    """Let the table hold a slow body back as far as friction can, against what pushes it.

    Sticking and creeping cannot be told from the velocity before the step: this is solved along
    with the contacts, with an ellipsoid as limit surface (Goyal, Ruina and Papadopoulos, "Planar
    sliding with dry friction", Wear 143, 1991; the ellipsoid is Howe and Cutkosky's).

    Returns:
        The change of velocity that this made [m/s].
    """
    bodies, held, grip = work.bodies, work.held, work.grip[row]
    twist = bodies[row, TWIST]
    turn_grip = twist * bodies[row, TURN] / bodies[row, LIGHTNESS]
    x = held[row, 0] - bodies[row, VX]
    y = held[row, 1] - bodies[row, VY]
    spin = held[row, 2] - bodies[row, SPIN]
    slide, turn = np.sqrt(x * x + y * y), abs(spin) / turn_grip
    if slide * slide + turn * turn > grip * grip:
        ratio = 1.0 / (twist * turn_grip)
        more = slide_on(slide, turn, grip, ratio)
        x, y, spin = x / (1.0 + more), y / (1.0 + more), spin / (1.0 + ratio * more)
    change_x, change_y, change_spin = x - held[row, 0], y - held[row, 1], spin - held[row, 2]
    bodies[row, VX] += change_x
    bodies[row, VY] += change_y
    bodies[row, SPIN] += change_spin
    held[row, 0], held[row, 1], held[row, 2] = x, y, spin
    return max(abs(change_x), abs(change_y), abs(change_spin) * bodies[row, REACH])


@compiled
def note_lean(work, physics, step):
    """Note how the contacts of this step shift the load of each body on its supports."""
    bodies, contacts, tilt = work.bodies, work.contacts, work.tilt
    for row in range(bodies.shape[0]):
        tilt[row, 0] = tilt[row, 1] = 0.0
    for index in range(work.counts[0]):
        point, side = work.features[index, POINT_BODY], work.features[index, SIDE_BODY]
        height = physics.tool_height if point == TOOL else physics.disk_height
        arm = (height - physics.middle_height) / (physics.gravity * step)
        along, across = arm * contacts[index, ALONG], arm * contacts[index, ACROSS]
        nx, ny = contacts[index, NORMAL_X], contacts[index, NORMAL_Y]
        px, py = along * nx - across * ny, along * ny + across * nx
        tilt[point, 0] += px * bodies[point, LIGHTNESS]
        tilt[point, 1] += py * bodies[point, LIGHTNESS]
        tilt[side, 0] -= px * bodies[side, LIGHTNESS]
        tilt[side, 1] -= py * bodies[side, LIGHTNESS]
