"""The bodies of one push in the compiled planar world, and its scratch memory.

Bodies are rows of one array: row 0 is the tool, which no impulse moves, row i + 1 is disk i.
"""

from typing import NamedTuple

import numpy as np

from sain_core.push import LOCATION
from sain_core.scene import MASS as STATE_MASS
from sain_core.scene import OMEGA as STATE_OMEGA
from sain_core.scene import RADIUS as STATE_RADIUS
from sain_core.scene import THETA as STATE_THETA
from sain_core.scene import VX as STATE_VX
from sain_core.scene import X as STATE_X
from sain_core.scene import Y as STATE_Y
from sain_model.compute.compiling import chosen_by_type, compiled

TOOL = 0
# Columns of a body. `SPIN` is the speed of the rim [m/s]; 1 N s at the rim adds `TURN` to it.
# `TURNED` is the angle turned in this push, `COS` and `SIN` are those of the heading.
# `MASS_X` and `MASS_Y` lead from a disk's middle to its centre of mass [radii], `MASS_FORE` and
# `MASS_LEFT` likewise in the disk's own frame; the columns from `DRAG` on are its corrections.
X, Y, VX, VY, SPIN, RADIUS, LIGHTNESS, TURN, TURNED, COS, SIN, MASS_X, MASS_Y = range(13)
DRAG, PULL_X, PULL_Y, MASS_FORE, MASS_LEFT, RIM_GRIP, TOOL_GRIP = range(13, 20)
BODY_SIZE = 20
CORRECTIONS = 7

NORMAL_X, NORMAL_Y, END_X, END_Y, GAP, BIAS, NORMAL_MASS, RIM_MASS = range(8)
CONTACT_SIZE = 8
ALONG, ACROSS = range(2)  # columns of an impulse


class Physics(NamedTuple):
    """What the kernels need to know of `PlanarConfig`, as plain numbers in SI units."""

    gravity: float
    foot_radius: float
    inertia: float
    tool_friction: float
    disk_friction: float
    tool_restitution: float
    disk_restitution: float
    friction_scale: float
    yield_across: float
    axes_yield: float
    middle_height: float
    tool_height: float
    disk_height: float
    tool_radius: float
    speed: float
    acceleration: float
    longest_step: float
    stop_share: float
    stop_step: float
    bend: float


class Workspace(NamedTuple):
    """Scratch memory of one push. P = N (N + 1) / 2 pairs of bodies, C <= P of them near."""

    bodies: np.ndarray  # (N + 1, BODY_SIZE)
    before: np.ndarray  # (N + 1, 3) vx, vy, spin at the start of the step
    change: np.ndarray  # (N + 1, 3) their rates of change in the last step
    grip: np.ndarray  # (N + 1,) speed that the table can take from a slow disk [m/s]
    held: np.ndarray  # (N + 1, 3) and what it has taken
    tilt: np.ndarray  # (N + 1, 2) shift of the load on the table by what pushed a disk last [m]
    feet: np.ndarray  # (3, 4) of one disk: friction x, y [m/s], direction x, y
    pairs: np.ndarray  # (C, 3) int64: first body, second body, number of the pair
    contacts: np.ndarray  # (C, CONTACT_SIZE)
    impulses: np.ndarray  # (P, 2) [N s], kept from step to step
    corrections: np.ndarray  # (N, CORRECTIONS), see `sain_model.physics.corrections`


class ConditionedWorkspace(Workspace):
    """Scratch memory of a push whose disks are corrected: their mass may be off the middle.

    A type of its own, so that kernels for disks as in the textbook are compiled without it.
    """

    __slots__ = ()


@compiled
def make_workspace(disks):
    """Return scratch memory for this many disks."""
    pairs = disks * (disks + 1) // 2
    return Workspace(
        np.zeros((disks + 1, BODY_SIZE)),
        np.zeros((disks + 1, 3)),
        np.zeros((disks + 1, 3)),
        np.zeros(disks + 1),
        np.zeros((disks + 1, 3)),
        np.zeros((disks + 1, 2)),
        np.zeros((3, 4)),
        np.empty((pairs, 3), np.int64),
        np.empty((pairs, CONTACT_SIZE)),
        np.zeros((pairs, 2)),
        _no_corrections(disks),
    )


@compiled
def make_conditioned_workspace(disks):
    """Return scratch memory for this many disks that are corrected."""
    work = make_workspace(disks)
    return ConditionedWorkspace(
        work.bodies,
        work.before,
        work.change,
        work.grip,
        work.held,
        work.tilt,
        work.feet,
        work.pairs,
        work.contacts,
        work.impulses,
        work.corrections,
    )


