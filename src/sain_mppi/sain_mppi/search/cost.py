"""What a predicted sequence of pushes costs: small terms, one weight each.

Every term takes a `Rollout` and returns (K,). ``remaining`` fades the terms that only matter
while there is something left to do: close to the goal it does not matter where the mid disk is.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.dynamics import Radii, scenes_before
from sain_core.feasibility import Feasibility, tool_gap
from sain_core.push import LENGTH
from sain_core.scene import MID, POSITION, RADIUS, TARGET, THETA, Table, unit
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.shapes.shape import Shape
from sain_core.types import Mask, Points, PredictedScenes, PushSequences, Scalars, Scene
from sain_mppi.search.cost_weights import CostWeights
from sain_mppi.search.goal import Goal

ERROR_ROOM: Final = 0.02  # [m], for errors of predictions, where a shape is near the edge


@dataclass(frozen=True)
class Rollout:
    """K predicted sequences from one scene, with what several terms need computed once."""

    before: PredictedScenes  # (K, H, N, 8), the scene that each push starts from
    after: PredictedScenes  # (K, H, N, 8), the scene that each push leads to
    pushes: PushSequences  # (K, H, A)
    moving: Mask  # (K, H), pushes that are not of zero length


@dataclass(frozen=True)
class TargetRollout(Rollout):
    """A rollout towards a goal of the target."""

    goal: Goal
    error: Points  # (K, H, 2), target minus goal after each push
    distance: Float[ndarray, "K H"]
    regions: Radii | None = None  # (K, H, N) [m]; None: not asked for, or not known


def make_rollout(
    scene: Scene,
    pushes: PushSequences,
    predicted: PredictedScenes,
    goal: Goal,
    regions: Radii | None = None,
) -> TargetRollout:
    """Bundle sequences, their prediction and the goal for the cost terms."""
    before = scenes_before(scene, predicted)
    error = predicted[..., TARGET, POSITION] - goal
    distance = np.linalg.norm(error, axis=-1)
    moving = pushes[..., LENGTH] > 0.0
    return TargetRollout(before, predicted, pushes, moving, goal, error, distance, regions)


def cost_terms(
    rollout: TargetRollout,
    weights: CostWeights,
    feasibility: Feasibility,
    bodies: Bodies = PAPER_DISKS,
) -> dict[str, Scalars]:
    """Return every term (K,), already weighted. Not finite where the prediction is not."""
    asked = {MID: mid_asked(rollout)}
    remaining = np.minimum(rollout.distance[:, -1] / weights.done_within, 1.0)  # (K,)
    return {
        "position": position_cost(rollout, weights),
        "distance": weights.distance * rollout.distance[:, -1],
        "alignment": weights.alignment * remaining * misalignment(rollout),
        "approach": weights.approach * remaining * approach_distance(rollout),
        "caution": weights.caution * overshoot_risk(rollout, weights, feasibility),
        "clearance": weights.clearance * tool_nearness(rollout, weights, feasibility, bodies),
        "reach": weights.reach * remaining * reach_excess(rollout, weights, feasibility),
        "around": weights.around * pushers_lost(rollout, asked, feasibility, bodies),
        "edge": weights.edge * edge_nearness(rollout, {TARGET: rollout.goal}, weights, feasibility),
        "overhang": weights.overhang
        * overhang(rollout, {TARGET: rollout.goal}, feasibility, bodies),
        "stranded": weights.stranded * remaining * stranded(rollout, feasibility, bodies),
        "blocked": weights.blocked * blocked_pushes(rollout, feasibility, bodies),
        "risk": weights.risk * target_regions(rollout),
        "effort": weights.effort * rollout.pushes[..., LENGTH].sum(axis=1),
        "pushes": weights.pushes * rollout.moving.sum(axis=1),
    }


def total_cost(terms: dict[str, Scalars]) -> Scalars:
    """Return the sum (K,) of all terms, infinite where any is not finite."""
    total = np.sum(list(terms.values()), axis=0)
    return np.where(np.isfinite(total), total, np.inf)


def position_cost(rollout: TargetRollout, weights: CostWeights) -> Scalars:
    """Return the paper's Q-weighted squared error (eq. 6), running and terminal."""
    squared = np.square(rollout.error) @ np.asarray(weights.position)  # (K, H)
    if weights.orientation > 0.0:
        heading = rollout.after[..., TARGET, THETA]
        squared = squared + weights.orientation * 2.0 * (1.0 - np.cos(heading))
    return weights.running * squared[:, :-1].sum(axis=1) + weights.terminal * squared[:, -1]


def misalignment(rollout: TargetRollout) -> Scalars:
    """Return 0 when the mid disk ends straight behind the target, seen from the goal, to 1."""
    last = rollout.after[:, -1]
    to_target = last[:, TARGET, POSITION] - last[:, MID, POSITION]
    to_goal = -rollout.error[:, -1]
    size = np.linalg.norm(to_target, axis=-1) * rollout.distance[:, -1]
    cosine = (to_target * to_goal).sum(axis=-1) / np.maximum(size, 1e-9)
    return 0.5 * (1.0 - cosine)


