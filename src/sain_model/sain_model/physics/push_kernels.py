"""Whole pushes of bodies on a table, compiled; blocks of a batch can run in parallel.

Time goes from the tool's first touch until everything lies still again, in steps as long as
what happens allows: to the next collision, to a kink in the tool's speed, to where a body stops.
"""

from typing import NamedTuple

import numpy as np

from sain_model.compute.compiling import callable_kernel, compiled, compiled_apart
from sain_model.physics.body_kernels import (
    TOOL,
    forget_steps,
    keep_impulses,
    load_bodies,
    make_workspace,
    order_bodies,
    outer_speed,
    recall_impulses,
    unload_bodies,
)
from sain_model.physics.contact_kernels import find_touching, first_touch_of
from sain_model.physics.impulse_kernels import (
    COLLISION,
    foresee,
    part_overlaps,
    prepare_impulses,
    press_in,
    solve_impulses,
)
from sain_model.physics.support_kernels import brake, note_lean, resist

CHUNK = 64  # pushes that one thread takes at a time: a third of a millisecond
STILL = 1e-7  # [m/s], slower than this is at rest
SHORTEST_STEP = 2e-4  # [s]
# Limits of steps, over the longest step [s].
STOP_SHARE = 17.5  # [1/s], of a spinning body, share of the time that it takes to stop
STOP_STEP = 5 / 12  # a body about to stop needs no shorter steps
BEND = 2.5  # [rad/s], by which the normal of a pressing contact may turn
CREEP = 5e-4  # [m], bodies that stop within this way after a push have no inertia
FAST = 0.1  # [m/s]
CREEP_STEP = 1e-3  # [m], way of the tool
SHORTEST_CREEP = 0.02  # share of the longest one
CREEP_BEND = 0.05  # [rad], by which the normal of a pressing contact may turn in a step
LONGEST_STEP = 0.02  # [s], for which they are given
MOST_STEPS = 5000  # after a push, and some for each of its longest steps: far beyond any push, but
STEPS_OF_PUSH = 20  # what runs away down a slope is left at last


class Profile(NamedTuple):
    """From rest to rest: speeding up for `ramp`, cruising, and braking for `ramp` until `end`."""

    length: float  # [m]
    acceleration: float  # [m/s^2]
    ramp: float  # [s]
    end: float  # [s]


@compiled
def make_profile(length, speed, acceleration):
    """Return the fastest profile over a length > 0 [m] within a speed and an acceleration."""
    ramp = min(speed / acceleration, np.sqrt(length / acceleration))
    return Profile(length, acceleration, ramp, ramp + length / (acceleration * ramp))


@compiled
def travelled(profile, time):
    """Return how far [m] the tool has come."""
    if time >= profile.end:
        return profile.length
    if time < profile.ramp:
        return 0.5 * profile.acceleration * time * time
    if time < profile.end - profile.ramp:
        return profile.acceleration * profile.ramp * (time - 0.5 * profile.ramp)
    return profile.length - 0.5 * profile.acceleration * (profile.end - time) ** 2


@compiled
def tool_speed(profile, time):
    """Return how fast [m/s] the tool moves."""
    return profile.acceleration * max(min(time, profile.ramp, profile.end - time), 0.0)


@compiled
def time_of(profile, distance):
    """Return when [s] the tool has come this far [m]: the inverse of `travelled`."""
    ramp_length = 0.5 * profile.acceleration * profile.ramp**2
    if distance < ramp_length:
        return np.sqrt(2.0 * distance / profile.acceleration)
    if distance <= profile.length - ramp_length:
        return distance / (profile.acceleration * profile.ramp) + 0.5 * profile.ramp
    left = max(profile.length - distance, 0.0)
    return profile.end - np.sqrt(2.0 * left / profile.acceleration)


@compiled
def until_kink(profile, time):
    """Return how long [s] the tool's acceleration stays as it is; infinite when it is over."""
    if time < profile.ramp - 1e-9:
        return profile.ramp - time
    if time < profile.end - profile.ramp - 1e-9:
        return profile.end - profile.ramp - time
    if time < profile.end - 1e-9:
        return profile.end - time
    return np.inf


