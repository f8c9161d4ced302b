"""What a predicted sequence of pushes costs: small terms, one weight each, for any goal.

Every term takes a `Rollout` and returns (K,). A body with a pose is pushed by the tool, or by
another body where the tool may not touch it: a `Relay`. ``remaining`` fades the terms of a relay
that only matter while there is something left to do: close to the goal it does not matter where the
pushing body is.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.feasibility import Feasibility, tool_gap
from sain_core.goal import BodyPose, Errors, Goal
from sain_core.model import Radii, scenes_before
from sain_core.push import LENGTH
from sain_core.scene import POSITION, RADIUS, THETA, Table, unit
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.shapes.shape import Shape
from sain_core.types import (
    Mask,
    Place,
    Points,
    PredictedScenes,
    PushSequences,
    Scalars,
    Scene,
    Scenes,
)
from sain_mppi.objective.cost_weights import CostWeights
from sain_mppi.objective.in_reach import pusher_of

ERROR_ROOM: Final = 0.02  # [m], for errors of predictions, where a shape is near the edge


@dataclass(frozen=True)
class Rollout:
    """K predicted sequences from one scene, with what several terms need computed once."""

    before: PredictedScenes  # (K, H, N, 8), the scene that each push starts from
    after: PredictedScenes  # (K, H, N, 8), the scene that each push leads to
    pushes: PushSequences  # (K, H, 5)
    moving: Mask  # (K, H), pushes that are not of zero length
    regions: Radii | None = None  # (K, H, N) [m]; None: not asked for, or not known

    @classmethod
    def of(
        cls,
        scene: Scene,
        pushes: PushSequences,
        predicted: PredictedScenes,
        regions: Radii | None = None,
    ) -> Self:
        """Return sequences from a scene (N, 8) with their prediction."""
        moving = pushes[..., LENGTH] > 0.0
        return cls(scenes_before(scene, predicted), predicted, pushes, moving, regions)


@dataclass(frozen=True)
class Relay:
    """A body with a pose that the tool may not touch, and the body that pushes it."""

    pusher: int
    body: int
    place: Place
    error: Points  # (K, H, 2), body minus place after each push
    distance: Float[ndarray, "K H"]

    @classmethod
    def of(cls, pose: BodyPose, pusher: int, rollout: Rollout) -> Self:
        """Return the relay towards a pose."""
        place = np.array([pose.x, pose.y])
        error = rollout.after[..., pose.body, POSITION] - place
        return cls(pusher, pose.body, place, error, np.linalg.norm(error, axis=-1))


def cost_terms(
    goal: Goal,
    rollout: Rollout,
    weights: CostWeights,
    feasibility: Feasibility,
    bodies: Bodies,
    start: Scene,
) -> dict[str, Scalars]:
    """Return every term (K,), already weighted. Not finite where the prediction is not.

    The goal was given in the scene `start` (N, 8).
    """
    distance = pose_distance(goal, rollout.after, bodies, weights.lever).sum(axis=-1)  # (K, H)
    places = dict(zip(goal.wanted, goal.places, strict=True))
    return {
        "position": position_cost(goal, rollout, weights),
        "distance": weights.distance * distance[:, -1],
        "running": weights.running_distance * distance[:, :-1].sum(axis=1),
        **relay_terms(goal, rollout, weights, feasibility, bodies),
        "clearance": weights.clearance * tool_nearness(rollout, weights, feasibility, bodies),
        "around": weights.around * out_of_hand(goal, rollout, feasibility, bodies),
        "edge": weights.edge * edge_nearness(rollout, places, weights, feasibility),
        "overhang": weights.overhang * overhang(rollout, places, feasibility, bodies),
        "keep": weights.keep * kept_moved(goal, rollout, start),
        "blocked": weights.blocked * blocked_pushes(rollout, feasibility, bodies),
        "risk": weights.risk * wanted_regions(goal, rollout),
        "effort": weights.effort * rollout.pushes[..., LENGTH].sum(axis=1),
        "pushes": weights.pushes * rollout.moving.sum(axis=1),
    }


def total_cost(terms: dict[str, Scalars]) -> Scalars:
    """Return the sum (K,) of all terms, infinite where any is not finite."""
    total = np.sum(list(terms.values()), axis=0)
    return np.where(np.isfinite(total), total, np.inf)


def pose_distance(goal: Goal, scenes: Scenes, bodies: Bodies, lever: float) -> Errors:
    """Return for each pose (..., P) the root mean square distance [m] of points about the body.

    The points are `lever` circumscribed radii from its middle: sqrt(d^2 + 2 r^2 (1 - cos turn)).
    """
    apart, turns = goal.errors(scenes, bodies)
    reach = [bodies.shapes[p.body].circumradius * scenes[..., p.body, RADIUS] for p in goal.poses]
    away = lever * np.stack(reach, axis=-1)
    return np.sqrt(apart**2 + 2.0 * away**2 * (1.0 - np.cos(turns)))


def position_cost(goal: Goal, rollout: Rollout, weights: CostWeights) -> Scalars:
    """Return the paper's Q-weighted squared error (eq. 6), running and terminal."""
    error = rollout.after[..., goal.wanted, POSITION] - goal.places  # (K, H, P, 2)
    squared = (np.square(error) @ np.asarray(weights.position)).sum(axis=-1)  # (K, H)
    return weights.running * squared[:, :-1].sum(axis=1) + weights.terminal * squared[:, -1]


