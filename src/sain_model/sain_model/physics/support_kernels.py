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
    """Slow a sliding body down by the friction of one step [s].

    The direction is taken at the velocity expected in the middle of the step, from the change in
    the last one; that makes the step second order. `slowing` is what friction takes from a support
    in this step, under the whole load [m/s].
    """
    body = work.bodies[row]
    vx = body.vx + 0.5 * step * body.change_x
    vy = body.vy + 0.5 * step * body.change_y
    spin = body.spin + 0.5 * step * body.change_spin
    # What slides straight on evenly loaded supports goes on straight, to the last bit.
    straight = spin == 0.0 and body.tilt_x == 0.0 and body.tilt_y == 0.0
    turns = 0.0 if straight else 1.0
    x, y = _pull_back(work, row, vx, vy, spin, slowing, turns, physics)
    # Braking acts below the centre of mass, a push mostly above: both load what is in front.
    arm = physics.middle_height / (physics.gravity * step)
    _slow_down(work, row, arm * x + body.tilt_x, arm * y + body.tilt_y, slowing, turns)


@compiled
def _pull_back(work, row, vx, vy, spin, slowing, turns, physics):
    """Write what friction takes from each support under a whole load; return its mean [m/s]."""
    body = work.bodies[row]
    cos, sin = body.cos, body.sin
    mean_x, mean_y = 0.0, 0.0
    grain_x, grain_y = grain_of(body, physics)
    axes_yield = turns * physics.axes_yield * body.yields
    across_yield = turns * (1.0 / physics.yield_across - 1.0) * body.yields
    for foot in range(work.first_support[row], work.first_support[row + 1]):
        support = work.supports[foot]
        arm_x = cos * support.x - sin * support.y
        arm_y = sin * support.x + cos * support.y
        support.arm_x, support.arm_y = arm_x, arm_y
        x, y = vx - spin * arm_y, vy + spin * arm_x
        support.limit = x * x + y * y < (SLOW * slowing) ** 2
        # A solver gives way to where a support is lighter to move: across its arm.
        if axes_yield > 0.0:
            less_x, less_y = 1.0 + axes_yield * arm_y * arm_y, 1.0 + axes_yield * arm_x * arm_x
            scale = 1.0 / (less_x * less_y)
            x, y = scale * less_y * x, scale * less_x * y
        if across_yield > 0.0:
            less = 1.0 + across_yield * (arm_x * arm_x + arm_y * arm_y)
            less = across_yield / less * (arm_x * y - arm_y * x)
            x, y = x + less * arm_y, y - less * arm_x
        # Friction never turns a support back: below `slowing` it falls linearly.
        share = slowing / max(np.sqrt(x * x + y * y), slowing)
        x, y = (1.0 + grain_x) * x + grain_y * y, grain_y * x + (1.0 - grain_x) * y
        support.pull_x, support.pull_y = share * x, share * y
        mean_x += support.share * share * x
        mean_y += support.share * share * y
    return mean_x, mean_y


@compiled
def grain_of(body, physics):
    """Return how friction has directions in the world: along x and y, and along the diagonals."""
    cos, sin = body.cos, body.sin
    cos, sin = cos * cos - sin * sin, 2.0 * cos * sin
    x = cos * body.grain_x - sin * body.grain_y
    y = sin * body.grain_x + cos * body.grain_y
    return x + physics.table_grain_x, y + physics.table_grain_y


@compiled
def _slow_down(work, row, shift_x, shift_y, slowing, turns):
    """Take from a body what its supports have found, loaded as its weight acts at a shift [m]."""
    body = work.bodies[row]
    first, last = work.first_support[row], work.first_support[row + 1]
    cos, sin = body.cos, body.sin
    fore, left = cos * shift_x + sin * shift_y, cos * shift_y - sin * shift_x
    lean = _lean(work.supports, first, last, fore, left)
    total_x, total_y, across = 0.0, 0.0, 0.0
    for foot in range(first, last):
        support = work.supports[foot]
        load = support.share + lean * (support.lean_x * fore + support.lean_y * left)
        if support.limit == 0.0:
            x, y = load * support.pull_x, load * support.pull_y
            total_x += x
            total_y += y
            across += support.arm_x * y - support.arm_y * x
        else:
            body.stuck = True
            support.limit = load * slowing
            support.held_x = support.held_y = 0.0
    body.vx -= total_x
    body.vy -= total_y
    body.spin -= turns * across * body.swing