@compiled
def calm_time(bodies, tool_speed, physics):
    """Return the longest step [s] in which friction changes no body's motion too much.

    A body that does not spin slides straight and slows evenly: it may stop in one step. A body that
    friction stops from the tool's highest speed [m/s] in the longest step moves quasi-statically:
    the table holds it back, and no step is too long for that (`hold_back`).
    """
    step = physics.longest_step
    for row in range(1, bodies.shape[0]):
        body = bodies[row]
        if tool_speed > body.slowing * physics.longest_step:
            stop = outer_speed(body) / (body.slowing * body.sooner)
            if stop > 0.0:
                if body.spin != 0.0:
                    stop = physics.longest_step * max(STOP_SHARE * stop, STOP_STEP)
                step = min(step, stop)
    return step


@compiled
def carry(body, step):
    """Move a body on by one step [s] with the mean of its velocities before and after.

    Returns a bound on its speed after the step [m/s].
    """
    speed = outer_speed(body)
    if speed < STILL:
        speed = body.vx = body.vy = body.spin = 0.0
    body.x += step * 0.5 * (body.vx + body.before_vx)
    body.y += step * 0.5 * (body.vy + body.before_vy)
    angle = step * 0.5 * (body.spin + body.before_spin)
    if angle != 0.0:
        keep = 1.0 - 0.5 * angle * angle
        cos, sin = keep * body.cos - angle * body.sin, keep * body.sin + angle * body.cos
        scale = 1.5 - 0.5 * (cos * cos + sin * sin)  # Newton's step towards a length of 1
        body.turned += angle
        body.cos, body.sin = scale * cos, scale * sin
    return speed


@compiled
def advance(work, tool_speed, physics, step):
    """Move everything on by one step [s] that contacts were prepared for.

    Returns a bound on the speeds after it [m/s].
    """
    for row in range(1, work.bodies.shape[0]):
        body = work.bodies[row]
        body.before_vx, body.before_vy, body.before_spin = body.vx, body.vy, body.spin
        body.grip, body.stuck = 0.0, False
        if body.lightness == 0.0:
            continue
        body.vx += step * body.slope_x
        body.vy += step * body.slope_y
        less = body.slowing * step
        if outer_speed(body) > 2.0 * less * body.sooner:
            brake(work, row, less, physics, step)
        else:
            body.grip = less
            body.held_x = body.held_y = body.held_spin = 0.0
    solve_impulses(work, tool_speed)
    note_lean(work, physics, step)
    part_overlaps(work)
    fastest = 0.0
    for row in range(1, work.bodies.shape[0]):
        body = work.bodies[row]
        fastest = max(fastest, carry(body, step))
        body.change_x = (body.vx - body.before_vx) / step
        body.change_y = (body.vy - body.before_vy) / step
        body.change_spin = (body.spin - body.before_spin) / step
    press_in(work, step)
    return fastest


@compiled
def plan_step(work, tool_speed, physics, rest):
    """Let collide what collides now, list the contacts, and return a step of at most `rest` [s]."""
    keep_impulses(work)
    step = min(rest, calm_time(work.bodies, tool_speed, physics))
    find_touching(work, step)
    recall_impulses(work)
    impact, approach, turning = foresee(work, step, physics)
    if approach > COLLISION:
        forget_steps(work)
        prepare_impulses(work, 0.0, physics)
        solve_impulses(work, tool_speed)
        step = min(rest, calm_time(work.bodies, tool_speed, physics))
        keep_impulses(work)
        find_touching(work, step)
        recall_impulses(work)
        impact, approach, turning = foresee(work, step, physics)
    step = min(step, max(impact, SHORTEST_STEP))
    bend = BEND * physics.longest_step
    if turning * step > bend:
        step = max(bend / turning, SHORTEST_STEP)
    return step


@compiled
def creeps(bodies, speed, physics):
    """Return whether friction stops all bodies at once that have the tool's speed [m/s].

    Where contacts give, forces change in time. Fast tools are left to the dynamics: what stops at
    once from their speed is held by more than Coulomb's friction on any table.
    """
    if physics.tool_compliance > 0.0 or physics.body_compliance > 0.0 or speed > FAST:
        return False
    for row in range(1, bodies.shape[0]):
        body = bodies[row]
        if body.lightness > 0.0:
            if body.slope_x != 0.0 or body.slope_y != 0.0:
                return False
            if speed * speed > 2.0 * CREEP * body.slowing:
                return False
    return True