def approach_distance(rollout: TargetRollout) -> Scalars:
    """Return the mid disk's distance [m] at the end to where it touches the target from behind."""
    last = rollout.after[:, -1]
    to_goal = -rollout.error[:, -1] / np.maximum(rollout.distance[:, -1:], 1e-9)
    touching = last[:, MID, RADIUS] + last[:, TARGET, RADIUS]
    spot = last[:, TARGET, POSITION] - touching[:, None] * to_goal
    return np.asarray(np.linalg.norm(last[:, MID, POSITION] - spot, axis=-1))


def overshoot_risk(
    rollout: TargetRollout, weights: CostWeights, feasibility: Feasibility
) -> Scalars:
    """Return by how much [m] targets that slide too far would go past the goal for good, summed.

    For good: the tool cannot stand where it would push them back from.
    """
    way = rollout.after[..., TARGET, POSITION] - rollout.before[..., TARGET, POSITION]
    travel = np.linalg.norm(way, axis=-1)  # (K, H)
    heading = way / np.maximum(travel, 1e-9)[..., None]
    left = -(rollout.error * heading).sum(axis=-1)
    mid, target = rollout.before[0, 0, MID, RADIUS], rollout.before[0, 0, TARGET, RADIUS]
    behind = target + 2 * mid + feasibility.limits.tool_radius + feasibility.limits.clearance
    lost = ~feasibility.reach.contains(rollout.goal + behind * heading)
    return np.asarray((lost * np.maximum(weights.uncertainty * travel - left, 0.0)).sum(axis=1))


def tool_nearness(
    rollout: Rollout, weights: CostWeights, feasibility: Feasibility, bodies: Bodies = PAPER_DISKS
) -> Scalars:
    """Return how deep the tool's way enters the gap it should keep, in gaps squared, summed."""
    gap = tool_gap(rollout.before, rollout.pushes, feasibility.limits, bodies)
    lacking = _shortfall(gap, weights.tool_gap) * rollout.moving
    return np.asarray(np.square(lacking).sum(axis=1))


def reach_excess(rollout: TargetRollout, weights: CostWeights, feasibility: Feasibility) -> Scalars:
    """Return how far mid disk and target end beyond where the tool gets behind them.

    In margins, squared and summed: a mid disk pushed to where no approach is left ends the
    episode.
    """
    reach = feasibility.reach
    position = rollout.after[:, -1, [MID, TARGET], POSITION]  # (K, 2, 2)
    radius = np.linalg.norm(position, axis=-1)
    bearing = np.abs(np.arctan2(position[..., 1], position[..., 0]))
    room = np.minimum(radius - reach.inner, reach.outer - radius)
    room = np.minimum(room, (reach.max_bearing - bearing) * radius)
    return np.asarray(np.square(_shortfall(room, weights.reach_margin)).sum(axis=1))


def mid_asked(rollout: TargetRollout) -> float:
    """Return how near to the base [m] the mid disk can be when the target is at its goal."""
    radii = rollout.before[0, 0, [MID, TARGET], RADIUS]
    return float(np.linalg.norm(rollout.goal) - radii.sum())


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
    rollout: Rollout, goals: Mapping[int, Goal], weights: CostWeights, feasibility: Feasibility
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
    rollout: Rollout, goals: Mapping[int, Goal], feasibility: Feasibility, bodies: Bodies
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


def stranded(rollout: TargetRollout, feasibility: Feasibility, bodies: Bodies) -> Scalars:
    """Return by how much [m] there is no room, at the end, to push the target straight to its goal.

    Room for body 0 behind the target, on the table, and for the tool behind that, in reach. Disks
    count by `overshoot_risk` and `reach_excess`.
    """
    if bodies.all_round:
        return np.zeros(len(rollout.after))
    last, limits, reach = rollout.after[:, -1], feasibility.limits, feasibility.reach
    behind = rollout.error[:, -1] / np.maximum(rollout.distance[:, -1:], 1e-9)
    rear = _extent(bodies.shapes[TARGET], last[:, TARGET], behind)
    width = bodies.shapes[MID].width * float(last[0, MID, RADIUS])
    middle = last[:, TARGET, POSITION] + (rear + width / 2)[:, None] * behind
    away = rear + width + limits.tool_radius + limits.clearance
    apart = np.linalg.norm(last[:, TARGET, POSITION] + away[:, None] * behind, axis=-1)
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


def target_regions(rollout: TargetRollout) -> Scalars:
    """Return the radii [m] of the regions that should hold the target, summed over the pushes."""
    if rollout.regions is None:
        return np.zeros(len(rollout.pushes))
    return np.asarray(rollout.regions[..., TARGET].sum(axis=1))


def _shortfall(room: Scalars, wanted: np.ndarray | float) -> Scalars:
    """Return 0 where there is as much room as wanted, 1 where there is none, then on."""
    return np.maximum(1.0 - room / wanted, 0.0)
