"""What a predicted sequence of pushes costs: small terms, one weight each, for any goal.

Every term, ours or one that an installed package offers, takes a `Rollout` and an `Objective` and
returns (K,), unweighted. A body with a pose is pushed by the tool, or by another body where the
tool may not touch it: a `Relay`. ``remaining`` fades the terms of a relay that only matter while
there is something left to do: close to the goal it does not matter where the pushing body is.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any, Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.goal import Errors
from sain_core.model import scenes_before
from sain_core.push import BODY, LENGTH, SPEED, idle_pushes
from sain_core.scene import POSITION, RADIUS, THETA, Table, unit
from sain_core.shapes.shape import Shape
from sain_core.types import Mask, Place, Points, PredictedScenes, PushSequences, Scalars, Scenes
from sain_mppi.config import COSTS, CostWeights, further_terms
from sain_mppi.objective.problem import Problem

DONE_WITHIN: Final = 0.01  # [m] of the goal, where alignment, approach and reach fade out
TOOL_GAP: Final = 0.01  # [m], below which the clearance cost begins
REACH_MARGIN: Final = 0.10  # [m] to the limits of the reach, below which its cost begins
LOOK: Final = 0.6  # [s], to see where a push has led, to plan and to begin
AGAIN: Final = 3.0  # [s], of one more push
TRAVEL_SPEED: Final = 0.5  # [m/s], of the tool between strokes
OVER: Final = 0.2  # [m] up and down, over a body
SLOWEST: Final = 1e-3  # [m/s]
ERROR_ROOM: Final = 0.02  # [m], for errors of predictions, where a shape is near the edge


@dataclass(frozen=True)
class Relay:
    """A body with a pose that the tool may not touch, and the body that pushes it."""

    pusher: int
    body: int
    place: Place
    error: Float[ndarray, "K H 2"]  # body minus place after each push
    distance: Float[ndarray, "K H"]
    remaining: Float[ndarray, "K"]  # from 1 to 0 where the body is at its place in the end

    @property
    def to_place(self) -> Points:
        """Directions (K, 2) in which the place lies at the end."""
        return np.asarray(-self.error[:, -1] / np.maximum(self.distance[:, -1:], 1e-9))


@dataclass(frozen=True)
class Rollout:
    """K predicted sequences from one scene, with what several terms need computed once."""

    before: PredictedScenes  # (K, H, N, 8), the scene that each push starts from
    after: PredictedScenes  # (K, H, N, 8), the scene that each push leads to
    pushes: PushSequences  # (K, H, 5)
    moving: Mask  # (K, H), pushes that are not of zero length
    distances: Float[ndarray, "K H"]  # [m], of bodies to their poses, summed
    possible: Mask  # (K, H), pushes that the arm can carry out when their turn comes
    gaps: Float[ndarray, "K H"]  # [m], between the tool and bodies that it does not push
    start: Float[ndarray, "K H 2"]  # [m], where the tool begins,
    end: Float[ndarray, "K H 2"]  # and where it ends
    relays: tuple[Relay, ...]

    @classmethod
    def of(cls, objective: "Objective", pushes: PushSequences, predicted: PredictedScenes) -> Self:
        """Return sequences from the scene of an objective, with their prediction."""
        problem, weights = objective.problem, objective.weights
        before, moving = scenes_before(problem.scene, predicted), pushes[..., LENGTH] > 0.0
        ways = problem.feasibility.assess(before, pushes, problem.bodies)
        gaps = np.where(moving, ways.gaps, np.inf)
        relays = []
        for pose, pusher in zip(problem.goal.poses, problem.pushers, strict=True):
            if pusher != pose.body:
                place = np.array([pose.x, pose.y])
                error = predicted[..., pose.body, POSITION] - place
                distance = np.linalg.norm(error, axis=-1)
                remaining = np.minimum(distance[:, -1] / DONE_WITHIN, 1.0)
                relays.append(Relay(pusher, pose.body, place, error, distance, remaining))
        distances = pose_distance(problem, predicted, weights.lever).sum(axis=-1)
        about = distances, ways.possible, gaps, ways.start, ways.end, tuple(relays)
        return cls(before, predicted, pushes, moving, *about)


Cost = Callable[[Rollout, Any], Scalars]
"""Returns what each of K predicted sequences costs (K,), unweighted, for an `Objective`."""


class Objective:
    """A problem, and how much each term of the cost of its solutions counts."""

    def __init__(self, problem: Problem, weights: CostWeights) -> None:
        self.problem, self.weights = problem, weights
        self.goal, self.bodies = problem.goal, problem.bodies
        self.feasibility = problem.feasibility

    @property
    def distance(self) -> float:
        """The largest distance [m] of a body to its pose, turns as far as they move its points."""
        scene = self.problem.scene
        return float(pose_distance(self.problem, scene, self.weights.lever).max())

    @property
    def has_corners(self) -> bool:
        """Whether the tool may push a body that is not round: such a body turns."""
        return any(not self.bodies.shapes[body].is_round for body in self.bodies.pushable)

    def terms(self, sequences: PushSequences, predicted: PredictedScenes) -> dict[str, Scalars]:
        """Return the cost terms (K,), weighted, of sequences (K, H, 5) from the problem's scene.

        They are not finite where the prediction is not.

        Raises `ConfigError`: a term that an installed package offers fails.
        """
        rollout = Rollout.of(self, sequences, predicted)
        terms = {"position": position(rollout, self)}
        for cost in TERMS:
            terms[cost.__name__] = getattr(self.weights, cost.__name__) * cost(rollout, self)
        for name, weight in further_terms(self.weights.more):
            terms[name] = weight * _further(name, rollout, self)
        return terms

    def rest_cost(self, horizon: int = 1) -> float:
        """Return what doing nothing costs: so many pushes of zero length."""
        scene = self.problem.scene
        stay = np.broadcast_to(scene, (1, horizon, *scene.shape))
        return float(total_cost(self.terms(idle_pushes(1, horizon), stay))[0])


def total_cost(terms: Mapping[str, Scalars]) -> Scalars:
    """Return the sum (K,) of all terms, infinite where any is not finite."""
    total = np.sum(list(terms.values()), axis=0)
    return np.where(np.isfinite(total), total, np.inf)


def pose_distance(problem: Problem, scenes: Scenes, lever: float) -> Errors:
    """Return for each pose (..., P) the root mean square distance [m] of points about the body.

    The points are `lever` circumscribed radii from its middle: sqrt(d^2 + 2 r^2 (1 - cos turn)).
    """
    goal, bodies = problem.goal, problem.bodies
    apart, turns = goal.errors(scenes, bodies)
    if not goal.has_heading:
        return apart
    reach = [bodies.shapes[p.body].circumradius * scenes[..., p.body, RADIUS] for p in goal.poses]
    away = lever * np.stack(reach, axis=-1)
    return np.sqrt(apart**2 + 2.0 * away**2 * (1.0 - np.cos(turns)))


def position(rollout: Rollout, objective: Objective) -> Scalars:
    """Return the paper's Q-weighted squared error (eq. 6), running and terminal."""
    goal, weights = objective.goal, objective.weights
    error = rollout.after[..., goal.wanted, POSITION] - goal.places  # (K, H, P, 2)
    squared = (np.square(error) @ np.asarray(weights.position)).sum(axis=-1)  # (K, H)
    return weights.running * squared[:, :-1].sum(axis=1) + squared[:, -1]


