"""Whole pushes of round disks on a table, compiled; blocks of a batch can run in parallel.

Time goes from the tool's first touch until everything lies still again, in steps as long as
what happens allows: to the next collision, to a kink in the tool's speed, to where a disk stops.
"""

import numpy as np

from sain_core.push import ANGLE, LENGTH, LOCATION
from sain_model.compute.compiling import callable_kernel, compiled, compiled_apart
from sain_model.physics.body_kernels import (
    ALONG,
    COS,
    DRAG,
    PULL_X,
    PULL_Y,
    RADIUS,
    SIN,
    SPIN,
    TOOL,
    TURNED,
    VX,
    VY,
    X,
    Y,
    forget,
    load,
    make_conditioned_workspace,
    make_workspace,
    place_mass,
    rim_speed,
    unload,
)
from sain_model.physics.contact_kernels import (
    find_contacts,
    note_tilt,
    prepare_contacts,
    separate,
    solve,
)
from sain_model.physics.table_kernels import apply_friction
from sain_model.physics.tool_kernels import make_profile, time_of, tool_speed, travelled, until_kink

CHUNK = 64  # pushes that one thread takes at a time: a third of a millisecond
STILL = 1e-7  # [m/s], slower than this is at rest
COLLISION = 0.01  # [m/s], touching bodies that approach faster than this collide
SHORTEST_STEP = 2e-4  # [s]
MOST_STEPS = 5000  # far beyond any push; keeps a wrong parameter from running for ever


@compiled
def first_touch(bodies, way_x, way_y):
    """Return how far [m] the tool travels until it touches any disk; infinite if never."""
    nearest = np.inf
    for disk in range(1, bodies.shape[0]):
        dx, dy = bodies[disk, X] - bodies[TOOL, X], bodies[disk, Y] - bodies[TOOL, Y]
        rims = bodies[disk, RADIUS] + bodies[TOOL, RADIUS]
        along = dx * way_x + dy * way_y
        squared = rims * rims - (dx * dx + dy * dy - along * along)
        if squared > 0.0 and along > 0.0:
            nearest = min(nearest, max(along - np.sqrt(squared), 0.0))
    return nearest


@compiled
def calm_step(bodies, slowing, physics):
    """Return the longest step [s] in which friction changes no disk's motion too much.

    A disk that does not spin slides straight and slows evenly: it may stop in one step.

    Args:
        bodies: rows of bodies.
        slowing: deceleration of a sliding disk [m/s^2].
        physics: for the limits.
    """
    step = physics.longest_step
    if physics.speed <= slowing * step:  # quasi-static
        return step
    spin_share = max(0.5 * physics.foot_radius / physics.inertia, 1.0)
    for disk in range(1, bodies.shape[0]):
        stop = rim_speed(bodies, disk) / (slowing * spin_share)
        if stop > 0.0:
            if bodies[disk, SPIN] != 0.0:
                stop = max(physics.stop_share * stop, physics.stop_step)
            step = min(step, stop)
    return step


@compiled
def move(bodies, disk, step, before):
    """Move a disk on by one step [s] with the mean of its velocities before and after."""
    if rim_speed(bodies, disk) < STILL:
        bodies[disk, VX] = bodies[disk, VY] = bodies[disk, SPIN] = 0.0
    bodies[disk, X] += step * 0.5 * (bodies[disk, VX] + before[disk, 0])
    bodies[disk, Y] += step * 0.5 * (bodies[disk, VY] + before[disk, 1])
    angle = step * 0.5 * (bodies[disk, SPIN] + before[disk, 2]) / bodies[disk, RADIUS]
    if angle != 0.0:
        cos, sin = bodies[disk, COS], bodies[disk, SIN]
        keep = 1.0 - 0.5 * angle * angle
        bodies[disk, TURNED] += angle
        bodies[disk, COS], bodies[disk, SIN] = keep * cos - angle * sin, keep * sin + angle * cos
        place_mass(bodies, disk)


@compiled
def flow(work, count, slowing, physics, step):
    """Move everything on by one step [s]; return a bound on the speeds after it [m/s].

    Args:
        work: scratch memory with `count` contacts prepared for this step.
        count: number of near pairs.
        slowing: deceleration of a sliding disk [m/s^2].
        physics: for the frictions.
        step: duration [s].
    """
    bodies, before, change = work.bodies, work.before, work.change
    spin_share = max(0.5 * physics.foot_radius / physics.inertia, 1.0)
    for disk in range(1, bodies.shape[0]):
        before[disk, 0], before[disk, 1] = bodies[disk, VX], bodies[disk, VY]
        before[disk, 2] = bodies[disk, SPIN]
        work.grip[disk] = 0.0
        bodies[disk, VX] += step * bodies[disk, PULL_X]
        bodies[disk, VY] += step * bodies[disk, PULL_Y]
        less = slowing * bodies[disk, DRAG] * step
        if rim_speed(bodies, disk) > 2.0 * less * spin_share:
            apply_friction(work, disk, less, physics, step)
        else:
            work.grip[disk] = less
            work.held[disk, 0] = work.held[disk, 1] = work.held[disk, 2] = 0.0
    solve(count, physics, work)
    note_tilt(work, count, physics, step)
    separate(count, work)
    fastest = 0.0
    for disk in range(1, bodies.shape[0]):
        move(bodies, disk, step, before)
        change[disk, 0] = (bodies[disk, VX] - before[disk, 0]) / step
        change[disk, 1] = (bodies[disk, VY] - before[disk, 1]) / step
        change[disk, 2] = (bodies[disk, SPIN] - before[disk, 2]) / step
        fastest = max(fastest, rim_speed(bodies, disk))
    return fastest


