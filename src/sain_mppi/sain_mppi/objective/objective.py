"""What a search is for: what sequences of pushes cost, and which are worth trying."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from sain_core.feasibility import Feasibility
from sain_core.goal import BodyPose, Goal
from sain_core.model import Radii
from sain_core.push import ANGLE, BODY, LENGTH, LOCATION, PUSH_SIZE, idle_pushes, push_direction
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.outline import outline_of
from sain_core.types import PredictedScenes, PushSequences, Scalars, Scene
from sain_mppi.objective.candidates import go_around_sequences, straight_sequences
from sain_mppi.objective.cost import Rollout, cost_terms, pose_distance, total_cost
from sain_mppi.objective.cost_weights import CostWeights
from sain_mppi.objective.further_costs import further_costs
from sain_mppi.objective.in_reach import pusher_of
from sain_mppi.objective.sampling import inside_limits, uniform_sequences

STRAIGHT_SHARE: Final = 0.25  # of the candidates through another body; the others go around
SLIDE_SCATTER: Final = 0.3  # of the length of a push towards a pose, as a share of the way there


@dataclass(frozen=True)
class _Aim:
    """Where each drawn push should lead its body, and where that is now."""

    bodies: np.ndarray  # (B,)
    ways: np.ndarray  # (B, 2) [m]


class Objective:
    """Costs and proposals for one goal; the tool touches the bodies that are pushable."""

    def __init__(
        self,
        goal: Goal,
        start: Scene,
        weights: CostWeights,
        feasibility: Feasibility,
        bodies: Bodies,
    ) -> None:
        """Judge pushes towards a goal that was given in a scene `start` (N, 8).

        The arm can carry out pushes as `feasibility` states.
        """
        self.goal, self.start, self.weights = goal, start, weights
        self.feasibility, self.bodies = feasibility, bodies.fitted(len(start))
        self.pushable = self.bodies.pushable

    @property
    def has_corners(self) -> bool:
        """Whether the tool may push a body that is not round: such a body turns."""
        return any(not self.bodies.shapes[body].is_round for body in self.pushable)

    def terms(
        self,
        scene: Scene,
        sequences: PushSequences,
        predicted: PredictedScenes,
        regions: Radii | None = None,
    ) -> dict[str, Scalars]:
        """Return the cost terms (K,), weighted, of sequences (K, H, 5) from a scene (N, 8).

        Raises:
            ConfigError: a term that an installed package offers fails.
        """
        rollout = Rollout.of(scene, sequences, predicted, regions)
        about = self.weights, self.feasibility, self.bodies, self.start
        terms = cost_terms(self.goal, rollout, *about)
        return terms | further_costs(self.weights.more, rollout, self, terms)

    def rest_cost(self, scene: Scene, horizon: int = 1) -> float:
        """Return what doing nothing costs: so many pushes of zero length from a scene (N, 8)."""
        stay = np.broadcast_to(scene, (1, horizon, *scene.shape))
        rest = idle_pushes(1, horizon)
        return float(total_cost(self.terms(scene, rest, stay))[0])

    def uniform(self, generator: np.random.Generator, count: int, horizon: int) -> PushSequences:
        """Draw sequences (count, H, 5) of any allowed pushes, evenly along all outlines."""
        drawn = uniform_sequences(self.feasibility.limits, generator, count, horizon)
        if self.pushable == (0,):
            return drawn
        perimeters = [
            2 * np.pi if shape.is_round else outline_of(shape).perimeter
            for shape in (self.bodies.shapes[body] for body in self.pushable)
        ]
        shares = np.array(perimeters) / sum(perimeters)
        drawn[..., BODY] = generator.choice(self.pushable, (count, horizon), p=shares)
        return drawn

    def candidates(
        self, scene: Scene, generator: np.random.Generator, count: int, horizon: int
    ) -> PushSequences:
        """Return informed proposals (count, H, 5), each with random details.

        Bodies that are far from their poses are drawn more often.
        """
        far = pose_distance(self.goal, scene, self.bodies, self.weights.lever) + 1e-3
        wanted, parts, left = self.goal.wanted, [], count
        pushers = [pusher_of(self.goal, body, self.bodies) for body in wanted]
        direct = np.array(pushers) == wanted
        relays = np.flatnonzero(~direct).tolist()
        for relay in relays:
            last = relay == relays[-1] and not direct.any()
            share = left if last else int(count * far[relay] / far.sum())
            pose, pusher = self.goal.poses[relay], pushers[relay]
            parts.append(self._through(scene, pose, pusher, generator, share, horizon))
            left -= share
        if direct.any():
            parts.append(self._straight_at(scene, far * direct, generator, left, horizon))
        return np.concatenate(parts)

    def _through(
        self,
        scene: Scene,
        pose: BodyPose,
        pusher: int,
        generator: np.random.Generator,
        count: int,
        horizon: int,
    ) -> PushSequences:
        """Return sequences of a pusher that push a body straight on, or go around it first."""
        straight, limits = round(count * STRAIGHT_SHARE), self.feasibility.limits
        pair, place = scene[[pusher, pose.body]], np.array([pose.x, pose.y])
        sequences = np.concatenate(
            [
                straight_sequences(pair, place, limits, generator, straight, horizon),
                go_around_sequences(pair, place, limits, generator, count - straight, horizon),
            ]
        )
        if not self.bodies.shapes[pusher].is_round:
            outline = outline_of(self.bodies.shapes[pusher])
            heading = push_direction(sequences) - scene[pusher, THETA]
            sequences[..., LOCATION], angle = outline.facing(heading)
            sequences[..., ANGLE] = np.clip(angle, -limits.max_angle, limits.max_angle)
        sequences[..., BODY] = pusher
        return sequences

    def _straight_at(
        self,
        scene: Scene,
        shares: Scalars,
        generator: np.random.Generator,
        count: int,
        horizon: int,
    ) -> PushSequences:
        """Return pushes against bodies towards their poses, from sides that face away from them.

        Poses are drawn by their shares (P,).
        """
        aim = self._aim(scene, shares, generator, count * horizon)
        location = generator.uniform(-np.pi, np.pi, (len(aim.bodies), 4))
        facing = np.arctan2(aim.ways[:, 1], aim.ways[:, 0])
        normal = np.stack(
            [self._normals(scene, aim.bodies, column) for column in location.T], axis=1
        )
        apart = wrap_angle(facing[:, None] - normal)
        best = np.argmin(np.abs(apart), axis=1)
        rows = np.arange(len(best))
        limits, pushes = self.feasibility.limits, idle_pushes(len(best))
        pushes[:, LOCATION] = location[rows, best]
        widest = limits.max_angle
        pushes[:, ANGLE] = np.clip(apart[rows, best], -widest, widest)
        way = np.linalg.norm(aim.ways, axis=1)
        scatter = 1.0 + SLIDE_SCATTER * generator.standard_normal(len(best))
        pushes[:, LENGTH] = np.minimum(limits.clearance + way * np.abs(scatter), limits.max_length)
        pushes[:, BODY] = aim.bodies
        return inside_limits(pushes.reshape(count, horizon, PUSH_SIZE), limits)

    def _aim(
        self, scene: Scene, shares: Scalars, generator: np.random.Generator, count: int
    ) -> _Aim:
        chosen = generator.choice(len(shares), count, p=shares / shares.sum())
        body = np.array(self.goal.wanted)[chosen]
        return _Aim(body, self.goal.places[chosen] - scene[body, POSITION])

    def _normals(self, scene: Scene, bodies: np.ndarray, locations: np.ndarray) -> np.ndarray:
        """Return the headings (B,) [rad] of inward normals at locations (B,) on bodies (B,)."""
        normals = locations.copy()
        for body in np.unique(bodies).tolist():
            shape, mine = self.bodies.shapes[body], bodies == body
            if not shape.is_round:
                normals[mine] = outline_of(shape).at(locations[mine])[1] + scene[body, THETA]
        return normals
