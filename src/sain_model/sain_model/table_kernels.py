"""Friction between disks and table, compiled: Coulomb's law under three feet."""

import numpy as np

from sain_model.body_kernels import COS, LIGHTNESS, SIN, SPIN, TURN, VX, VY
from sain_model.compiling import compiled

FEET = 3
THIRD_TURN_COS, THIRD_TURN_SIN = -0.5, 0.8660254037844386  # of 120 degrees


@compiled
def rub(work, disk, slowing, foot_radius, step):
    """Slow a sliding disk down by the friction of one step.

    The direction is taken at the velocity expected in the middle of the step, from the change
    in the last one; that makes the step second order.

    Args:
        work: scratch memory.
        disk: row of the disk.
        slowing: what friction takes from each foot in this step [m/s].
        foot_radius: where the feet stand, share of the disk's radius.
        step: duration [s].
    """
    bodies, change = work.bodies, work.change
    vx = bodies[disk, VX] + 0.5 * step * change[disk, 0]
    vy = bodies[disk, VY] + 0.5 * step * change[disk, 1]
    turn = foot_radius * (bodies[disk, SPIN] + 0.5 * step * change[disk, 2])
    if turn == 0.0:
        share = slowing / max(np.sqrt(vx * vx + vy * vy), slowing)
        bodies[disk, VX] -= share * vx
        bodies[disk, VY] -= share * vy
        return
    cos, sin = bodies[disk, COS], bodies[disk, SIN]
    mean_x, mean_y, mean_turn = 0.0, 0.0, 0.0
    for _ in range(FEET):
        # A foot moves with the centre and, as the disk turns, across the arm that it stands on.
        # Friction never turns a foot back: below `slowing` it falls linearly.
        foot_vx, foot_vy = vx - turn * sin, vy + turn * cos
        share = slowing / max(np.sqrt(foot_vx * foot_vx + foot_vy * foot_vy), slowing)
        mean_x += share * foot_vx
        mean_y += share * foot_vy
        mean_turn += share * (cos * foot_vy - sin * foot_vx)
        cos, sin = (
            THIRD_TURN_COS * cos - THIRD_TURN_SIN * sin,
            THIRD_TURN_SIN * cos + THIRD_TURN_COS * sin,
        )
    bodies[disk, VX] -= mean_x / FEET
    bodies[disk, VY] -= mean_y / FEET
    # A force at the feet turns the disk as `TURN` says, on an arm of `foot_radius`.
    turn_of_force = foot_radius * bodies[disk, TURN] / bodies[disk, LIGHTNESS]
    bodies[disk, SPIN] -= turn_of_force * mean_turn / FEET


@compiled
def hold(work, disk, turn_grip):
    """Let the table hold a slow disk back as far as friction can, against what pushes it.

    Sticking and creeping cannot be told from the velocity before the step: this is solved along
    with the contacts, with the ellipsoid as limit surface.

    Args:
        work: scratch memory.
        disk: row of the disk.
        turn_grip: spin that friction can take while it could take 1 m/s of sliding.

    Returns:
        The change of velocity that this made [m/s].
    """
    bodies, held, grip = work.bodies, work.held, work.grip[disk]
    x = held[disk, 0] - bodies[disk, VX]
    y = held[disk, 1] - bodies[disk, VY]
    spin = held[disk, 2] - bodies[disk, SPIN]
    squared = x * x + y * y + (spin / turn_grip) ** 2
    if squared > grip * grip:
        scale = grip / np.sqrt(squared)
        x, y, spin = scale * x, scale * y, scale * spin
    change_x, change_y, change_spin = x - held[disk, 0], y - held[disk, 1], spin - held[disk, 2]
    bodies[disk, VX] += change_x
    bodies[disk, VY] += change_y
    bodies[disk, SPIN] += change_spin
    held[disk, 0], held[disk, 1], held[disk, 2] = x, y, spin
    return max(abs(change_x), abs(change_y), abs(change_spin))