def alignment(rollout: Rollout, objective: Objective) -> Scalars:
    """Return 0 when pushers end straight behind their bodies, seen from the goal, to 1."""

    def term(relay: Relay) -> Scalars:
        last = rollout.after[:, -1]
        to_body = last[:, relay.body, POSITION] - last[:, relay.pusher, POSITION]
        size = np.maximum(np.linalg.norm(to_body, axis=-1), 1e-9)
        cosine = (to_body * relay.to_place).sum(axis=-1) / size
        return relay.remaining * 0.5 * (1.0 - cosine)

    return _over_relays(rollout, term)


def approach(rollout: Rollout, objective: Objective) -> Scalars:
    """Return the distance [m] of pushers at the end to where they touch bodies from behind."""

    def term(relay: Relay) -> Scalars:
        last = rollout.after[:, -1]
        touching = last[:, relay.pusher, RADIUS] + last[:, relay.body, RADIUS]
        spot = last[:, relay.body, POSITION] - touching[:, None] * relay.to_place
        apart = np.linalg.norm(last[:, relay.pusher, POSITION] - spot, axis=-1)
        return np.asarray(relay.remaining * apart)

    return _over_relays(rollout, term)


def caution(rollout: Rollout, objective: Objective) -> Scalars:
    """Return by how much [m] bodies that slide too far would go past the goal for good, summed.

    For good: the tool cannot stand where it would push them back from.
    """
    limits, reach = objective.feasibility.limits, objective.feasibility.reach

    def term(relay: Relay) -> Scalars:
        way = rollout.after[..., relay.body, POSITION] - rollout.before[..., relay.body, POSITION]
        travel = np.linalg.norm(way, axis=-1)  # (K, H)
        heading = way / np.maximum(travel, 1e-9)[..., None]
        left = -(relay.error * heading).sum(axis=-1)
        pusher, body = rollout.before[0, 0, [relay.pusher, relay.body], RADIUS]
        behind = body + 2 * pusher + limits.tool_radius + limits.clearance
        lost = ~reach.contains(relay.place + behind * heading)
        past = np.maximum(objective.weights.uncertainty * travel - left, 0.0)
        return np.asarray((lost * past).sum(axis=1))

    return _over_relays(rollout, term)


