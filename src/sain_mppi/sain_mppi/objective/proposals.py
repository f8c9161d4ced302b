"""Pushes that are worth trying: uniform draws, and what a person would try with random details."""

from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import (
    ANGLE,
    BODY,
    LENGTH,
    LOCATION,
    PUSH_SIZE,
    SPEED,
    PushLimits,
    idle_pushes,
    push_direction,
)
from sain_core.scene import POSITION, RADIUS, THETA, unit, wrap_angle
from sain_core.shapes.shape import outline_of, outlines_of
from sain_core.types import Angles, Place, Points, PushSequences, Scalars, Scene
from sain_mppi.objective.cost import Objective, pose_distance

STRAIGHT_SHARE: Final = 0.25  # of the candidates through another body; the others go around
SLIDE_SCATTER: Final = 0.3  # of the length of a push towards a pose, as a share of the way there
BEARING_SCATTER: Final = 0.15  # [rad], of the direction in which a body is pushed by another
ANGLE_SCATTER: Final = 0.1  # [rad], of each push relative to the pusher's centre
LENGTH_SCATTER: Final = 0.012  # [m], about how far a disk slides on after the tool stops
WIDEST_DETOUR: Final = 1.6  # radius of the way round a body, in touching distances


def reflect(values: Scalars, low: float, high: float) -> Scalars:
    """Fold values back into [low, high] as between two mirrors.

    Unlike clipping it leaves no samples piled up on the bounds.
    """
    span = high - low
    if span == 0.0:
        return np.full_like(values, low)
    folded = np.abs(np.mod(values - low + span, 2 * span) - span)
    return np.clip(low + folded, low, high)  # rounding only


def inside_limits(pushes: PushSequences, limits: PushLimits) -> PushSequences:
    """Bring pushes (..., 5) into the limits: locations wrap, all but bodies reflect."""
    inside = pushes.copy()
    inside[..., LOCATION] = wrap_angle(pushes[..., LOCATION])
    inside[..., ANGLE] = reflect(pushes[..., ANGLE], -limits.max_angle, limits.max_angle)
    inside[..., LENGTH] = reflect(pushes[..., LENGTH], 0.0, limits.max_length)
    inside[..., SPEED] = reflect(pushes[..., SPEED], limits.min_speed, limits.max_speed)
    return inside


def uniform(
    objective: Objective, generator: np.random.Generator, count: int, horizon: int
) -> PushSequences:
    """Draw sequences (count, H, 5) of any allowed pushes, evenly along all outlines."""
    bodies, limits = objective.bodies, objective.feasibility.limits
    drawn = limits.sample(generator, count * horizon).reshape(count, horizon, PUSH_SIZE)
    if len(bodies.pushable) > 1:
        shapes = [bodies.shapes[body] for body in bodies.pushable]
        lengths = [2 * np.pi if one.is_round else outline_of(one).perimeter for one in shapes]
        shares = np.array(lengths) / sum(lengths)
        drawn[..., BODY] = generator.choice(bodies.pushable, (count, horizon), p=shares)
    else:
        drawn[..., BODY] = bodies.pushable[0]
    return drawn


def candidates(
    objective: Objective, generator: np.random.Generator, count: int, horizon: int
) -> PushSequences:
    """Return informed proposals (count, H, 5), each with random details.

    Bodies that are far from their poses are drawn more often.
    """
    problem = objective.problem
    far = pose_distance(problem, problem.scene, objective.weights.lever) + 1e-3
    pushers, parts, left = np.array(problem.pushers), [], count
    direct = pushers == problem.goal.wanted
    relays = np.flatnonzero(~direct).tolist()
    for relay in relays:
        last = relay == relays[-1] and not direct.any()
        share = left if last else int(count * far[relay] / far.sum())
        parts.append(_through(objective, relay, generator, share, horizon))
        left -= share
    if direct.any():
        parts.append(_straight_at(objective, far * direct, generator, left, horizon))
    return np.concatenate(parts)


def _straight_at(
    objective: Objective, shares: Scalars, generator: np.random.Generator, count: int, horizon: int
) -> PushSequences:
    """Return pushes against bodies towards their poses, from sides that face away from them.

    Poses are drawn by their shares (P,).
    """
    goal, limits, scene = objective.goal, objective.feasibility.limits, objective.problem.scene
    chosen = generator.choice(len(shares), count * horizon, p=shares / shares.sum())
    body = np.array(goal.wanted)[chosen]
    way = goal.places[chosen] - scene[body, POSITION]
    location = generator.uniform(-np.pi, np.pi, (len(body), 4))
    facing = np.arctan2(way[:, 1], way[:, 0])
    outlines = outlines_of(objective.bodies.shapes)
    inward = outlines.at(body[:, None], location)[1] + scene[body, THETA, None]
    normal = np.where(outlines.is_round[body, None], location, inward)
    apart = wrap_angle(facing[:, None] - normal)
    best, rows = np.argmin(np.abs(apart), axis=1), np.arange(len(body))
    pushes = idle_pushes(len(body))
    pushes[:, BODY], pushes[:, SPEED] = body, limits.speed
    pushes[:, LOCATION] = location[rows, best]
    pushes[:, ANGLE] = np.clip(apart[rows, best], -limits.max_angle, limits.max_angle)
    scatter = np.abs(1.0 + SLIDE_SCATTER * generator.standard_normal(len(body)))
    length = limits.clearance + np.linalg.norm(way, axis=1) * scatter
    pushes[:, LENGTH] = np.minimum(length, limits.max_length)
    return inside_limits(pushes.reshape(count, horizon, PUSH_SIZE), limits)


