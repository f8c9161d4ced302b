"""Informed proposals: sequences that a person would try, each with random details.

All of them think of the mid disk as a point to be moved over waypoints. A push through its
centre (angle 0) moves it straight ahead by about the tool's travel less its clearance.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import ANGLE, LENGTH, LOCATION, PushLimits, idle_pushes
from sain_core.scene import MID, POSITION, RADIUS, TARGET, unit
from sain_core.types import Place, Points, PushSequences, Scalars, Scene
from sain_mppi.objective.sampling import inside_limits

BEARING_SCATTER = 0.15  # [rad], of the direction in which the target is pushed
ANGLE_SCATTER = 0.1  # [rad], of each push relative to the mid disk's centre
LENGTH_SCATTER = 0.012  # [m], about how far a disk slides on after the tool stops
WIDEST_DETOUR = 1.6  # radius of the way round the target, in touching distances


def straight_sequences(
    scene: Scene,
    goal: Place,
    limits: PushLimits,
    generator: np.random.Generator,
    count: int,
    horizon: int,
) -> PushSequences:
    """Push the mid disk straight at the target and on, until the target should be at the goal."""
    bearing = _bearing_to_goal(scene, goal, generator, count)  # (count,)
    touching = scene[MID, RADIUS] + scene[TARGET, RADIUS]
    last = goal - touching * unit(bearing)  # (count, 2), the mid disk when the target arrives
    strokes = generator.integers(1, horizon + 1, count)
    share = np.minimum(np.arange(horizon + 1) / strokes[:, None], 1.0)  # (count, H + 1)
    start = scene[MID, POSITION]
    waypoints = start + share[..., None] * (last - start)[:, None]
    return _strokes(waypoints, limits, generator)


def go_around_sequences(
    scene: Scene,
    goal: Place,
    limits: PushLimits,
    generator: np.random.Generator,
    count: int,
    horizon: int,
) -> PushSequences:
    """Take the mid disk round the target, either way, to behind it, then push to the goal."""
    bearing = _bearing_to_goal(scene, goal, generator, count)
    touching = scene[MID, RADIUS] + scene[TARGET, RADIUS]
    around = generator.integers(1, max(horizon, 2), count)  # strokes before pushing on
    pushing = generator.integers(1, horizon + 1, count)
    step = np.arange(horizon + 1)
    arc = np.minimum(step / around[:, None], 1.0)
    ahead = np.clip((step - around[:, None]) / pushing[:, None], 0.0, 1.0)
    detour = touching * generator.uniform(1.02, WIDEST_DETOUR, count)
    behind = _arc(scene, bearing, detour, arc, generator)  # (count, H + 1, 2)
    travel = np.linalg.norm(goal - scene[TARGET, POSITION]) + (detour - touching)
    waypoints = behind + (ahead * travel[:, None])[..., None] * unit(bearing)[:, None]
    return _strokes(waypoints, limits, generator)


def _arc(
    scene: Scene,
    bearing: Scalars,
    detour: Scalars,
    arc: Float[ndarray, "K S"],
    generator: np.random.Generator,
) -> Float[ndarray, "K S 2"]:
    """Return points on the way round the target from the mid disk (arc 0) to behind it (1)."""
    offset = scene[MID, POSITION] - scene[TARGET, POSITION]
    start = np.arctan2(offset[1], offset[0])
    turn = np.mod(bearing + np.pi - start, 2 * np.pi)  # counter-clockwise, [0, 2 pi)
    shorter = np.where(turn > np.pi, turn - 2 * np.pi, turn)
    longer = shorter - np.copysign(2 * np.pi, shorter)
    turn = np.where(generator.uniform(size=len(turn)) < 0.75, shorter, longer)
    apart = np.hypot(*offset)
    radius = apart + np.minimum(2 * arc, 1.0) * (detour - apart)[:, None]
    return np.asarray(
        scene[TARGET, POSITION] + radius[..., None] * unit(start + arc * turn[:, None])
    )


def _bearing_to_goal(
    scene: Scene, goal: Place, generator: np.random.Generator, count: int
) -> Scalars:
    way = goal - scene[TARGET, POSITION]
    scatter = BEARING_SCATTER * generator.standard_normal(count)
    return np.asarray(np.arctan2(way[1], way[0]) + scatter)


def _strokes(
    waypoints: Points, limits: PushLimits, generator: np.random.Generator
) -> PushSequences:
    """Turn the mid disk's waypoints (K, H + 1, 2) into pushes (K, H, 5) of allowed length."""
    legs = np.diff(waypoints, axis=1)
    travel = np.linalg.norm(legs, axis=-1)
    pushes = idle_pushes(*travel.shape)
    angle = ANGLE_SCATTER * generator.standard_normal(travel.shape)
    pushes[..., LOCATION] = np.arctan2(legs[..., 1], legs[..., 0]) - angle / 2
    pushes[..., ANGLE] = angle
    scatter = LENGTH_SCATTER * generator.standard_normal(travel.shape)
    length = np.clip(limits.clearance + travel + scatter, 0.0, None)
    longest = limits.max_length - np.abs(scatter)
    pushes[..., LENGTH] = np.where(travel > 1e-6, np.minimum(length, longest), 0.0)
    return inside_limits(pushes, limits)
