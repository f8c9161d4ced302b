"""What a search is for: what sequences of pushes cost, and which are worth trying."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Final

import numpy as np

from sain_core.dynamics import Radii, scenes_before
from sain_core.feasibility import Feasibility
from sain_core.push import ANGLE, LENGTH, LOCATION, PUSH_SIZE, push_direction
from sain_core.scene import MID, POSITION, THETA, wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.shapes.outline import outline_of
from sain_core.types import PredictedScenes, PushSequences, Scalars, Scene
from sain_mppi.search.candidates import go_around_sequences, straight_sequences
from sain_mppi.search.cost import Rollout, cost_terms, make_rollout, total_cost
from sain_mppi.search.cost_weights import CostWeights
from sain_mppi.search.further_costs import further_costs
from sain_mppi.search.goal import Goal
from sain_mppi.search.pose_costs import pose_distance, pose_terms
from sain_mppi.search.poses import PoseGoal
from sain_mppi.search.sampling import inside_limits, uniform_sequences

STRAIGHT_SHARE: Final = 0.25  # of the candidates; the others go around
SLIDE_SCATTER: Final = 0.3  # of the length of a push towards a pose, as a share of the way there


class Objective(ABC):
    """Costs and proposals for one goal."""

    def __init__(
        self, weights: CostWeights, feasibility: Feasibility, bodies: Bodies = PAPER_DISKS
    ) -> None:
        """Judge pushes that the arm can carry out as `feasibility` states."""
        self.weights, self.feasibility, self.bodies = weights, feasibility, bodies
        self.pushable = bodies.pushable
        self.push_size = PUSH_SIZE if self.pushable == (0,) else PUSH_SIZE + 1

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
        """Return the cost terms (K,), weighted, of sequences (K, H, A) from a scene (N, 8).

        Raises:
            ConfigError: a term that an installed package offers fails.
        """
        terms = self.own_terms(scene, sequences, predicted, regions)
        if more := self.weights.more:
            before = scenes_before(scene, predicted)
            rollout = Rollout(before, predicted, sequences, sequences[..., LENGTH] > 0.0)
            terms |= further_costs(more, rollout, self, terms)
        return terms

    @abstractmethod
    def own_terms(
        self,
        scene: Scene,
        sequences: PushSequences,
        predicted: PredictedScenes,
        regions: Radii | None = None,
    ) -> dict[str, Scalars]:
        """Return those of the terms that SAIN itself has."""

    @abstractmethod
    def candidates(
        self, scene: Scene, generator: np.random.Generator, count: int, horizon: int
    ) -> PushSequences:
        """Return informed proposals (count, H, A), each with random details."""

    def rest_cost(self, scene: Scene, horizon: int = 1) -> float:
        """Return what doing nothing costs: so many pushes of zero length from a scene (N, 8)."""
        stay = np.broadcast_to(scene, (1, horizon, *scene.shape))
        rest = np.zeros((1, horizon, self.push_size))
        return float(total_cost(self.terms(scene, rest, stay))[0])

    def uniform(self, generator: np.random.Generator, count: int, horizon: int) -> PushSequences:
        """Draw sequences (count, H, A) of any allowed pushes, evenly along all outlines."""
        drawn = uniform_sequences(self.feasibility.limits, generator, count, horizon)
        if self.push_size == PUSH_SIZE:
            return drawn
        perimeters = [
            2 * np.pi if shape.is_round else outline_of(shape).perimeter
            for shape in (self.bodies.shapes[body] for body in self.pushable)
        ]
        shares = np.array(perimeters) / sum(perimeters)
        body = generator.choice(self.pushable, (count, horizon, 1), p=shares)
        return np.concatenate([drawn, body.astype(np.float64)], axis=-1)


class TargetObjective(Objective):
    """The paper's: disk 0 pushes disk 1 to a place."""

    def __init__(
        self,
        goal: Goal,
        weights: CostWeights,
        feasibility: Feasibility,
        bodies: Bodies = PAPER_DISKS,
    ) -> None:
        """Bring the target to a goal (2,)."""
        super().__init__(weights, feasibility, bodies)
        self.goal = goal

    def own_terms(
        self,
        scene: Scene,
        sequences: PushSequences,
        predicted: PredictedScenes,
        regions: Radii | None = None,
    ) -> dict[str, Scalars]:
        """Return the cost terms (K,); see `sain_mppi.search.cost`."""
        rollout = make_rollout(scene, sequences, predicted, self.goal, regions)
        return cost_terms(rollout, self.weights, self.feasibility, self.bodies)

    def candidates(
        self, scene: Scene, generator: np.random.Generator, count: int, horizon: int
    ) -> PushSequences:
        """Return sequences that push straight on and that go around the target."""
        straight = round(count * STRAIGHT_SHARE)
        limits = self.feasibility.limits
        sequences = np.concatenate(
            [
                straight_sequences(scene, self.goal, limits, generator, straight, horizon),
                go_around_sequences(scene, self.goal, limits, generator, count - straight, horizon),
            ]
        )
        if not self.bodies.shapes[MID].is_round:
            outline, limits = outline_of(self.bodies.shapes[MID]), self.feasibility.limits
            heading = push_direction(sequences) - scene[MID, THETA]
            sequences[..., LOCATION], angle = outline.facing(heading)
            sequences[..., ANGLE] = np.clip(angle, -limits.max_angle, limits.max_angle)
        more = self.push_size - PUSH_SIZE  # the mid disk is body 0
        return np.pad(sequences, ((0, 0), (0, 0), (0, more)))


