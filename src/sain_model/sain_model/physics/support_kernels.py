"""Friction between bodies and table, compiled: Coulomb's law at each support."""

import numpy as np

from sain_model.compute.compiling import compiled, compiled_apart
from sain_model.physics.body_kernels import TOOL

NEWTON_STEPS = 20  # most of them; three or four are usual
ON_SURFACE = 1e-9  # share by which friction may exceed the limit
LEAST_CREEP = 0.05  # [speeds of the tool], slower bodies resist as if they crept as fast
LEAST_SLIDE = 0.01  # share of a body's velocity, supports that slide slower resist no more
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
    bodies = work.bodies
    vx = bodies[row].vx + 0.5 * step * bodies[row].change_x
    vy = bodies[row].vy + 0.5 * step * bodies[row].change_y
    spin = bodies[row].spin + 0.5 * step * bodies[row].change_spin
    # What slides straight on evenly loaded supports goes on straight, to the last bit.
    straight = spin == 0.0 and bodies[row].tilt_x == 0.0 and bodies[row].tilt_y == 0.0
    turns = 0.0 if straight else 1.0
    x, y = _pull_back(work, row, vx, vy, spin, slowing, turns, physics)
    # Braking acts below the centre of mass, a push mostly above: both load what is in front.
    arm = physics.middle_height / (physics.gravity * step)
    _slow_down(
        work, row, arm * x + bodies[row].tilt_x, arm * y + bodies[row].tilt_y, slowing, turns
    )


@compiled
def _pull_back(work, row, vx, vy, spin, slowing, turns, physics):
    """Write what friction takes from each support under a whole load; return its mean [m/s]."""
    supports, bodies = work.supports, work.bodies
    cos, sin = bodies[row].cos, bodies[row].sin
    mean_x, mean_y = 0.0, 0.0
    grain_x, grain_y = grain_of(bodies, row, physics)
    axes_yield = turns * physics.axes_yield
    across_yield = turns * (1.0 / physics.yield_across - 1.0)
    for foot in range(work.first_support[row], work.first_support[row + 1]):
        arm_x = cos * supports[foot].x - sin * supports[foot].y
        arm_y = sin * supports[foot].x + cos * supports[foot].y
        supports[foot].arm_x, supports[foot].arm_y = arm_x, arm_y
        x, y = vx - spin * arm_y, vy + spin * arm_x
        supports[foot].limit = x * x + y * y < (SLOW * slowing) ** 2
        squared = arm_x * arm_x + arm_y * arm_y
        if squared > 0.0:
            # A solver gives way to where a support is lighter to move: across its arm.
            if axes_yield > 0.0:
                light = axes_yield * supports[foot].yield_ / squared
                x /= 1.0 + light * arm_y * arm_y
                y /= 1.0 + light * arm_x * arm_x
            if across_yield > 0.0:
                light = across_yield * supports[foot].yield_
                less = light / (1.0 + light) * (arm_x * y - arm_y * x) / squared
                x, y = x + less * arm_y, y - less * arm_x
        # Friction never turns a support back: below `slowing` it falls linearly.
        share = slowing / max(np.sqrt(x * x + y * y), slowing)
        x, y = (1.0 + grain_x) * x + grain_y * y, grain_y * x + (1.0 - grain_x) * y
        supports[foot].pull_x, supports[foot].pull_y = share * x, share * y
        mean_x += supports[foot].share * share * x
        mean_y += supports[foot].share * share * y
    return mean_x, mean_y


@compiled
def grain_of(bodies, row, physics):
    """Return how friction has directions in the world: along x and y, and along the diagonals."""
    cos, sin = bodies[row].cos, bodies[row].sin
    cos, sin = cos * cos - sin * sin, 2.0 * cos * sin
    x = cos * bodies[row].grain_x - sin * bodies[row].grain_y
    y = sin * bodies[row].grain_x + cos * bodies[row].grain_y
    return x + physics.table_grain_x, y + physics.table_grain_y


