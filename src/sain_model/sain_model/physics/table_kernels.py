"""Friction between disks and table, compiled: Coulomb's law under three feet."""

import numpy as np

from sain_model.compute.compiling import chosen_by_type, compiled
from sain_model.physics.body_kernels import (
    COS,
    LIGHTNESS,
    MASS_X,
    MASS_Y,
    RADIUS,
    SIN,
    SPIN,
    TURN,
    VX,
    VY,
    apply_impulse,
    is_conditioned,
)
from sain_model.physics.support_kernels import slide_on

FEET = 3
THIRD_TURN_COS, THIRD_TURN_SIN = -0.5, 0.8660254037844386  # of 120 degrees
MOST_LEAN = 1.0  # then a foot in front carries twice its share and one behind nothing


@compiled
def apply_friction(work, disk, slowing, physics, step):
    """Slow a sliding disk down by the friction of one step.

    The direction is taken at the velocity expected in the middle of the step, from the change
    in the last one; that makes the step second order.

    Args:
        work: scratch memory.
        disk: row of the disk.
        slowing: what friction takes from each foot in this step [m/s].
        physics: for the feet and the heights at which forces act.
        step: duration [s].
    """
    bodies, change, feet = work.bodies, work.change, work.feet
    vx = bodies[disk, VX] + 0.5 * step * change[disk, 0]
    vy = bodies[disk, VY] + 0.5 * step * change[disk, 1]
    turn = physics.foot_radius * (bodies[disk, SPIN] + 0.5 * step * change[disk, 2])
    straight = work.tilt[disk, 0] == 0.0 and work.tilt[disk, 1] == 0.0
    straight &= bodies[disk, MASS_X] == 0.0 and bodies[disk, MASS_Y] == 0.0
    if turn == 0.0 and straight:
        share = slowing / max(np.sqrt(vx * vx + vy * vy), slowing)
        bodies[disk, VX] -= share * vx
        bodies[disk, VY] -= share * vy
        return
    _foot_friction(feet, vx, vy, turn, bodies[disk, COS], bodies[disk, SIN], slowing, physics)
    lean_x, lean_y = _lean(work, disk, physics, step)
    _slow_down(work, disk, lean_x, lean_y, physics)


def _slow_down(work, disk, lean_x, lean_y, physics):
    """Take from a disk what its feet, loaded as it leans, have found."""
    feet = work.feet
    total_x, total_y, across = 0.0, 0.0, 0.0
    for foot in range(FEET):
        x, y, cos, sin = feet[foot, 0], feet[foot, 1], feet[foot, 2], feet[foot, 3]
        load = (1.0 + lean_x * cos + lean_y * sin) / FEET
        total_x += load * x
        total_y += load * y
        across += load * (cos * y - sin * x)
    mass = 1.0 / work.bodies[disk, LIGHTNESS]
    apply_impulse(
        work, disk, -mass * total_x, -mass * total_y, -mass * physics.foot_radius * across
    )


def _slow_down_in_the_middle(work, disk, lean_x, lean_y, physics):
    bodies, feet = work.bodies, work.feet
    # A force at the feet turns the disk as `TURN` says, on an arm of `foot_radius`.
    turn_of_force = physics.foot_radius * bodies[disk, TURN] / bodies[disk, LIGHTNESS]
    for foot in range(FEET):
        x, y, cos, sin = feet[foot, 0], feet[foot, 1], feet[foot, 2], feet[foot, 3]
        load = (1.0 + lean_x * cos + lean_y * sin) / FEET
        bodies[disk, VX] -= load * x
        bodies[disk, VY] -= load * y
        bodies[disk, SPIN] -= turn_of_force * load * (cos * y - sin * x)


@chosen_by_type(_slow_down)
def _choose_slow_down(work, disk, lean_x, lean_y, physics):
    return _slow_down if is_conditioned(work) else _slow_down_in_the_middle