def relay_terms(
    goal: Goal,
    rollout: Rollout,
    weights: CostWeights,
    feasibility: Feasibility,
    bodies: Bodies,
) -> dict[str, Scalars]:
    """Return the terms (K,) of bodies that other bodies push, weighted; without any, none."""
    terms: dict[str, Scalars] = {}
    for pose in goal.poses:
        if (pusher := pusher_of(goal, pose.body, bodies)) == pose.body:
            continue
        relay = Relay.of(pose, pusher, rollout)
        remaining = np.minimum(relay.distance[:, -1] / weights.done_within, 1.0)  # (K,)
        for name, term in {
            "alignment": weights.alignment * remaining * misalignment(relay, rollout),
            "approach": weights.approach * remaining * approach_distance(relay, rollout),
            "caution": weights.caution * overshoot_risk(relay, rollout, weights, feasibility),
            "reach": weights.reach * remaining * reach_excess(relay, rollout, weights, feasibility),
            "stranded": weights.stranded
            * remaining
            * stranded(relay, rollout, feasibility, bodies),
        }.items():
            terms[name] = terms.get(name, 0.0) + term
    return terms


def misalignment(relay: Relay, rollout: Rollout) -> Scalars:
    """Return 0 when the mid disk ends straight behind the target, seen from the goal, to 1."""
    last = rollout.after[:, -1]
    to_target = last[:, relay.body, POSITION] - last[:, relay.pusher, POSITION]
    to_goal = -relay.error[:, -1]
    size = np.linalg.norm(to_target, axis=-1) * relay.distance[:, -1]
    cosine = (to_target * to_goal).sum(axis=-1) / np.maximum(size, 1e-9)
    return 0.5 * (1.0 - cosine)


def approach_distance(relay: Relay, rollout: Rollout) -> Scalars:
    """Return the mid disk's distance [m] at the end to where it touches the target from behind."""
    last = rollout.after[:, -1]
    to_goal = -relay.error[:, -1] / np.maximum(relay.distance[:, -1:], 1e-9)
    touching = last[:, relay.pusher, RADIUS] + last[:, relay.body, RADIUS]
    spot = last[:, relay.body, POSITION] - touching[:, None] * to_goal
    return np.asarray(np.linalg.norm(last[:, relay.pusher, POSITION] - spot, axis=-1))


def overshoot_risk(
    relay: Relay, rollout: Rollout, weights: CostWeights, feasibility: Feasibility
) -> Scalars:
    """Return by how much [m] targets that slide too far would go past the goal for good, summed.

    For good: the tool cannot stand where it would push them back from.
    """
    way = rollout.after[..., relay.body, POSITION] - rollout.before[..., relay.body, POSITION]
    travel = np.linalg.norm(way, axis=-1)  # (K, H)
    heading = way / np.maximum(travel, 1e-9)[..., None]
    left = -(relay.error * heading).sum(axis=-1)
    pusher, body = rollout.before[0, 0, [relay.pusher, relay.body], RADIUS]
    behind = body + 2 * pusher + feasibility.limits.tool_radius + feasibility.limits.clearance
    lost = ~feasibility.reach.contains(relay.place + behind * heading)
    return np.asarray((lost * np.maximum(weights.uncertainty * travel - left, 0.0)).sum(axis=1))