@compiled
def _slow_down(work, row, shift_x, shift_y, slowing, turns):
    """Take from a body what its supports have found, loaded as its weight acts at a shift [m]."""
    supports, bodies = work.supports, work.bodies
    first, last = work.first_support[row], work.first_support[row + 1]
    cos, sin = bodies[row].cos, bodies[row].sin
    fore, left = cos * shift_x + sin * shift_y, cos * shift_y - sin * shift_x
    lean = _lean(supports, first, last, fore, left)
    total_x, total_y, across = 0.0, 0.0, 0.0
    for foot in range(first, last):
        grows = supports[foot].lean_x * fore + supports[foot].lean_y * left
        load = supports[foot].share + lean * grows
        if supports[foot].limit == 0.0:
            x, y = load * supports[foot].pull_x, load * supports[foot].pull_y
            total_x += x
            total_y += y
            across += supports[foot].arm_x * y - supports[foot].arm_y * x
        else:
            work.bodies[row].stuck = True
            supports[foot].limit = load * slowing
            supports[foot].held_x = supports[foot].held_y = 0.0
    bodies[row].vx -= total_x
    bodies[row].vy -= total_y
    bodies[row].spin -= turns * across * bodies[row].turn / bodies[row].lightness


@compiled
def _lean(supports, first, last, fore, left):
    """Return the share of a shift of the load [m] at which the first support lifts off, or 1."""
    lean = 1.0
    for foot in range(first, last):
        grows = supports[foot].lean_x * fore + supports[foot].lean_y * left
        if supports[foot].share + lean * grows < 0.0:
            lean = -supports[foot].share / grows
    return lean


@compiled_apart
def resist(work, row, physics, tool_speed, step):
    """Let a body that creeps answer to impulses as the friction of its supports allows.

    Without inertia what pushes a body is as large as the friction against it: w_i v_i / |v_i| at
    a support with the load w_i. With |v_i| from the step before, that is linear in the velocity. So
    the solver of impulses finds it, with a matrix in place of mass and moment of inertia. From
    step to step it converges to Coulomb's law at each support: a body's motion is the normal of
    the limit surface that these have together (Goyal, Ruina and Papadopoulos, "Planar sliding
    with dry friction", Wear 143, 1991), whatever the size of the velocity.

    Args:
        work: scratch memory.
        row: of the body.
        physics: for the table's grain.
        tool_speed: [m/s].
        step: duration [s].
    """
    bodies, supports = work.bodies, work.supports
    first, last = work.first_support[row], work.first_support[row + 1]
    cos, sin = bodies[row].cos, bodies[row].sin
    fore = cos * bodies[row].tilt_x + sin * bodies[row].tilt_y
    left = cos * bodies[row].tilt_y - sin * bodies[row].tilt_x
    lean = _lean(supports, first, last, fore, left)
    vx, vy, spin = bodies[row].creep_x, bodies[row].creep_y, bodies[row].creep_spin
    size = np.sqrt(vx * vx + vy * vy + (spin * bodies[row].twist) ** 2)
    scale = max(LEAST_CREEP * tool_speed / size, 1.0)
    least = LEAST_SLIDE * scale * size
    xx, xy, yy, xs, ys, ss = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    grain_x, grain_y = grain_of(bodies, row, physics)
    for foot in range(first, last):
        arm_x = cos * supports[foot].x - sin * supports[foot].y
        arm_y = sin * supports[foot].x + cos * supports[foot].y
        x, y = scale * (vx - spin * arm_y), scale * (vy + spin * arm_x)
        load = supports[foot].share
        load += lean * (supports[foot].lean_x * fore + supports[foot].lean_y * left)
        drag = load / max(np.sqrt(x * x + y * y), least)
        drag_xx, drag_xy, drag_yy = drag * (1.0 + grain_x), drag * grain_y, drag * (1.0 - grain_x)
        drag_xs = drag_xy * arm_x - drag_xx * arm_y
        drag_ys = drag_yy * arm_x - drag_xy * arm_y
        xx, xy, yy = xx + drag_xx, xy + drag_xy, yy + drag_yy
        xs, ys = xs + drag_xs, ys + drag_ys
        ss += drag_ys * arm_x - drag_xs * arm_y
    _invert(bodies, row, xx, xy, yy, xs, ys, ss, bodies[row].lightness / bodies[row].slowing / step)


