"""How well predictions explain what was observed, for noise of unknown size.

The error of a body has three parts: x, y, and its turn as a way. It has Student's t distribution
with a scale that grows with the way of the body, times a factor that is one for all pushes of a
row and unknown. A small share of errors are outliers: a body that somebody moved, a tool that
slipped, a pose that was misread. Noise of the observation, where it is stated, is added to the
scale. A grid of parameters is inferred by how well each of its places explains the pushes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import Final, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import csr_matrix
from scipy.special import logsumexp

from sain_core.push import pushed_bodies
from sain_core.scene import POSITION, RADIUS, THETA, wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.transitions import Transitions
from sain_core.types import Indices, Mask, Scalars
from sain_model.inference.kinds import Kind, Places
from sain_model.physics.parameters import Values

NOISE: Final = 0.0005  # [m], scale of the error of a disk that hardly moved, times a factor
SHAPE_NOISE: Final = 0.001  # [m], likewise of bodies with corners
SHARE: Final = 0.02  # and by how much it grows, share of the way
FACTORS: Final = np.array([0.5, 1.0, 2.0, 4.0, 8.0])  # equally likely beforehand
TAIL: Final = 3.0  # degrees of freedom of Student's t: a push that nothing explains decides little
OUTLIERS: Final = 0.05  # share of the errors that have nothing to do with the physics
OUTLYING: Final = 0.03  # [m], and their scale
SIZE: Final = 3  # of an error: x, y, and a turn as a way
TURN_ARM: Final = 0.5  # [radii], on which a turn counts as a way


@dataclass(frozen=True, eq=False)
class ObservedPushes(Transitions):
    """M pushes of the same bodies, and what is to be explained."""

    # which episode each belongs to, (M,); in many recordings counted over all of them
    episode: Int[ndarray, "M"]
    bodies: Bodies = PAPER_DISKS  # of all scenes
    # (M, N), standard deviation [m] of each coordinate of the way that a body was seen to move;
    # None: scenes are exact
    noise: Float[ndarray, "M N"] | None = None
    given: Values | None = None  # values of parameters that are not inferred, (M,) by name

    def select(self, rows: Mask | Indices | slice) -> Self:
        """Return some pushes, any of them as often as its number is given."""
        return replace(super().select(rows), given=self.given and self.given_at(rows))

    def given_at(self, rows: Mask | Indices | slice) -> dict[str, ndarray]:
        """Return the given values of some pushes, by name."""
        return {name: values[rows] for name, values in (self.given or {}).items()}

    @property
    def seen(self) -> list[ndarray]:
        """All that inference depends on but the bodies."""
        noise = self.state[:, :0] if self.noise is None else self.noise
        return [self.state, self.action, self.next_state, noise, *(self.given or {}).values()]

    @property
    def alone(self) -> "ObservedPushes":
        """The same pushes without what a data set states besides."""
        return ObservedPushes(
            **{item.name: getattr(self, item.name) for item in fields(ObservedPushes)}
        )

    @cached_property
    def scale(self) -> Float[ndarray, "M N"]:
        """The scale of each body's error [m], for a factor of 1 and exact scenes."""
        way = np.linalg.norm((self.next_state - self.state)[..., POSITION], axis=-1)
        least = NOISE if self.bodies.are_paper_disks else SHAPE_NOISE
        return np.asarray(least + SHARE * way)

    def scales(self, factors: ndarray) -> Float[ndarray, "M N *K"]:
        """Return scales of errors [m] for factors (M, 1) or (K,), with the observation's noise."""
        wide = self.scale[..., None] * factors if factors.ndim == 1 else self.scale * factors
        if self.noise is None:
            return np.asarray(wide)
        return np.hypot(wide, self.noise[..., None] if factors.ndim == 1 else self.noise)