@compiled
def collide(work, count, physics):
    """Let touching bodies that approach each other collide, in no time."""
    forget(work)
    prepare_contacts(count, 0.0, physics, work)
    solve(count, physics, work)


@compiled
def look_ahead(work, slowing, physics, rest):
    """Let collide what collides now; return the number of near pairs and a good step [s].

    Args:
        work: scratch memory.
        slowing: deceleration of a sliding disk [m/s^2].
        physics: for the limits.
        rest: the step ends no later than this [s].
    """
    step = min(rest, calm_step(work.bodies, slowing, physics))
    count, impact, approach, turning = find_contacts(work, step)
    if approach > COLLISION:
        collide(work, count, physics)
        step = min(rest, calm_step(work.bodies, slowing, physics))
        count, impact, approach, turning = find_contacts(work, step)
    step = min(step, max(impact, SHORTEST_STEP))
    if turning * step > physics.bend:
        step = max(physics.bend / turning, SHORTEST_STEP)
    return count, step


@compiled
def note_touched(work, touched):
    """Note which disks (N,) the tool presses on."""
    for disk in range(1, work.bodies.shape[0]):
        if work.impulses[disk * (disk - 1) // 2, ALONG] > 0.0:
            touched[disk - 1] = True


@compiled_apart
def push_scene(disks, push, friction, start, physics, work, touched):
    """Carry out one push in place; note which disks (N,) the tool touched."""
    load(disks, push, start, physics, work)
    bodies = work.bodies
    heading = push[LOCATION] + push[ANGLE]
    way_x, way_y = np.cos(heading), np.sin(heading)
    start_x, start_y = bodies[TOOL, X], bodies[TOOL, Y]
    distance = first_touch(bodies, way_x, way_y)
    if distance >= push[LENGTH]:
        return
    profile = make_profile(push[LENGTH], physics.speed, physics.acceleration)
    time = time_of(profile, distance)
    slowing = physics.friction_scale * friction * physics.gravity
    for _ in range(MOST_STEPS):
        speed = tool_speed(profile, time)
        bodies[TOOL, X], bodies[TOOL, Y] = start_x + distance * way_x, start_y + distance * way_y
        bodies[TOOL, VX], bodies[TOOL, VY] = speed * way_x, speed * way_y
        rest = until_kink(profile, time)
        count, step = look_ahead(work, slowing, physics, rest)
        note_touched(work, touched)
        prepare_contacts(count, step, physics, work)
        time += step
        distance, speed = travelled(profile, time), tool_speed(profile, time)
        bodies[TOOL, VX], bodies[TOOL, VY] = speed * way_x, speed * way_y
        fastest = flow(work, count, slowing, physics, step)
        note_touched(work, touched)
        if fastest == 0.0 and time >= profile.end - 1e-9:
            break
    unload(disks, work)


@callable_kernel
def push_block(first, scenes, pushes, friction, start, physics, touched):
    """Carry out up to `CHUNK` pushes, from the one numbered `first` on, in place.

    Args:
        first: number of the first one.
        scenes: (B, N, 8), changed to what they become.
        pushes: (B, 3).
        friction: with the table, (B,).
        start: from the mid disk's centre to the tool's axis before it travels, (B,) [m].
        physics: the rest.
        touched: (B, N) bool, receives which disks the tool touched.
    """
    work = make_workspace(scenes.shape[1])
    for index in range(first, min(first + CHUNK, scenes.shape[0])):
        _push_row(index, scenes, pushes, friction, start, physics, touched, work)


@callable_kernel
def push_conditioned_block(first, scenes, pushes, friction, start, physics, touched, corrections):
    """Carry out up to `CHUNK` pushes as `push_block` does, of disks that are corrected.

    Args: those of `push_block`, and
        corrections: of each disk, (B, N, CORRECTIONS).
    """
    work = make_conditioned_workspace(scenes.shape[1])
    for index in range(first, min(first + CHUNK, scenes.shape[0])):
        for disk in range(corrections.shape[1]):
            for column in range(corrections.shape[2]):  # a slice takes seconds to compile
                work.corrections[disk, column] = corrections[index, disk, column]
        _push_row(index, scenes, pushes, friction, start, physics, touched, work)


@compiled
def _push_row(row, scenes, pushes, friction, start, physics, touched, work):
    """Carry out the push of one row of a batch in place, unless its length is 0."""
    if pushes[row, LENGTH] > 0.0:
        push_scene(scenes[row], pushes[row], friction[row], start[row], physics, work, touched[row])