@compiled
def _foot_friction(feet, vx, vy, turn, cos, sin, slowing, physics):
    """Write for each foot what friction takes from it under an even load, and its direction.

    Args:
        feet: (3, 4) to fill with x, y [m/s], cos and sin.
        vx: velocity of the centre [m/s].
        vy: likewise.
        turn: speed of a foot about the centre [m/s].
        cos: of the heading.
        sin: of the heading.
        slowing: what friction takes from a foot that slides [m/s].
        physics: for `yield_across` and `axes_yield`.
    """
    for foot in range(FEET):
        # A foot moves with the centre and, as the disk turns, across the arm that it stands on.
        # Friction never turns a foot back: below `slowing` it falls linearly.
        x, y = vx - turn * sin, vy + turn * cos
        if physics.axes_yield > 0.0:
            x /= 1.0 + physics.axes_yield * sin * sin
            y /= 1.0 + physics.axes_yield * cos * cos
        else:
            less = (1.0 - physics.yield_across) * (cos * y - sin * x)
            x, y = x + less * sin, y - less * cos
        share = slowing / max(np.sqrt(x * x + y * y), slowing)
        feet[foot, 0], feet[foot, 1] = share * x, share * y
        feet[foot, 2], feet[foot, 3] = cos, sin
        cos, sin = (
            THIRD_TURN_COS * cos - THIRD_TURN_SIN * sin,
            THIRD_TURN_SIN * cos + THIRD_TURN_COS * sin,
        )


@compiled
def _lean(work, disk, physics, step):
    """Return by how much a foot's load grows when it stands along x, and along y [share].

    Braking acts below the centre of mass, a push mostly above it: both load the feet in front.
    """
    feet = work.feet
    arm = physics.middle_height / (physics.gravity * step * FEET)
    x = arm * (feet[0, 0] + feet[1, 0] + feet[2, 0]) + work.tilt[disk, 0]
    y = arm * (feet[0, 1] + feet[1, 1] + feet[2, 1]) + work.tilt[disk, 1]
    radius = work.bodies[disk, RADIUS]
    x, y = x + radius * work.bodies[disk, MASS_X], y + radius * work.bodies[disk, MASS_Y]
    scale = 2.0 / (physics.foot_radius * radius)
    lean = scale * np.sqrt(x * x + y * y)
    scale *= MOST_LEAN / max(lean, MOST_LEAN)
    return scale * x, scale * y


@compiled
def hold(work, disk, turn_grip, ratio):
    """Let the table hold a slow disk back as far as friction can, against what pushes it.

    Sticking and creeping cannot be told from the velocity before the step: this is solved along
    with the contacts, see `support_kernels.hold_back`.

    Args:
        work: scratch memory.
        disk: row of the disk.
        turn_grip: spin that friction can take while it could take 1 m/s of sliding.
        ratio: moment of inertia over mass x torsion length^2.

    Returns:
        The change of velocity that this made [m/s].
    """
    bodies, held, grip = work.bodies, work.held, work.grip[disk]
    x = held[disk, 0] - bodies[disk, VX]
    y = held[disk, 1] - bodies[disk, VY]
    spin = held[disk, 2] - bodies[disk, SPIN]
    slide, turn = np.sqrt(x * x + y * y), abs(spin) / turn_grip
    if slide * slide + turn * turn > grip * grip:
        more = slide_on(slide, turn, grip, ratio)
        x, y, spin = x / (1.0 + more), y / (1.0 + more), spin / (1.0 + ratio * more)
    change_x, change_y, change_spin = x - held[disk, 0], y - held[disk, 1], spin - held[disk, 2]
    bodies[disk, VX] += change_x
    bodies[disk, VY] += change_y
    bodies[disk, SPIN] += change_spin
    held[disk, 0], held[disk, 1], held[disk, 2] = x, y, spin
    return max(abs(change_x), abs(change_y), abs(change_spin))