@compiled
def _invert(bodies, row, xx, xy, yy, xs, ys, ss, scale):
    """Let a body answer to impulses with the inverse of a symmetric matrix, scaled."""
    first, second, third = yy * ss - ys * ys, xs * ys - xy * ss, xy * ys - xs * yy
    bodies[row].creeps = True
    scale /= xx * first + xy * second + xs * third
    bodies[row].move_xx, bodies[row].move_xy = scale * first, scale * second
    bodies[row].move_xs = scale * third
    bodies[row].move_yy = scale * (xx * ss - xs * xs)
    bodies[row].move_ys = scale * (xs * xy - xx * ys)
    bodies[row].move_ss = scale * (xx * yy - xy * xy)


@compiled
def hold_supports(work, row):
    """Let the table hold slow supports of a body back, each by Coulomb's law."""
    supports, bodies = work.supports, work.bodies
    turn = bodies[row].turn / bodies[row].lightness
    change = 0.0
    for foot in range(work.first_support[row], work.first_support[row + 1]):
        limit = supports[foot].limit
        if limit > 0.0:
            arm_x, arm_y = supports[foot].arm_x, supports[foot].arm_y
            x = bodies[row].vx - bodies[row].spin * arm_y
            y = bodies[row].vy + bodies[row].spin * arm_x
            # Across its arm a support is lighter to move than along it.
            less = turn * (arm_x * y - arm_y * x) / (1.0 + turn * (arm_x**2 + arm_y**2))
            x, y = x + less * arm_y, y - less * arm_x
            x, y = supports[foot].held_x - x, supports[foot].held_y - y
            size = np.sqrt(x * x + y * y)
            if size > limit:
                x, y = x * limit / size, y * limit / size
            dx, dy = x - supports[foot].held_x, y - supports[foot].held_y
            supports[foot].held_x, supports[foot].held_y = x, y
            bodies[row].vx += dx
            bodies[row].vy += dy
            bodies[row].spin += turn * (arm_x * dy - arm_y * dx)
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
    bodies = work.bodies
    grip = bodies[row].grip
    twist = bodies[row].twist
    turn_grip = twist * bodies[row].turn / bodies[row].lightness
    x = bodies[row].held_x - bodies[row].vx
    y = bodies[row].held_y - bodies[row].vy
    spin = bodies[row].held_spin - bodies[row].spin
    slide, turn = np.sqrt(x * x + y * y), abs(spin) / turn_grip
    if slide * slide + turn * turn > grip * grip:
        ratio = 1.0 / (twist * turn_grip)
        more = slide_on(slide, turn, grip, ratio)
        x, y, spin = x / (1.0 + more), y / (1.0 + more), spin / (1.0 + ratio * more)
    change_x, change_y, change_spin = (
        x - bodies[row].held_x,
        y - bodies[row].held_y,
        spin - bodies[row].held_spin,
    )
    bodies[row].vx += change_x
    bodies[row].vy += change_y
    bodies[row].spin += change_spin
    bodies[row].held_x, bodies[row].held_y, bodies[row].held_spin = x, y, spin
    return max(abs(change_x), abs(change_y), abs(change_spin) * bodies[row].reach)


@compiled
def note_lean(work, physics, step):
    """Note how the contacts of this step shift the load of each body on its supports."""
    bodies, contacts = work.bodies, work.contacts
    for row in range(bodies.shape[0]):
        bodies[row].tilt_x = bodies[row].tilt_y = 0.0
    for index in range(work.counts[0]):
        point, side = work.contacts[index].point_body, work.contacts[index].side_body
        height = physics.tool_height if point == TOOL else physics.disk_height
        arm = (height - physics.middle_height) / (physics.gravity * step)
        along, across = arm * contacts[index].along, arm * contacts[index].across
        nx, ny = contacts[index].normal_x, contacts[index].normal_y
        px, py = along * nx - across * ny, along * ny + across * nx
        bodies[point].tilt_x += px * bodies[point].lightness
        bodies[point].tilt_y += py * bodies[point].lightness
        bodies[side].tilt_x -= px * bodies[side].lightness
        bodies[side].tilt_y -= py * bodies[side].lightness