def tool_nearness(
    rollout: Rollout, weights: CostWeights, feasibility: Feasibility, bodies: Bodies = PAPER_DISKS
) -> Scalars:
    """Return how deep the tool's way enters the gap it should keep, in gaps squared, summed."""
    gap = tool_gap(rollout.before, rollout.pushes, feasibility.limits, bodies)
    lacking = _shortfall(gap, weights.tool_gap) * rollout.moving
    return np.asarray(np.square(lacking).sum(axis=1))


def reach_excess(
    relay: Relay, rollout: Rollout, weights: CostWeights, feasibility: Feasibility
) -> Scalars:
    """Return how far mid disk and target end beyond where the tool gets behind them.

    In margins, squared and summed: a mid disk pushed to where no approach is left ends the
    episode.
    """
    reach = feasibility.reach
    position = rollout.after[:, -1, [relay.pusher, relay.body], POSITION]  # (K, 2, 2)
    radius = np.linalg.norm(position, axis=-1)
    bearing = np.abs(np.arctan2(position[..., 1], position[..., 0]))
    room = np.minimum(radius - reach.inner, reach.outer - radius)
    room = np.minimum(room, (reach.max_bearing - bearing) * radius)
    return np.asarray(np.square(_shortfall(room, weights.reach_margin)).sum(axis=1))


def out_of_hand(goal: Goal, rollout: Rollout, feasibility: Feasibility, bodies: Bodies) -> Scalars:
    """Return how far [m] bodies get where the tool can only push them further away, summed (K,).

    The tool must get around a body that has a pose, and beside any other that it may push.
    """
    asked = {}  # how near to the base a pushing body can be when the pushed one is at its goal
    for pose in goal.poses:
        pusher = pusher_of(goal, pose.body, bodies)
        if pusher != pose.body:
            radii = rollout.before[0, 0, [pusher, pose.body], RADIUS]
            asked[pusher] = float(np.hypot(pose.x, pose.y) - radii.sum())
    return reach_around(goal, rollout, feasibility, bodies) + pushers_lost(
        rollout, asked, feasibility, bodies, others=goal.wanted
    )


def reach_around(goal: Goal, rollout: Rollout, feasibility: Feasibility, bodies: Bodies) -> Scalars:
    """Return how far [m] bodies get where the tool cannot get behind them, at most, summed (K,).

    A body whose far side the tool does not reach can be pushed away and not back.
    """
    reach, limits = feasibility.reach, feasibility.limits
    total = np.zeros(len(rollout.after))
    for pose in goal.poses:
        if pose.body not in bodies.pushable:
            continue
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


def pushers_lost(
    rollout: Rollout,
    asked: Mapping[int, float],
    feasibility: Feasibility,
    bodies: Bodies,
    others: Collection[int] = (),
) -> Scalars:
    """Return how far [m] pushable bodies get beyond where the tool can push them, summed (K,).

    There the tool cannot stand beside them, and so it can only push them further away. What the
    goal itself asks for is no fault: `asked` has the distances [m] of bodies from the base. The
    `others` are judged elsewhere.
    """
    reach, limits = feasibility.reach, feasibility.limits
    total = np.zeros(len(rollout.after))
    for body in sorted(set(bodies.pushable) - set(others)):
        size = bodies.shapes[body].circumradius * float(rollout.before[0, 0, body, RADIUS])
        beside = size + limits.tool_radius + limits.clearance
        far = max(np.sqrt(max(reach.outer**2 - beside**2, 0.0)), asked.get(body, 0.0))
        away = np.linalg.norm(rollout.after[:, :, body, POSITION], axis=-1)  # (K, H)
        total += np.maximum(away - far, 0.0).max(axis=1)
    return total


def edge_nearness(
    rollout: Rollout, goals: Mapping[int, Place], weights: CostWeights, feasibility: Feasibility
) -> Scalars:
    """Return how deep any body's middle enters the margin along the table's edge, worst, squared.

    A body may go as near to the edge as its goal is; `goals` has the places (2,) of bodies.
    """
    table = feasibility.table
    margin = np.full(rollout.after.shape[2], weights.edge_margin)
    for body, goal in goals.items():
        margin[body] = np.clip(_table_room(goal, table), 1e-3, weights.edge_margin)
    lacking = _shortfall(_table_room(rollout.after[..., POSITION], table), margin)  # (K, H, N)
    return np.asarray(np.square(lacking).max(axis=(1, 2)))