@compiled
def _lean(supports, first, last, fore, left):
    """Return the share of a shift of the load [m] at which the first support lifts off, or 1."""
    lean = 1.0
    for foot in range(first, last):
        support = supports[foot]
        grows = support.lean_x * fore + support.lean_y * left
        if support.share + lean * grows < 0.0:
            lean = -support.share / grows
    return lean


@compiled_apart
def resist(work, row, physics, tool_speed, step):
    """Let a body that creeps answer to impulses of a step [s] as friction allows.

    Without inertia what pushes a body is as large as the friction against it: w_i v_i / |v_i| at a
    support with the load w_i. With |v_i| from the step before, that is linear in the velocity. So
    the solver of impulses finds it, with a matrix in place of mass and moment of inertia. From step
    to step it converges to Coulomb's law at each support: a body's motion is the normal of the
    limit surface that these have together (Goyal, Ruina and Papadopoulos, "Planar sliding with dry
    friction", Wear 143, 1991), whatever the size of the velocity.
    """
    body = work.bodies[row]
    first, last = work.first_support[row], work.first_support[row + 1]
    cos, sin = body.cos, body.sin
    fore = cos * body.tilt_x + sin * body.tilt_y
    left = cos * body.tilt_y - sin * body.tilt_x
    lean = _lean(work.supports, first, last, fore, left)
    vx, vy, spin = body.creep_x, body.creep_y, body.creep_spin
    size = np.sqrt(vx * vx + vy * vy + (spin * body.twist) ** 2)
    scale = max(LEAST_CREEP * tool_speed / size, 1.0)
    least = LEAST_SLIDE * scale * size
    xx, xy, yy, xs, ys, ss = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    grain_x, grain_y = grain_of(body, physics)
    for foot in range(first, last):
        support = work.supports[foot]
        arm_x = cos * support.x - sin * support.y
        arm_y = sin * support.x + cos * support.y
        x, y = scale * (vx - spin * arm_y), scale * (vy + spin * arm_x)
        load = support.share
        load += lean * (support.lean_x * fore + support.lean_y * left)
        drag = load / max(np.sqrt(x * x + y * y), least)
        drag_xx, drag_xy, drag_yy = drag * (1.0 + grain_x), drag * grain_y, drag * (1.0 - grain_x)
        drag_xs = drag_xy * arm_x - drag_xx * arm_y
        drag_ys = drag_yy * arm_x - drag_xy * arm_y
        xx, xy, yy = xx + drag_xx, xy + drag_xy, yy + drag_yy
        xs, ys = xs + drag_xs, ys + drag_ys
        ss += drag_ys * arm_x - drag_xs * arm_y
    _invert(body, xx, xy, yy, xs, ys, ss, body.lightness / body.slowing / step)


@compiled
def _invert(body, xx, xy, yy, xs, ys, ss, scale):
    """Let a body answer to impulses with the inverse of a symmetric matrix, scaled."""
    first, second, third = yy * ss - ys * ys, xs * ys - xy * ss, xy * ys - xs * yy
    body.creeps = True
    scale /= xx * first + xy * second + xs * third
    body.move_xx, body.move_xy = scale * first, scale * second
    body.move_xs = scale * third
    body.move_yy = scale * (xx * ss - xs * xs)
    body.move_ys = scale * (xs * xy - xx * ys)
    body.move_ss = scale * (xx * yy - xy * xy)


