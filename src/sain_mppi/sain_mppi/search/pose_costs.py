"""What predicted pushes towards poses of bodies cost: small terms, one weight each."""

import numpy as np

from sain_core.feasibility import Feasibility
from sain_core.push import LENGTH
from sain_core.scene import POSITION, RADIUS
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scalars, Scene, Scenes
from sain_mppi.search.cost import Rollout, blocked_pushes, edge_nearness, overhang, pushers_lost
from sain_mppi.search.cost_weights import CostWeights
from sain_mppi.search.poses import Errors, PoseGoal


def pose_distance(goal: PoseGoal, scenes: Scenes, bodies: Bodies, lever: float) -> Errors:
    """Return for each pose (..., P) the root mean square distance [m] of points about the body.

    The points are `lever` circumscribed radii from its middle: sqrt(d^2 + 2 r^2 (1 - cos turn)).
    """
    apart, turns = goal.errors(scenes, bodies)
    reach = [bodies.shapes[p.body].circumradius * scenes[..., p.body, RADIUS] for p in goal.poses]
    away = lever * np.stack(reach, axis=-1)
    return np.sqrt(apart**2 + 2.0 * away**2 * (1.0 - np.cos(turns)))


def reach_around(
    goal: PoseGoal, rollout: Rollout, feasibility: Feasibility, bodies: Bodies
) -> Scalars:
    """Return how far [m] bodies get where the tool cannot get behind them, at most, summed (K,).

    A body whose far side the tool does not reach can be pushed away and not back.
    """
    reach, limits = feasibility.reach, feasibility.limits
    total = np.zeros(len(rollout.after))
    for pose in goal.poses:
        state = rollout.after[:, :, pose.body]
        radius = np.linalg.norm(state[..., POSITION], axis=-1)  # (K, H)
        size = bodies.shapes[pose.body].circumradius * float(state[0, 0, RADIUS])
        need = size + limits.tool_radius + limits.clearance
        # What the goal itself asks for is no fault.
        there = float(np.hypot(pose.x, pose.y))
        far = np.maximum(reach.outer - need, there)
        near = np.minimum(reach.inner + need, there)
        total += np.maximum(np.maximum(radius - far, near - radius), 0.0).max(axis=1)
    return total


def pose_terms(
    goal: PoseGoal,
    rollout: Rollout,
    weights: CostWeights,
    feasibility: Feasibility,
    bodies: Bodies,
    start: Scene,
) -> dict[str, Scalars]:
    """Return every cost term (K,), already weighted. Not finite where the prediction is not."""
    distance = pose_distance(goal, rollout.after, bodies, weights.lever).sum(axis=-1)  # (K, H)
    places = {pose.body: np.array([pose.x, pose.y]) for pose in goal.poses}
    return {
        "distance": weights.distance * distance[:, -1],
        "running": weights.running_pose * distance[:, :-1].sum(axis=1),
        "around": weights.around
        * (
            reach_around(goal, rollout, feasibility, bodies)
            + pushers_lost(rollout, {}, feasibility, bodies, others=places)
        ),
        "edge": weights.edge * edge_nearness(rollout, places, weights, feasibility),
        "overhang": weights.overhang * overhang(rollout, places, feasibility, bodies),
        "keep": weights.keep * kept_moved(goal, rollout, start),
        "blocked": weights.blocked * blocked_pushes(rollout, feasibility, bodies),
        "effort": weights.effort * rollout.pushes[..., LENGTH].sum(axis=1),
        "pushes": weights.pushes * rollout.moving.sum(axis=1),
    }


def kept_moved(goal: PoseGoal, rollout: Rollout, start: Scene) -> Scalars:
    """Return how far [m] bodies that may not be moved are moved at most, summed (K,)."""
    total = np.zeros(len(rollout.after))
    for body in goal.keep:
        way = rollout.after[:, :, body, POSITION] - start[body, POSITION]
        total += np.linalg.norm(way, axis=-1).max(axis=1)
    return total
