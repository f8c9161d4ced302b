"""Whole pushes of round disks on a table, compiled and run in parallel over the batch.

Time is stepped from the tool's first touch until everything lies still again. Each disk stands
on three feet with Coulomb friction, so that sliding and turning share the same friction.
"""

from typing import NamedTuple

import numpy as np
from numba import njit, prange
from sain_core import scene as disk_columns
from sain_core.push import ANGLE, LENGTH, LOCATION

from sain_model.contact_kernels import (
    ALONG,
    COS,
    LIGHTNESS,
    RADIUS,
    SIN,
    SPIN,
    THETA,
    TOOL,
    TURN,
    VX,
    VY,
    X,
    Y,
    find_contacts,
    make_workspace,
    separate,
    solve_contacts,
)

CHUNK = 32  # pushes that share one scratch memory
STILL = 1e-7  # [m/s], slower than this is at rest
MOST_STEPS = 5000  # far beyond any push; keeps a wrong parameter from running for ever
THIRD_TURN_SIN = 0.8660254037844386  # sin(120 degrees); its cosine is -1/2

STATE_X, STATE_Y, STATE_THETA = disk_columns.X, disk_columns.Y, disk_columns.THETA
STATE_MASS, STATE_RADIUS = disk_columns.MASS, disk_columns.RADIUS
STATE_VELOCITY, STATE_OMEGA = disk_columns.VX, disk_columns.OMEGA


class Physics(NamedTuple):
    """What the kernels need to know of `PlanarConfig`, as plain numbers in SI units."""

    gravity: float
    foot_radius: float  # share of the disk's radius
    inertia: float  # share of mass x radius^2
    tool_friction: float
    disk_friction: float
    tool_radius: float
    clearance: float
    speed: float
    acceleration: float
    contact_step: float
    slide_step: float


@njit(cache=True)
def travelled(time, length, speed, acceleration):
    """Return how far [m] the tool has come along its trapezoid profile."""
    ramp = min(speed / acceleration, np.sqrt(length / acceleration))
    peak = acceleration * ramp
    ramp_length = 0.5 * peak * ramp
    end = 2 * ramp + (length - 2 * ramp_length) / peak
    if time >= end:
        return length
    if time < ramp:
        return 0.5 * acceleration * time * time
    if time < end - ramp:
        return ramp_length + peak * (time - ramp)
    return length - 0.5 * acceleration * (end - time) ** 2


@njit(cache=True)
def time_of(distance, length, speed, acceleration):
    """Return when [s] the tool has come this far: the inverse of `travelled`."""
    ramp = min(speed / acceleration, np.sqrt(length / acceleration))
    peak = acceleration * ramp
    ramp_length = 0.5 * peak * ramp
    end = 2 * ramp + (length - 2 * ramp_length) / peak
    if distance >= length:
        return end
    if distance < ramp_length:
        return np.sqrt(2 * distance / acceleration)
    if distance < length - ramp_length:
        return ramp + (distance - ramp_length) / peak
    return end - np.sqrt(2 * (length - distance) / acceleration)


@njit(cache=True)
def first_touch(bodies, way_x, way_y):
    """Return how far [m] the tool travels until it touches any disk; infinite if never."""
    nearest = np.inf
    for disk in range(1, bodies.shape[0]):
        dx, dy = bodies[disk, X] - bodies[TOOL, X], bodies[disk, Y] - bodies[TOOL, Y]
        touching = bodies[disk, RADIUS] + bodies[TOOL, RADIUS]
        along = dx * way_x + dy * way_y
        squared = touching * touching - (dx * dx + dy * dy - along * along)
        if squared > 0.0 and along > 0.0:
            nearest = min(nearest, max(along - np.sqrt(squared), 0.0))
    return nearest


@njit(cache=True)
def rub(bodies, disk, slowing, foot_radius):
    """Slow a disk down by the friction under its feet, each of which could lose `slowing` [m/s]."""
    vx, vy, turn = bodies[disk, VX], bodies[disk, VY], foot_radius * bodies[disk, SPIN]
    if turn == 0.0:
        share = slowing / max(np.sqrt(vx * vx + vy * vy), slowing)
        bodies[disk, VX] -= share * vx
        bodies[disk, VY] -= share * vy
        return
    cos, sin = bodies[disk, COS], bodies[disk, SIN]
    mean_x, mean_y, mean_turn = 0.0, 0.0, 0.0
    for foot in range(3):
        # A foot moves with the centre and, as the disk turns, across its own arm. None is slowed
        # beyond standing still: below `slowing` friction falls linearly.
        foot_vx, foot_vy = vx - turn * sin, vy + turn * cos
        share = slowing / (3.0 * max(np.sqrt(foot_vx * foot_vx + foot_vy * foot_vy), slowing))
        mean_x += share * foot_vx
        mean_y += share * foot_vy
        mean_turn += share * (cos * foot_vy - sin * foot_vx)
        cos, sin = -0.5 * cos - THIRD_TURN_SIN * sin, THIRD_TURN_SIN * cos - 0.5 * sin
    bodies[disk, VX] -= mean_x
    bodies[disk, VY] -= mean_y
    inertia = bodies[disk, LIGHTNESS] / bodies[disk, TURN]
    bodies[disk, SPIN] -= mean_turn * foot_radius / inertia