@compiled_apart
def creep(push, distance, physics, work):
    """Carry out a push that is so slow that forces balance at all times, from the first touch on.

    There is no time in it but that in which the tool moves: steps are ways of the tool.
    """
    bodies, tool = work.bodies, work.bodies[TOOL]
    way_x, way_y, length, speed = np.cos(push[2]), np.sin(push[2]), push[3], push[4]
    longest = CREEP_STEP / LONGEST_STEP * physics.longest_step / speed
    for row in range(bodies.shape[0]):
        bodies[row].creep_x, bodies[row].creep_y = speed * way_x, speed * way_y
        bodies[row].creep_spin = 0.0
    tool.vx, tool.vy = speed * way_x, speed * way_y
    while distance < length:
        tool.x, tool.y = tool.start_x + distance * way_x, tool.start_y + distance * way_y
        rest = (length - distance) / speed
        keep_impulses(work)
        find_touching(work, min(longest, rest))
        recall_impulses(work)
        impact, _, turning = foresee(work, min(longest, rest), physics)
        step = min(max(impact, SHORTEST_CREEP * longest), rest)
        if turning * step > CREEP_BEND:
            step = min(max(CREEP_BEND / turning, SHORTEST_CREEP * longest), rest)
        for row in range(1, bodies.shape[0]):
            if bodies[row].lightness > 0.0:
                resist(work, row, physics, speed, step)
        prepare_impulses(work, step, physics)
        for row in range(1, bodies.shape[0]):
            bodies[row].vx = bodies[row].vy = bodies[row].spin = 0.0
        solve_impulses(work, speed)
        note_lean(work, physics, step)
        part_overlaps(work)
        for row in range(1, bodies.shape[0]):
            body = bodies[row]
            if outer_speed(body) > STILL:
                body.creep_x, body.creep_y, body.creep_spin = body.vx, body.vy, body.spin
            body.before_vx, body.before_vy, body.before_spin = body.vx, body.vy, body.spin
            carry(body, step)
        press_in(work, step)
        distance += step * speed if step < rest else length


@compiled_apart
def push_bodies(states, pushed, push, table, physics, own, work):
    """Carry out one push in place; arguments are rows of those of `push_bodies_block`."""
    order_bodies(states, pushed, work.order)
    load_bodies(states, table, push, physics, own, work)
    tool = work.bodies[TOOL]
    way_x, way_y, length, fastest_tool = np.cos(push[2]), np.sin(push[2]), push[3], push[4]
    distance = first_touch_of(work, way_x, way_y)
    if distance >= length:
        return
    if creeps(work.bodies, fastest_tool, physics):
        creep(push, distance, physics, work)
        unload_bodies(states, work)
        return
    profile = make_profile(length, fastest_tool, physics.acceleration)
    time = time_of(profile, distance)
    for _ in range(MOST_STEPS + int(STEPS_OF_PUSH * profile.end / physics.longest_step)):
        speed = tool_speed(profile, time)
        tool.x, tool.y = tool.start_x + distance * way_x, tool.start_y + distance * way_y
        tool.vx, tool.vy = speed * way_x, speed * way_y
        step = plan_step(work, fastest_tool, physics, until_kink(profile, time))
        prepare_impulses(work, step, physics)
        time += step
        distance, speed = travelled(profile, time), tool_speed(profile, time)
        tool.vx, tool.vy = speed * way_x, speed * way_y
        fastest = advance(work, fastest_tool, physics, step)
        if fastest == 0.0 and time >= profile.end - 1e-9:
            break
    unload_bodies(states, work)


@callable_kernel
def push_bodies_block(first, last, scenes, pushed, pushes, table, physics, own):
    """Carry out pushes in place, from the one numbered `first` to before `last`.

    Args:
        first: number of the first one.
        last: number of the one behind the last one; there may be fewer.
        scenes: (B, N, 8), changed to what they become.
        pushed: (B,), bodies.
        pushes: where the tool's axis starts [m], but for the offset of its tip, its heading [rad],
            its way [m], and its highest speed [m/s]; the way to the axis of its second disk [m],
            and whether it is a bar, (B, 8).
        table: of the bodies.
        physics: `PUSH_ROW` of `physics.parameters`, (B,), or (1,) for all.
        own: `BODY_ROW`, (B, N) or (1, N).
    """
    work = make_workspace(table)
    for index in range(first, min(last, scenes.shape[0])):
        if pushes[index, 3] > 0.0:
            row = min(index, physics.shape[0] - 1)
            given = pushes[index], table, physics[row], own[row], work
            push_bodies(scenes[index], pushed[index], *given)