def _through(
    objective: Objective, number: int, generator: np.random.Generator, count: int, horizon: int
) -> PushSequences:
    """Return sequences of a pusher that push a body straight on to a pose, or go around it first.

    They think of the pusher as a point to be moved over waypoints. A push through its centre moves
    it straight ahead by about the tool's travel less its clearance.
    """
    problem, limits = objective.problem, objective.feasibility.limits
    pose, pusher = problem.goal.poses[number], problem.pushers[number]
    pair, place = problem.scene[[pusher, pose.body]], np.array([pose.x, pose.y])
    straight = round(count * STRAIGHT_SHARE)
    waypoints = np.concatenate(
        [
            straight_waypoints(pair, place, generator, straight, horizon),
            detour_waypoints(pair, place, generator, count - straight, horizon),
        ]
    )
    sequences = _pushes_along(waypoints, limits, generator)
    shape = objective.bodies.shapes[pusher]
    if not shape.is_round:
        heading = push_direction(sequences) - problem.scene[pusher, THETA]
        sequences[..., LOCATION], angle = outline_of(shape).facing(heading)
        sequences[..., ANGLE] = np.clip(angle, -limits.max_angle, limits.max_angle)
    sequences[..., BODY] = pusher
    return sequences


def straight_waypoints(
    pair: Scene, goal: Place, generator: np.random.Generator, count: int, horizon: int
) -> Float[ndarray, "K S 2"]:
    """Return H + 1 places of a pusher that goes straight at a body, until this is at its goal.

    Each comes at another bearing. `pair` (2, 8) has the pusher and the body.
    """
    bearing = _bearings(pair, goal, generator, count)
    last = goal - pair[:, RADIUS].sum() * unit(bearing)  # (K, 2), when the body arrives
    strokes = generator.integers(1, horizon + 1, count)
    share = np.minimum(np.arange(horizon + 1) / strokes[:, None], 1.0)  # (K, H + 1)
    start = pair[0, POSITION]
    return np.asarray(start + share[..., None] * (last - start)[:, None])


def detour_waypoints(
    pair: Scene, goal: Place, generator: np.random.Generator, count: int, horizon: int
) -> Float[ndarray, "K S 2"]:
    """Return places of a pusher that goes round a body, either way, to behind it, then pushes."""
    bearing = _bearings(pair, goal, generator, count)
    around = generator.integers(1, max(horizon, 2), count)  # strokes before pushing on
    pushing = generator.integers(1, horizon + 1, count)
    step = np.arange(horizon + 1)
    arc = np.minimum(step / around[:, None], 1.0)
    ahead = np.clip((step - around[:, None]) / pushing[:, None], 0.0, 1.0)
    touching = pair[:, RADIUS].sum()
    detour = touching * generator.uniform(1.02, WIDEST_DETOUR, count)
    offset = pair[0, POSITION] - pair[1, POSITION]
    start, apart = np.arctan2(offset[1], offset[0]), np.hypot(*offset)
    turn = np.mod(bearing + np.pi - start, 2 * np.pi)  # counter-clockwise, [0, 2 pi)
    shorter = np.where(turn > np.pi, turn - 2 * np.pi, turn)
    longer = shorter - np.copysign(2 * np.pi, shorter)
    turn = np.where(generator.uniform(size=count) < 0.75, shorter, longer)
    radius = apart + np.minimum(2 * arc, 1.0) * (detour - apart)[:, None]
    behind = pair[1, POSITION] + radius[..., None] * unit(start + arc * turn[:, None])
    travel = np.linalg.norm(goal - pair[1, POSITION]) + (detour - touching)
    return np.asarray(behind + (ahead * travel[:, None])[..., None] * unit(bearing)[:, None])


def _bearings(pair: Scene, goal: Place, generator: np.random.Generator, count: int) -> Angles:
    """Draw directions (count,) [rad] in which a body is pushed to its goal."""
    way = goal - pair[1, POSITION]
    scatter = BEARING_SCATTER * generator.standard_normal(count)
    return np.asarray(np.arctan2(way[1], way[0]) + scatter)


def _pushes_along(
    waypoints: Points, limits: PushLimits, generator: np.random.Generator
) -> PushSequences:
    """Turn waypoints (K, H + 1, 2) of a disk into pushes (K, H, 5) of allowed length."""
    legs = np.diff(waypoints, axis=1)
    travel = np.linalg.norm(legs, axis=-1)
    pushes = idle_pushes(*travel.shape)
    pushes[..., SPEED] = limits.speed
    angle = ANGLE_SCATTER * generator.standard_normal(travel.shape)
    pushes[..., LOCATION] = np.arctan2(legs[..., 1], legs[..., 0]) - angle / 2
    pushes[..., ANGLE] = angle
    scatter = LENGTH_SCATTER * generator.standard_normal(travel.shape)
    length = np.clip(limits.clearance + travel + scatter, 0.0, None)
    longest = limits.max_length - np.abs(scatter)
    pushes[..., LENGTH] = np.where(travel > 1e-6, np.minimum(length, longest), 0.0)
    return inside_limits(pushes, limits)