@compiled
def _no_corrections(disks):
    corrections = np.zeros((disks, CORRECTIONS))
    for disk in range(disks):
        for column in (DRAG, RIM_GRIP, TOOL_GRIP):  # these are factors
            corrections[disk, column - DRAG] = 1.0
    return corrections


@compiled
def load(disks, push, start, physics, work):
    """Fill the bodies from a scene (N, 8), taken as at rest, and a push (3,).

    `start` is how far from the mid disk's centre the tool's axis stands before it travels [m].
    """
    bodies = work.bodies
    for disk in range(disks.shape[0]):
        body = disk + 1
        bodies[body, X], bodies[body, Y] = disks[disk, STATE_X], disks[disk, STATE_Y]
        bodies[body, VX] = bodies[body, VY] = bodies[body, SPIN] = 0.0
        bodies[body, RADIUS] = disks[disk, STATE_RADIUS]
        bodies[body, LIGHTNESS] = 1.0 / disks[disk, STATE_MASS]
        bodies[body, TURN] = bodies[body, LIGHTNESS] / physics.inertia
        bodies[body, TURNED] = 0.0
        bodies[body, COS] = np.cos(disks[disk, STATE_THETA])
        bodies[body, SIN] = np.sin(disks[disk, STATE_THETA])
        for column in range(CORRECTIONS):
            bodies[body, DRAG + column] = work.corrections[disk, column]
        place_mass(bodies, body)
    bodies[TOOL, X] = bodies[1, X] - start * np.cos(push[LOCATION])
    bodies[TOOL, Y] = bodies[1, Y] - start * np.sin(push[LOCATION])
    bodies[TOOL, RADIUS] = physics.tool_radius
    forget(work)


@compiled
def forget(work):
    """Clear what is kept from step to step. Loops: assigning to a slice is many times slower."""
    for body in range(work.bodies.shape[0]):
        work.grip[body] = 0.0
        work.tilt[body, 0] = work.tilt[body, 1] = 0.0
        work.change[body, 0] = work.change[body, 1] = work.change[body, 2] = 0.0
    for pair in range(work.impulses.shape[0]):
        work.impulses[pair, ALONG] = work.impulses[pair, ACROSS] = 0.0


@compiled
def unload(disks, work):
    """Write the bodies, at rest, back to the scene."""
    bodies = work.bodies
    for disk in range(disks.shape[0]):
        body = disk + 1
        disks[disk, STATE_X], disks[disk, STATE_Y] = bodies[body, X], bodies[body, Y]
        if bodies[body, TURNED] != 0.0:
            heading = disks[disk, STATE_THETA] + bodies[body, TURNED]
            disks[disk, STATE_THETA] = np.pi - (np.pi - heading) % (2.0 * np.pi)
        for column in range(STATE_VX, STATE_OMEGA + 1):
            disks[disk, column] = 0.0


@compiled
def place_mass(bodies, body):
    """Turn the way to a disk's centre of mass with the disk."""
    fore, left = bodies[body, MASS_FORE], bodies[body, MASS_LEFT]
    cos, sin = bodies[body, COS], bodies[body, SIN]
    bodies[body, MASS_X], bodies[body, MASS_Y] = cos * fore - sin * left, sin * fore + cos * left


def apply_impulse(work, body, px, py, rim):
    """Give a disk an impulse (px, py) and a turn `rim`, the sum of those across at its rim [N s].

    Both are about its middle. Where its mass is elsewhere, what acts on the middle turns it too,
    and the middle, whose velocity is kept, moves about the mass.
    """
    bodies = work.bodies
    mass_x, mass_y = bodies[body, MASS_X], bodies[body, MASS_Y]
    spin = (rim - (mass_x * py - mass_y * px)) * bodies[body, TURN]
    bodies[body, SPIN] += spin
    bodies[body, VX] += px * bodies[body, LIGHTNESS] + spin * mass_y
    bodies[body, VY] += py * bodies[body, LIGHTNESS] - spin * mass_x


def _apply_impulse_in_the_middle(work, body, px, py, rim):
    bodies = work.bodies
    bodies[body, VX] += px * bodies[body, LIGHTNESS]
    bodies[body, VY] += py * bodies[body, LIGHTNESS]
    bodies[body, SPIN] += rim * bodies[body, TURN]


@chosen_by_type(apply_impulse)
def _choose_apply_impulse(work, body, px, py, rim):
    return apply_impulse if is_conditioned(work) else _apply_impulse_in_the_middle


def is_conditioned(work):
    """Tell whether the type of a workspace is that of corrected disks."""
    return work.instance_class is ConditionedWorkspace


@compiled
def rim_speed(bodies, body):
    """Return a bound on the speed of any point of a disk [m/s]."""
    return np.sqrt(bodies[body, VX] ** 2 + bodies[body, VY] ** 2) + abs(bodies[body, SPIN])
