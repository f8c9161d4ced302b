"""Which push informs most about the plans that a scenario needs.

Parameters of the physics are believed to be normally distributed: vectors z with a mean and a
covariance. Each push is predicted at the mean and at points one deviation away from it, along
independent directions (an unscented transform). Half the difference of two opposite points is how
the push answers to that direction; what both have in common is curvature, and counts as noise.

A push that is observed shrinks the covariance (Gauss, Kalman). Of many pushes the one is chosen
after which the pushes of typical plans are predicted best: least expected squared error.
Parameters that no plan's push answers to are worth nothing, however uncertain they are.
"""

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.evidence import SIZE, TAIL, ObservedPushes, errors_of
from sain_model.inference.gauss_newton import fit
from sain_model.inference.kinds import Kind
from sain_model.inference.posterior import STEPS

HEAVY: Final = (TAIL + SIZE + 2) / (TAIL + SIZE)  # variance that Student's t is worth, in scales^2
ONE: Final = np.zeros(1, np.int64)  # the problem of an episode alone


@dataclass(frozen=True, eq=False)
class Certainty:
    """How certain the parameters of a kind of physics are.

    Attributes:
        kind: of physics.
        place: the most likely vector z.
        covariance: of z, in the episode that goes on.
        factor: of the noise of pushes, see `sain_model.inference.evidence`.
    """

    kind: Kind
    place: Float[ndarray, "D"]
    covariance: Float[ndarray, "D D"]
    factor: float = 1.0

    @classmethod
    def of(cls, model: SainDynamics, bodies: Bodies, history: PushHistory) -> Self:
        """Return how certain a model is in an episode with these earlier pushes."""
        now = model.with_bodies(bodies).condition(history).now.posterior
        kind = model.belief.kinds[now.kind[0]]
        place = now.places[0, : len(kind.names)]
        if len(history) == 0 or not kind.names:
            return cls(kind, place, kind.covariance)
        fitted = fit(kind, [model.with_bodies(bodies).observed(history)], place[None], ONE, STEPS)
        return cls(kind, fitted.places[0], fitted.covariance[0], float(fitted.factor[0]))

    def doubled(self, before: Self) -> Self:
        """Return how certain as many pushes more would make it, from what came since `before`."""
        information = np.linalg.inv(self.covariance)
        gained = information
        if before.kind.names == self.kind.names:
            sizes, directions = np.linalg.eigh(information - np.linalg.inv(before.covariance))
            gained = directions * np.maximum(sizes, 0.0) @ directions.T
        return replace(self, covariance=np.linalg.inv(information + gained))

    @property
    def named(self) -> dict[str, tuple[float, float]]:
        """The value of each parameter and its spread: of the logarithm, if it is a factor."""
        values = self.kind.values(self.place[None])
        spreads = np.sqrt(np.diag(self.covariance))
        return {
            one.name: (float(values[one.name][0]), float(one.spread * spread))
            for one, spread in zip(self.kind.parameters, spreads, strict=True)
        }

    @property
    def root(self) -> Float[ndarray, "D D"]:
        """L with L L^T the covariance: a column for each independent direction."""
        return np.asarray(np.linalg.cholesky(self.covariance))


@dataclass(frozen=True, eq=False)
class Answers:
    """How B pushes answer to what is not certain.

    Attributes:
        after: the predicted scenes (B, N, 8), at the mean.
        extremes: those at the points one deviation away.
        slopes: change of x, y and turn [m] of each body along each direction.
        curvature: variance [m^2] of what is not linear.
    """

    after: Scenes
    extremes: Float[ndarray, "B P N 8"]
    slopes: Float[ndarray, "B M D"]
    curvature: Float[ndarray, "B M"]


def answers(certainty: Certainty, bodies: Bodies, scenes: Scenes, pushes: Pushes) -> Answers:
    """Return how pushes (B, A) from scenes (B, N, 8) answer to what is not certain."""
    kind, root = certainty.kind, certainty.root
    batch, count = len(pushes), len(root)
    points = np.concatenate([np.zeros((1, count)), root.T, -root.T])  # (P, D)
    rows = np.repeat(np.arange(batch), len(points))
    values = kind.values(np.tile(certainty.place + points, (batch, 1)))
    after = kind.step(bodies, scenes[rows], pushes[rows], values)
    after = after.reshape(batch, len(points), *scenes.shape[1:])
    off = errors_of(after[:, 1:], after[:, :1]).reshape(batch, 2, count, -1)
    slopes = (off[:, 0] - off[:, 1]) / 2  # (B, D, M)
    bends = (off[:, 0] + off[:, 1]) / 2
    return Answers(
        after[:, 0],
        after[:, 1:],
        np.swapaxes(slopes, 1, 2),
        (bends**2).sum(axis=1) / 2,
    )


def variance_of(
    certainty: Certainty, bodies: Bodies, scenes: Scenes, pushes: Pushes, after: Scenes
) -> Float[ndarray, "B M"]:
    """Return the variance [m^2] of what is observed of pushes that lead to scenes (B, N, 8)."""
    episodes = np.zeros(len(pushes), np.int64)
    observed = ObservedPushes(scenes, pushes, after, episodes, bodies)
    scales = observed.scales(np.full((len(pushes), 1), certainty.factor))
    return np.asarray(np.repeat(HEAVY * scales**2, SIZE, axis=-1))


@dataclass(frozen=True, eq=False)
class Work:
    """Pushes of typical plans: from scenes (B, N, 8), all with these bodies."""

    bodies: Bodies
    scenes: Scenes
    pushes: Pushes

    def needs(self, certainty: Certainty) -> Float[ndarray, "D D"]:
        """Return what errors of parameters cost: z^T A z is the mean squared error [m^2] of places.

        What each episode has of its own is not counted: another episode has another value of it.
        The directions are those of z.
        """
        slopes = answers(certainty, self.bodies, self.scenes, self.pushes).slopes
        places = slopes.reshape(len(slopes), -1, SIZE, slopes.shape[-1])[:, :, :2]
        cost = np.einsum("bnid,bnie->de", places, places) / len(slopes)
        inverse = np.linalg.inv(certainty.root)
        cost = inverse.T @ cost @ inverse
        own = certainty.kind.of_episode
        return np.where(own[:, None] | own, 0.0, cost)


def gains(
    found: Answers, variance: Float[ndarray, "B M"], needs: Float[ndarray, "D D"], root: ndarray
) -> Scalars:
    """Return by how much each of B pushes would reduce the expected squared error [m^2] of work."""
    noise = (variance + found.curvature)[..., None] * np.eye(variance.shape[-1])
    slopes = found.slopes
    total = slopes @ np.swapaxes(slopes, 1, 2) + noise
    cost = root.T @ needs @ root
    benefit = slopes @ cost @ np.swapaxes(slopes, 1, 2)
    return np.asarray(np.trace(np.linalg.solve(total, benefit), axis1=1, axis2=2))


def expected_error(certainty: Certainty, needs: Float[ndarray, "D D"]) -> float:
    """Return the root of the squared error [m] of work that uncertain parameters leave."""
    return float(np.sqrt(max(np.trace(needs @ certainty.covariance), 0.0)))