@dataclass(frozen=True, eq=False)
class Known:
    """Which of M pushes each of R rows is conditioned on: a sparse matrix of zeros and ones."""

    matrix: csr_matrix

    @classmethod
    def first(cls, pushes: int, counts: Sequence[int] | Int[ndarray, "R"]) -> Self:
        """Return rows with so many of the first pushes each."""
        matrix = np.arange(pushes) < np.asarray(counts)[:, None]
        return cls(csr_matrix(matrix.astype(np.float64)))

    @classmethod
    def of_episodes(cls, episodes: Int[ndarray, "M"], count: int) -> Self:
        """Return a row for each of so many episodes, with all of its pushes."""
        size = len(episodes)
        return cls(csr_matrix((np.ones(size), (episodes, np.arange(size))), shape=(count, size)))

    @classmethod
    def earlier(cls, episodes: Int[ndarray, "M"], steps: Int[ndarray, "M"]) -> Self:
        """Return a row for each push, with the earlier pushes of its episode."""
        return cls._among(episodes, lambda row, push: steps[push] < steps[row])

    @classmethod
    def others(cls, episodes: Int[ndarray, "M"]) -> Self:
        """Return a row for each push, with all other pushes of its episode, later ones too."""
        return cls._among(episodes, lambda row, push: row != push)

    @classmethod
    def _among(
        cls, episodes: Int[ndarray, "M"], counts: Callable[[ndarray, ndarray], ndarray]
    ) -> Self:
        """Return a row for each push, with those pushes of its episode that count."""
        labels, number = np.unique(episodes, return_inverse=True)
        own = cls.of_episodes(number, len(labels)).matrix
        same = (own.T @ own).tocoo()
        chosen = counts(same.row, same.col)
        pairs = same.row[chosen], same.col[chosen]
        return cls(csr_matrix((np.ones(chosen.sum()), pairs), shape=same.shape))

    @property
    def rows(self) -> int:
        """The number R of rows."""
        return int(self.matrix.shape[0])

    @cached_property
    def counts(self) -> Int[ndarray, "R"]:
        """How many pushes each row is conditioned on."""
        return np.diff(self.matrix.indptr)

    @property
    def row(self) -> Int[ndarray, "P"]:
        """The row of each pair of a row and a push, in order."""
        return np.repeat(np.arange(self.rows), self.counts)

    @property
    def push(self) -> Int[ndarray, "P"]:
        """The push of each pair."""
        return np.asarray(self.matrix.indices)

    def of_rows(self, chosen: Int[ndarray, "C"]) -> Self:
        """Return some rows."""
        return type(self)(self.matrix[chosen])

    def after(self, first: Int[ndarray, "R"]) -> Self:
        """Return the rows without so many of their first pushes."""
        place = np.arange(len(self.push)) - self.matrix.indptr[self.row]
        keep = place >= first[self.row]
        pairs = np.ones(int(keep.sum())), (self.row[keep], self.push[keep])
        return type(self)(csr_matrix(pairs, shape=self.matrix.shape))

    def gather(self, values: Float[ndarray, "P *V"]) -> Float[ndarray, "R *V"]:
        """Return sums over the pairs of each row."""
        count = len(values)
        pairs = np.ones(count), np.arange(count), self.matrix.indptr
        return type(self)(csr_matrix(pairs, shape=(self.rows, count))).total(values)

    def total(self, values: Float[ndarray, "M *V"]) -> Float[ndarray, "R *V"]:
        """Return sums over the pushes of each row."""
        sums = self.matrix @ values.reshape(len(values), int(np.prod(values.shape[1:])))
        return np.asarray(sums).reshape(self.rows, *values.shape[1:])


def errors_of(predicted: ndarray, truth: ndarray) -> Float[ndarray, "*B N 3"]:
    """Return errors of bodies [m]: x, y, and the turn on an arm of `TURN_ARM` radii.

    Scenes (*B, N, 8) may be broadcast.
    """
    off = predicted - truth
    turn = TURN_ARM * wrap_angle(off[..., THETA]) * truth[..., RADIUS]
    return np.concatenate([off[..., POSITION], turn[..., None]], axis=-1)


def log_density(errors: ndarray, scales: ndarray) -> Float[ndarray, "*B K"]:
    """Return the logarithm of the density of errors (*B, N, 3) for each of K scales (*B, N, K)."""
    return np.asarray(_log_mixture(errors, scales)[0].sum(axis=-2))


def weights_of(errors: ndarray, scales: ndarray) -> Float[ndarray, "*B N K"]:
    """Return what errors (*B, N, 3) count in least squares, for scales (*B, N, K).

    They are the weights of Student's t, times the probability that an error is no outlier.
    """
    mixture, inlier = _log_mixture(errors, scales)
    squared = (errors**2).sum(axis=-1)[..., None] / scales**2
    return np.asarray((TAIL + SIZE) / (TAIL + squared) * np.exp(inlier - mixture))


def are_outliers(after: ndarray, pushes: ObservedPushes) -> Mask:
    """Return which pushed bodies (M,) are so far from predicted scenes `after` (M, N, 8)."""
    rows = np.arange(len(pushes)), pushed_bodies(pushes.action)
    errors = errors_of(after, pushes.next_state)[rows][:, None]
    mixture, inlier = _log_mixture(errors, pushes.scales(np.ones(1))[rows][:, None])
    return np.asarray((mixture - inlier > np.log(2.0))[:, 0, 0])