@njit(cache=True)
def move(bodies, disk, step, pushed, before):
    """Move a disk on by one step [s]; return a bound on the speed of its rim [m/s]."""
    vx, vy, spin = bodies[disk, VX], bodies[disk, VY], bodies[disk, SPIN]
    fastest = np.sqrt(vx * vx + vy * vy) + abs(spin)
    if fastest < STILL:
        fastest = vx = vy = spin = 0.0
        bodies[disk, VX] = bodies[disk, VY] = bodies[disk, SPIN] = 0.0
    # Friction alone slows evenly: then the mean velocity is exact. A contact acts at once.
    if not pushed:
        vx, vy = 0.5 * (vx + before[disk, 0]), 0.5 * (vy + before[disk, 1])
        spin = 0.5 * (spin + before[disk, 2])
    bodies[disk, X] += step * vx
    bodies[disk, Y] += step * vy
    if spin != 0.0:
        angle = step * spin / bodies[disk, RADIUS]
        cos, sin = bodies[disk, COS], bodies[disk, SIN]
        shrink = 1.0 - 0.5 * angle * angle
        bodies[disk, THETA] += angle
        bodies[disk, COS], bodies[disk, SIN] = (
            shrink * cos - angle * sin,
            shrink * sin + angle * cos,
        )
    return fastest


@njit(cache=True)
def advance(work, friction, physics, step):
    """Move everything on by one step [s]; return the largest speed after it [m/s]."""
    bodies, before = work.bodies, work.before
    for disk in range(1, bodies.shape[0]):
        vx, vy, spin = bodies[disk, VX], bodies[disk, VY], bodies[disk, SPIN]
        before[disk, 0], before[disk, 1], before[disk, 2] = vx, vy, spin
        if vx != 0.0 or vy != 0.0 or spin != 0.0:
            rub(bodies, disk, friction * physics.gravity * step, physics.foot_radius)
    count = find_contacts(step, work)
    solve_contacts(count, physics.tool_friction, physics.disk_friction, work)
    separate(count, work)
    fastest = 0.0
    for disk in range(1, bodies.shape[0]):
        fastest = max(fastest, move(bodies, disk, step, work.pushed[disk], before))
    return fastest


@njit(cache=True)
def load(disks, push, physics, work):
    """Fill the bodies from a scene (N, 8) at rest and a push (3,)."""
    bodies = work.bodies
    for disk in range(disks.shape[0]):
        body = disk + 1
        bodies[body, X], bodies[body, Y] = disks[disk, STATE_X], disks[disk, STATE_Y]
        bodies[body, VX] = bodies[body, VY] = bodies[body, SPIN] = 0.0
        bodies[body, RADIUS] = disks[disk, STATE_RADIUS]
        bodies[body, LIGHTNESS] = 1.0 / disks[disk, STATE_MASS]
        bodies[body, TURN] = bodies[body, LIGHTNESS] / physics.inertia
        theta = disks[disk, STATE_THETA]
        bodies[body, THETA], bodies[body, COS], bodies[body, SIN] = 0.0, np.cos(theta), np.sin(theta)
    offset = bodies[1, RADIUS] + physics.tool_radius + physics.clearance
    bodies[TOOL, X] = bodies[1, X] - offset * np.cos(push[LOCATION])
    bodies[TOOL, Y] = bodies[1, Y] - offset * np.sin(push[LOCATION])
    bodies[TOOL, RADIUS] = physics.tool_radius
    work.impulses[:] = 0.0


@njit(cache=True)
def unload(disks, work):
    """Write the bodies, at rest, back to the scene."""
    bodies = work.bodies
    for disk in range(disks.shape[0]):
        body = disk + 1
        disks[disk, STATE_X], disks[disk, STATE_Y] = bodies[body, X], bodies[body, Y]
        if bodies[body, THETA] != 0.0:
            theta = disks[disk, STATE_THETA] + bodies[body, THETA]
            disks[disk, STATE_THETA] = np.pi - (np.pi - theta) % (2 * np.pi)
        disks[disk, STATE_VELOCITY : STATE_OMEGA + 1] = 0.0


@njit(cache=True)
def touches_another(work):
    """Say whether the tool presses on a disk other than the mid disk."""
    for disk in range(2, work.bodies.shape[0]):
        if work.impulses[disk * (disk - 1) // 2, ALONG] > 0.0:
            return True
    return False


@njit(cache=True)
def push_scene(disks, push, friction, physics, work):
    """Carry out one push in place; say whether the tool touched a disk other than the mid."""
    load(disks, push, physics, work)
    bodies, length = work.bodies, push[LENGTH]
    heading = push[LOCATION] + push[ANGLE]
    way_x, way_y = np.cos(heading), np.sin(heading)
    start_x, start_y = bodies[TOOL, X], bodies[TOOL, Y]
    here = first_touch(bodies, way_x, way_y)
    if here >= length:
        return False
    time = time_of(here, length, physics.speed, physics.acceleration)
    touched = False
    for _ in range(MOST_STEPS):
        step = physics.contact_step
        there = travelled(time + step, length, physics.speed, physics.acceleration)
        speed = (there - here) / step
        bodies[TOOL, X], bodies[TOOL, Y] = start_x + here * way_x, start_y + here * way_y
        bodies[TOOL, VX], bodies[TOOL, VY] = speed * way_x, speed * way_y
        fastest = advance(work, friction, physics, step)
        touched |= touches_another(work)
        time += step
        here = there
        if fastest == 0.0 and here >= length:
            break
    unload(disks, work)
    return touched


@njit(cache=True, parallel=True)
def push_scenes(scenes, pushes, friction, physics, touched):
    """Carry out pushes (B, 3) in place on scenes (B, N, 8) with table friction (B,)."""
    batch, disks, _ = scenes.shape
    for chunk in prange((batch + CHUNK - 1) // CHUNK):
        work = make_workspace(disks)
        for index in range(chunk * CHUNK, min((chunk + 1) * CHUNK, batch)):
            if pushes[index, LENGTH] > 0.0:
                touched[index] = push_scene(
                    scenes[index], pushes[index], friction[index], physics, work
                )