@compiled
def hold_supports(work, row):
    """Let the table hold slow supports of a body back, each by Coulomb's law."""
    body = work.bodies[row]
    vx, vy, spin, turn = body.vx, body.vy, body.spin, body.swing
    change = 0.0
    for foot in range(work.first_support[row], work.first_support[row + 1]):
        support = work.supports[foot]
        limit = support.limit
        if limit > 0.0:
            arm_x, arm_y = support.arm_x, support.arm_y
            x, y = vx - spin * arm_y, vy + spin * arm_x
            # Across its arm a support is lighter to move than along it.
            less = turn * (arm_x * y - arm_y * x) / (1.0 + turn * (arm_x**2 + arm_y**2))
            x, y = x + less * arm_y, y - less * arm_x
            x, y = support.held_x - x, support.held_y - y
            size = np.sqrt(x * x + y * y)
            if size > limit:
                x, y = x * limit / size, y * limit / size
            dx, dy = x - support.held_x, y - support.held_y
            support.held_x, support.held_y = x, y
            vx, vy, spin = vx + dx, vy + dy, spin + turn * (arm_x * dy - arm_y * dx)
            change = max(change, abs(dx), abs(dy))
    body.vx, body.vy, body.spin = vx, vy, spin
    return change


@compiled
def slide_on(slide, turn, grip, ratio):
    """Return how a body goes on that the table cannot hold: along its limit surface's normal.

    Friction takes h from the velocity u so that h lies on the ellipsoid h_xy^2 + (h_w / t)^2 =
    grip^2, and what is left of u is along the ellipsoid's normal at h (the principle of maximal
    dissipation): h_xy = -u_xy / (1 + m), h_w = -u_w / (1 + ratio m). The m > 0 for which h lies on
    the ellipsoid is returned. It is found by Newton's method on 1 / |h|, which is almost linear in
    m: it converges from m = 0 without overshooting (More and Sorensen, "Computing a trust region
    step", SIAM J. Sci. Stat. Comput. 4, 1983). `slide` is |u_xy| and `turn` |u_w| / t [m/s], both
    together more than the grip; `ratio` is moment of inertia over mass x torsion length^2.
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
def hold_back(body):
    """Let the table hold a slow body back as far as it can; return the change made [m/s].

    Sticking and creeping cannot be told from the velocity before the step: this is solved along
    with the contacts, with an ellipsoid as limit surface (Goyal, Ruina and Papadopoulos, as for
    `resist`; the ellipsoid is Howe and Cutkosky's).
    """
    held_x, held_y, held_spin = body.held_x, body.held_y, body.held_spin
    if body.vx == 0.0 and body.vy == 0.0 and body.spin == 0.0:  # it is held already
        return 0.0
    x, y, spin = held_x - body.vx, held_y - body.vy, held_spin - body.spin
    grip, turn_grip = body.grip, body.twist * body.swing
    slide, turn = np.sqrt(x * x + y * y), abs(spin) / turn_grip
    if slide * slide + turn * turn > grip * grip:
        ratio = 1.0 / (body.twist * turn_grip)
        more = slide_on(slide, turn, grip, ratio)
        x, y, spin = x / (1.0 + more), y / (1.0 + more), spin / (1.0 + ratio * more)
    body.held_x, body.held_y, body.held_spin = x, y, spin
    x, y, spin = x - held_x, y - held_y, spin - held_spin
    body.vx += x
    body.vy += y
    body.spin += spin
    return max(abs(x), abs(y), abs(spin) * body.reach)


@compiled
def of_tool(contact):
    """Tell whether the tool is one of the two bodies of a contact."""
    return min(contact.point_body, contact.side_body) == TOOL


@compiled
def note_lean(work, physics, step):
    """Note how the contacts of this step shift the load of each body on its supports."""
    bodies = work.bodies
    for row in range(bodies.shape[0]):
        bodies[row].tilt_x = bodies[row].tilt_y = 0.0
    for index in range(work.counts[0]):
        contact = work.contacts[index]
        if contact.along > 0.0:
            point, side = bodies[contact.point_body], bodies[contact.side_body]
            height = physics.tool_height if of_tool(contact) else physics.disk_height
            arm = (height - physics.middle_height) / (physics.gravity * step)
            along, across = arm * contact.along, arm * contact.across
            nx, ny = contact.normal_x, contact.normal_y
            px, py = along * nx - across * ny, along * ny + across * nx
            point.tilt_x += px * point.lightness
            point.tilt_y += py * point.lightness
            side.tilt_x -= px * side.lightness
            side.tilt_y -= py * side.lightness