def _log_mixture(errors: ndarray, scales: ndarray) -> tuple[ndarray, ndarray]:
    """Return logarithms (*B, N, K) of the density of errors, and of its part without outliers."""
    squared = (errors**2).sum(axis=-1)[..., None]
    inlier, outlier = (
        np.log(share)
        - 0.5 * (TAIL + SIZE) * np.log1p(squared / scale**2 / TAIL)
        - SIZE * np.log(scale)
        for share, scale in ((1.0 - OUTLIERS, scales), (OUTLIERS, np.hypot(scales, OUTLYING)))
    )
    return np.logaddexp(inlier, outlier), inlier


def over_factors(log_densities: Float[ndarray, "*B K"]) -> Float[ndarray, "*B"]:
    """Return the logarithm of the mean over the factors."""
    return np.asarray(logsumexp(log_densities, axis=-1) - np.log(len(FACTORS)))


CHUNK: Final = 32_768  # predictions at a time: bounds memory
KEPT: Final = 2048  # pushes, of each kind of physics
FEW: Final = 512  # of a history whose curves are kept

Curves = Float[ndarray, "M G K"]  # logarithm of the density of each push at each place and factor


@dataclass(frozen=True, eq=False)
class Marginals:
    """What pushes say about the parameters of a grid, for each of R rows."""

    places: Places  # means of the vectors z; parameters without a grid stay as believed before
    spreads: Places  # standard deviations of z
    log_evidence: Float[ndarray, "R"]  # of the kind of physics with these parameters alone


def marginals(kind: Kind, totals: Float[ndarray, "R G K"]) -> Marginals:
    """Return what pushes whose curves have these totals say."""
    log_weights = totals + kind.grid_log_prior[:, None]
    log_evidence = over_factors(logsumexp(log_weights, axis=1))
    weights = np.exp(logsumexp(log_weights, axis=2) - np.log(len(FACTORS)) - log_evidence[:, None])
    places = weights @ kind.grid
    variance = weights @ kind.grid**2 - places**2
    fixed = np.array([name not in kind.on_grid for name in kind.names], dtype=bool)
    spreads = np.where(fixed, kind.deviations, np.sqrt(np.maximum(variance, 0.0)))
    return Marginals(places, spreads, log_evidence)


def curves_of(kind: Kind, pushes: ObservedPushes) -> Curves:
    """Return how well each place of a kind's grid explains each push.

    Those of a few pushes are kept for the next history, which has one push more.
    """
    if len(pushes) <= FEW and pushes.given is None:
        rows = [[column[index].tobytes() for column in pushes.seen] for index in range(len(pushes))]
        kept = [_place_of(kind, pushes.bodies, *row) for row in rows]
        if new := [index for index, place in enumerate(kept) if not place]:
            fresh = _curves_of(kind, pushes.select(np.array(new)))
            for index, curves in zip(new, fresh, strict=True):
                kept[index].append(curves)
        if kept:
            return np.stack([place[0] for place in kept])
    return _curves_of(kind, pushes)


@lru_cache(KEPT)
def _place_of(kind: Kind, bodies: Bodies, *row: bytes) -> list[Float[ndarray, "G K"]]:
    """Return where the curves of a push are kept, whose arrays are given as bytes."""
    return []


def _curves_of(kind: Kind, pushes: ObservedPushes) -> Curves:
    grid, count = kind.values(kind.grid), len(kind.grid)
    size, parts = max(CHUNK // count, 1), [np.empty((0, count, len(FACTORS)))]
    for first in range(0, len(pushes), size):
        part = pushes.select(slice(first, first + size))
        rows, places = np.repeat(np.arange(len(part)), count), np.tile(np.arange(count), len(part))
        values = {name: some[places] for name, some in grid.items()}
        after = kind.step(
            pushes.bodies, part.state[rows], part.action[rows], values | part.given_at(rows)
        )
        after = after.reshape(len(part), count, *after.shape[1:])
        scales = part.scales(FACTORS)[:, None]
        parts.append(log_density(errors_of(after, part.next_state[:, None]), scales))
    return np.concatenate(parts)


def grid_values(kind: Kind, pushes: ObservedPushes, known: Known) -> dict[str, Scalars]:
    """Return mean values (R,) of a grid's parameters for each row, by name; for training.

    ``Known.others`` says what the rest of an episode's pushes say about the friction of each push.
    A row without pushes has the values of the prior. A push is predicted once at each place of the
    grid, however many rows it is in.
    """
    if not kind.on_grid:
        return {}
    values = kind.values(marginals(kind, known.total(curves_of(kind, pushes))).places)
    return {name: values[name] for name in kind.on_grid}