def reach(rollout: Rollout, objective: Objective) -> Scalars:
    """Return how far pusher and body end beyond where the tool gets behind them.

    In margins, squared and summed: a pusher in a place without an approach ends the episode.
    """
    region = objective.feasibility.reach

    def term(relay: Relay) -> Scalars:
        place = rollout.after[:, -1, [relay.pusher, relay.body], POSITION]  # (K, 2, 2)
        room = region.room(place)
        return np.asarray(relay.remaining * np.square(_shortfall(room, REACH_MARGIN)).sum(axis=1))

    return _over_relays(rollout, term)


def stranded(rollout: Rollout, objective: Objective) -> Scalars:
    """Return by how much [m] there is no room, at the end, to push bodies straight to their goals.

    Room for the pusher behind the body, on the table, and for the tool behind that, in reach. Disks
    count by `caution` and `reach`.
    """
    bodies, region = objective.bodies, objective.feasibility.reach
    limits, table = objective.feasibility.limits, objective.feasibility.table

    def term(relay: Relay) -> Scalars:
        last, behind = rollout.after[:, -1], -relay.to_place
        rear = _extent(bodies.shapes[relay.body], last[:, relay.body], behind)
        width = bodies.shapes[relay.pusher].width * float(last[0, relay.pusher, RADIUS])
        middle = last[:, relay.body, POSITION] + (rear + width / 2)[:, None] * behind
        away = rear + width + limits.tool_radius + limits.clearance
        tool = last[:, relay.body, POSITION] + away[:, None] * behind
        out_of_reach = np.maximum(-region.room(tool), 0.0)
        off = np.maximum(width / 2 - table_room(middle, table), 0.0)
        return np.asarray(relay.remaining * (out_of_reach + off))

    return np.zeros(len(rollout.after)) if bodies.all_round else _over_relays(rollout, term)


def clearance(rollout: Rollout, objective: Objective) -> Scalars:
    """Return how deep the tool's way enters the gap it should keep, in gaps squared, summed."""
    return np.asarray(np.square(_shortfall(rollout.gaps, TOOL_GAP)).sum(axis=1))


def around(rollout: Rollout, objective: Objective) -> Scalars:
    """Return how far [m] bodies get where the tool can only push them away, summed (K,).

    The tool must get behind a body that has a pose, and beside any other that it may push. What
    the goal itself asks for is no fault.
    """
    goal, bodies = objective.goal, objective.bodies
    ring, limits = objective.feasibility.reach, objective.feasibility.limits
    radii = objective.problem.scene[:, RADIUS]
    there = {pose.body: float(np.hypot(pose.x, pose.y)) for pose in goal.poses}
    behind = {relay.pusher: there[relay.body] - radii[[relay.pusher, relay.body]].sum()
              for relay in rollout.relays}  # fmt: skip
    total = np.zeros(len(rollout.after))
    for body in bodies.pushable:
        need = bodies.shapes[body].circumradius * radii[body] + limits.tool_radius
        need += limits.clearance
        if body in there:
            near, far = min(ring.inner + need, there[body]), max(ring.outer - need, there[body])
        else:
            beside = np.sqrt(max(ring.outer**2 - need**2, 0.0))
            near, far = 0.0, max(beside, behind.get(body, 0.0))
        away = np.linalg.norm(rollout.after[:, :, body, POSITION], axis=-1)  # (K, H)
        total += np.maximum(np.maximum(away - far, near - away), 0.0).max(axis=1)
    return total