def overhang(
    rollout: Rollout, goals: Mapping[int, Place], feasibility: Feasibility, bodies: Bodies
) -> Scalars:
    """Return how far [m] circumscribed circles of bodies get too near the edge, summed (K,).

    A support that leaves the table tilts its body, and no prior predicts that. So there is room for
    errors with corners. A body may go as near to the edge as its goal is, or else as near as it is
    now; `goals` has the places (2,) of bodies.
    """
    total = np.zeros(len(rollout.after))
    for body, shape in enumerate(bodies.fitted(rollout.after.shape[2]).shapes):
        first = rollout.before[0, 0, body]
        size = shape.circumradius * float(first[RADIUS])
        margin = 0.0 if shape.is_round else ERROR_ROOM  # it does not turn
        asked = float(_table_room(goals.get(body, first[POSITION]), feasibility.table))
        room = _table_room(rollout.after[:, :, body, POSITION], feasibility.table)  # (K, H)
        total += np.maximum(min(size + margin, asked) - room, 0.0).max(axis=1)
    return total


def stranded(relay: Relay, rollout: Rollout, feasibility: Feasibility, bodies: Bodies) -> Scalars:
    """Return by how much [m] there is no room, at the end, to push the target straight to its goal.

    Room for body 0 behind the target, on the table, and for the tool behind that, in reach. Disks
    count by `overshoot_risk` and `reach_excess`.
    """
    if bodies.all_round:
        return np.zeros(len(rollout.after))
    last, limits, reach = rollout.after[:, -1], feasibility.limits, feasibility.reach
    behind = relay.error[:, -1] / np.maximum(relay.distance[:, -1:], 1e-9)
    rear = _extent(bodies.shapes[relay.body], last[:, relay.body], behind)
    width = bodies.shapes[relay.pusher].width * float(last[0, relay.pusher, RADIUS])
    middle = last[:, relay.body, POSITION] + (rear + width / 2)[:, None] * behind
    away = rear + width + limits.tool_radius + limits.clearance
    apart = np.linalg.norm(last[:, relay.body, POSITION] + away[:, None] * behind, axis=-1)
    out_of_reach = np.maximum(np.maximum(reach.inner - apart, apart - reach.outer), 0.0)
    off = np.maximum(width / 2 - _table_room(middle, feasibility.table), 0.0)
    return np.asarray(out_of_reach + off)


def _extent(shape: Shape, states: Float[ndarray, "K 8"], way: Points) -> Scalars:
    """Return how far [m] bodies in these states reach from their middles in directions (K, 2)."""
    heading = np.arctan2(way[:, 1], way[:, 0]) - states[:, THETA]
    return np.asarray((unit(heading) @ shape.outline(1.0).T).max(axis=-1) * states[:, RADIUS])


def _table_room(points: Points, table: Table) -> Scalars:
    """Return the distance [m] of points (..., 2) to the nearest edge; negative off the table."""
    x, y = points[..., 0], points[..., 1]
    across = np.minimum(x - table.x_min, table.x_max - x)
    return np.asarray(np.minimum(across, np.minimum(y - table.y_min, table.y_max - y)))


def blocked_pushes(
    rollout: Rollout, feasibility: Feasibility, bodies: Bodies = PAPER_DISKS
) -> Scalars:
    """Return how many pushes of a sequence could not be carried out when their turn comes."""
    blocked, moving = np.zeros(rollout.moving.shape), rollout.moving
    blocked[moving] = ~feasibility.mask(rollout.before[moving], rollout.pushes[moving], bodies)
    return np.asarray(blocked.sum(axis=1))


def wanted_regions(goal: Goal, rollout: Rollout) -> Scalars:
    """Return the radii [m] of the regions that should hold bodies with poses, summed (K,)."""
    if rollout.regions is None:
        return np.zeros(len(rollout.pushes))
    return np.asarray(rollout.regions[..., goal.wanted].sum(axis=(1, 2)))


def kept_moved(goal: Goal, rollout: Rollout, start: Scene) -> Scalars:
    """Return how far [m] bodies that may not be moved are moved at most, summed (K,)."""
    total = np.zeros(len(rollout.after))
    for body in goal.keep:
        way = rollout.after[:, :, body, POSITION] - start[body, POSITION]
        total += np.linalg.norm(way, axis=-1).max(axis=1)
    return total


def _shortfall(room: Scalars, wanted: np.ndarray | float) -> Scalars:
    """Return 0 where there is as much room as wanted, 1 where there is none, then on."""
    return np.maximum(1.0 - room / wanted, 0.0)