@dataclass(frozen=True)
class _Aim:
    """Where each drawn push should lead its body, and where that is now."""

    bodies: np.ndarray  # (B,)
    ways: np.ndarray  # (B, 2) [m]


class PoseObjective(Objective):
    """Bodies to poses; the tool touches the bodies that are pushable."""

    bodies: Bodies

    def __init__(
        self,
        goal: PoseGoal,
        start: Scene,
        weights: CostWeights,
        feasibility: Feasibility,
        bodies: Bodies,
    ) -> None:
        """Bring bodies to poses, for a goal that was given in a scene `start` (N, 8)."""
        super().__init__(weights, feasibility, bodies)
        self.goal, self.start = goal, start

    def own_terms(
        self,
        scene: Scene,
        sequences: PushSequences,
        predicted: PredictedScenes,
        regions: Radii | None = None,
    ) -> dict[str, Scalars]:
        """Return the cost terms (K,); see `sain_mppi.search.pose_costs`."""
        before = scenes_before(scene, predicted)
        rollout = Rollout(before, predicted, sequences, sequences[..., LENGTH] > 0.0)
        return pose_terms(
            self.goal, rollout, self.weights, self.feasibility, self.bodies, self.start
        )

    def candidates(
        self, scene: Scene, generator: np.random.Generator, count: int, horizon: int
    ) -> PushSequences:
        """Return pushes against a body towards its pose, from the sides that face away from it.

        Bodies that are far from their poses are drawn more often.
        """
        aim = self._aim(scene, generator, count * horizon)
        location = generator.uniform(-np.pi, np.pi, (len(aim.bodies), 4))
        facing = np.arctan2(aim.ways[:, 1], aim.ways[:, 0])
        normal = np.stack(
            [self._normals(scene, aim.bodies, column) for column in location.T], axis=1
        )
        apart = wrap_angle(facing[:, None] - normal)
        best = np.argmin(np.abs(apart), axis=1)
        rows = np.arange(len(best))
        limits, pushes = self.feasibility.limits, np.zeros((len(best), self.push_size))
        pushes[:, LOCATION] = location[rows, best]
        widest = limits.max_angle
        pushes[:, ANGLE] = np.clip(apart[rows, best], -widest, widest)
        way = np.linalg.norm(aim.ways, axis=1)
        scatter = 1.0 + SLIDE_SCATTER * generator.standard_normal(len(best))
        pushes[:, LENGTH] = np.minimum(limits.clearance + way * np.abs(scatter), limits.max_length)
        if self.push_size > PUSH_SIZE:
            pushes[:, PUSH_SIZE] = aim.bodies
        return inside_limits(pushes.reshape(count, horizon, self.push_size), limits)

    def _aim(self, scene: Scene, generator: np.random.Generator, count: int) -> _Aim:
        far = pose_distance(self.goal, scene, self.bodies, self.weights.lever) + 1e-3
        wanted = [pose for pose in self.goal.poses if pose.body in self.pushable]
        if not wanted:
            body = generator.choice(self.pushable, count)
            return _Aim(body, generator.normal(0.0, 0.05, (count, 2)))
        shares = np.array(
            [d for d, pose in zip(far, self.goal.poses, strict=True) if pose in wanted]
        )
        chosen = generator.choice(len(wanted), count, p=shares / shares.sum())
        body = np.array([pose.body for pose in wanted])[chosen]
        place = np.array([(pose.x, pose.y) for pose in wanted])[chosen]
        return _Aim(body, place - scene[body, POSITION])

    def _normals(self, scene: Scene, bodies: np.ndarray, locations: np.ndarray) -> np.ndarray:
        """Return the headings (B,) [rad] of inward normals at locations (B,) on bodies (B,)."""
        normals = locations.copy()
        for body in np.unique(bodies).tolist():
            shape, mine = self.bodies.shapes[body], bodies == body
            if not shape.is_round:
                normals[mine] = outline_of(shape).at(locations[mine])[1] + scene[body, THETA]
        return normals


def make_objective(
    goal: Goal | PoseGoal,
    start: Scene,
    weights: CostWeights,
    feasibility: Feasibility,
    bodies: Bodies,
) -> Objective:
    """Return the objective for a goal that was given in a scene `start` (N, 8)."""
    if isinstance(goal, PoseGoal):
        return PoseObjective(goal, start, weights, feasibility, bodies)
    return TargetObjective(goal, weights, feasibility, bodies)