def overhang(rollout: Rollout, objective: Objective) -> Scalars:
    """Return how far [m] circumscribed circles of bodies get too near the edge, summed (K,).

    A support that leaves the table tilts its body, and no prior predicts that. So there is room for
    errors with corners. A body may go as near to the edge as its goal is, or else as near as it is
    now.
    """
    bodies, table = objective.bodies, objective.feasibility.table
    placed = objective.goal.placed(objective.problem.scene)
    margin = np.array([0.0 if shape.is_round else ERROR_ROOM for shape in bodies.shapes])
    size = np.array([shape.circumradius for shape in bodies.shapes]) * placed[:, RADIUS] + margin
    needed = np.minimum(size, table_room(placed[:, POSITION], table))
    room = table_room(rollout.after[..., POSITION], table)  # (K, H, N)
    return np.asarray(np.maximum(needed - room, 0.0).max(axis=1).sum(axis=1))


def keep(rollout: Rollout, objective: Objective) -> Scalars:
    """Return how far [m] bodies that may not be moved are moved at most, summed (K,)."""
    kept = list(objective.goal.keep)
    way = rollout.after[:, :, kept, POSITION] - objective.problem.start[kept, POSITION]
    return np.asarray(np.linalg.norm(way, axis=-1).max(axis=1).sum(axis=1))


def distance(rollout: Rollout, objective: Objective) -> Scalars:
    """Return the distances [m] of bodies to their poses after the last push, summed (K,)."""
    return rollout.distances[:, -1]


def running_distance(rollout: Rollout, objective: Objective) -> Scalars:
    """Return the distances [m] of bodies to their poses after all other pushes, summed (K,)."""
    return np.asarray(rollout.distances[:, :-1].sum(axis=1))


def blocked(rollout: Rollout, objective: Objective) -> Scalars:
    """Return how many pushes of a sequence could not be carried out when their turn comes."""
    return np.asarray((~rollout.possible).sum(axis=1, dtype=np.float64))


def duration(rollout: Rollout, objective: Objective) -> Scalars:
    """Return the time (K,) [s] of a sequence: strokes, ways of the tool between them, and looks.

    The tool goes around the body that it pushes next, or over it, whichever is shorter. A sequence
    that ends far from the middle of the tolerance is likely to need another push.
    """
    moving, scene = rollout.moving, objective.problem.scene
    strokes = rollout.pushes[..., LENGTH] / np.maximum(rollout.pushes[..., SPEED], SLOWEST)
    tool = objective.problem.tool
    first = rollout.start[:, :1] if tool is None else np.broadcast_to(tool, (len(moving), 1, 2))
    ends = [first[:, 0]]
    for push in range(rollout.moving.shape[1] - 1):  # a rest leaves the tool where it is
        ends.append(np.where(moving[:, push, None], rollout.end[:, push], ends[-1]))
    before = np.stack(ends, axis=1)
    body = rollout.pushes[..., BODY].astype(np.intp)
    middles = rollout.before[..., POSITION]
    middle = np.take_along_axis(middles, body[..., None, None], axis=2)[:, :, 0]
    radii = scene[:, RADIUS] * [shape.circumradius for shape in objective.bodies.shapes]
    around = way_around(before - middle, rollout.start - middle, radii[body])
    over = np.linalg.norm(rollout.start - before, axis=-1) + OVER
    travel = np.minimum(around, over)
    times = (moving * (strokes + travel / TRAVEL_SPEED + LOOK)).sum(axis=1)
    return np.asarray(times + AGAIN * missed(rollout, objective))


def missed(rollout: Rollout, objective: Objective) -> Scalars:
    """Return how far (K,) sequences end from the goal: 0 at it, 1 where a tolerance is missed."""
    goal = objective.goal
    apart, turns = goal.errors(rollout.after[:, -1], objective.bodies)
    shares = [apart / [pose.tolerance for pose in goal.poses]]
    if goal.has_heading:
        shares.append(np.abs(turns) / [pose.heading_tolerance for pose in goal.poses])
    return np.minimum(np.max(shares, axis=(0, 2)), 1.0)


def way_around(
    start: Float[ndarray, "K H 2"], end: Float[ndarray, "K H 2"], radius: Float[ndarray, "K H"]
) -> Float[ndarray, "K H"]:
    """Return how long [m] the shortest ways about circles at the origin are."""
    from_middle, to_middle = np.linalg.norm(start, axis=-1), np.linalg.norm(end, axis=-1)
    cosine = (start * end).sum(axis=-1) / np.maximum(from_middle * to_middle, 1e-12)
    turn = np.arccos(np.clip(cosine, -1.0, 1.0))
    total = np.zeros_like(turn)
    for far in (from_middle, to_middle):
        turn = turn - np.arccos(np.minimum(radius / np.maximum(far, 1e-12), 1.0))
        total = total + np.sqrt(np.maximum(far**2 - radius**2, 0.0))
    straight = np.linalg.norm(end - start, axis=-1)
    return np.where(turn > 0.0, total + radius * turn, straight)


TERMS: Final[tuple[Cost, ...]] = (
    distance, running_distance, alignment, approach, caution, reach, stranded, clearance, around,
    overhang, keep, blocked, duration,
)  # fmt: skip
"""Each with the weight of its name; `position` has its own."""


@cache
def find_cost(name: str) -> tuple[EntryPoint, Cost]:
    """Return the cost term of this name that an installed package offers, and who offers it.

    Raises `ConfigError`: no package offers it, two do, its package fails, or a term of SAIN has
    this name.
    """
    entry, cost = COSTS.function(name)
    if name in {"position", *(term.__name__ for term in TERMS)}:
        raise COSTS.wrong(entry, "a term of SAIN has this name; rename it")
    return entry, cost


def _further(name: str, rollout: Rollout, objective: Objective) -> Scalars:
    """Return the term (K,) of a package, unweighted."""
    entry, cost = find_cost(name)
    found, right = np.asarray(cost(rollout, objective)), (len(rollout.pushes),)
    if found.shape != right:
        raise COSTS.wrong(entry, f"it returned the shape {found.shape}; it must be {right}")
    if not np.can_cast(found.dtype, np.float64, "same_kind"):
        raise COSTS.wrong(entry, f"it returned {found.dtype}; it must be real numbers")
    values = found.astype(np.float64)
    possible = np.isfinite(rollout.after).all(axis=(1, 2, 3))
    is_judged = len(values) > 1 or not rollout.moving.any()  # one sequence may be impossible
    if is_judged and possible.any() and not np.isfinite(values[possible]).any():
        kind = "NaN" if np.isnan(values[possible]).all() else "NaN or infinite"
        what = f"all {len(values)} samples" if rollout.moving.any() else "doing nothing"
        raise COSTS.wrong(entry, f"it is {kind} for {what}; it must return finite numbers")
    return values


def _over_relays(rollout: Rollout, term: Callable[[Relay], Scalars]) -> Scalars:
    """Return the sum (K,) of a term over the bodies that other bodies push."""
    return np.asarray(sum(map(term, rollout.relays), np.zeros(len(rollout.after))))


def _extent(shape: Shape, states: Float[ndarray, "K 8"], way: Points) -> Scalars:
    """Return how far [m] bodies in these states reach from their middles in directions (K, 2)."""
    heading = np.arctan2(way[:, 1], way[:, 0]) - states[:, THETA]
    return np.asarray((unit(heading) @ shape.outline(1.0).T).max(axis=-1) * states[:, RADIUS])


def table_room(points: Points, table: Table) -> Scalars:
    """Return the distance [m] of points (..., 2) to the nearest edge; negative off the table."""
    x, y = points[..., 0], points[..., 1]
    across = np.minimum(x - table.x_min, table.x_max - x)
    return np.asarray(np.minimum(across, np.minimum(y - table.y_min, table.y_max - y)))


def _shortfall(room: Scalars, wanted: float) -> Scalars:
    """Return 0 where there is as much room as wanted, 1 where there is none, then on."""
    return np.maximum(1.0 - room / wanted, 0.0)
