"""How well predictions explain what was observed, for noise of unknown size.

The error of a body has three parts: x, y, and its turn as a way. It has Student's t distribution
with a scale that grows with the way of the body, times a factor that is one for all pushes of a
row and unknown. Noise of the observation, where it is stated, is added to the scale.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import csr_matrix

from sain_core.scene import POSITION, RADIUS, THETA, wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.transitions import Transitions
from sain_core.types import Indices, Mask
from sain_model.physics.parameters import Values

NOISE: Final = 0.0005  # [m], scale of the error of a disk that hardly moved, times a factor
SHAPE_NOISE: Final = 0.001  # [m], likewise of bodies with corners
SHARE: Final = 0.02  # and by how much it grows, share of the way
FACTORS: Final = np.array([0.5, 1.0, 2.0, 4.0, 8.0])  # equally likely beforehand
TAIL: Final = 3.0  # degrees of freedom of Student's t: a push that nothing explains decides little
SIZE: Final = 3  # of an error: x, y, and a turn as a way
TURN_ARM: Final = 0.5  # [radii], on which a turn counts as a way


@dataclass(frozen=True, eq=False)
class ObservedPushes(Transitions):
    """M pushes of the same bodies, and what is to be explained.

    Attributes:
        episode: which episode each belongs to, (M,); in many recordings counted over all of them.
        bodies: of all scenes.
        noise: (M, N), standard deviation [m] of each coordinate of the way that a body was seen to
            move; None: scenes are exact.
        given: values of parameters that are not inferred, (M,) by name.
    """

    episode: Int[ndarray, "M"]
    bodies: Bodies = PAPER_DISKS
    noise: Float[ndarray, "M N"] | None = None
    given: Values | None = None

    def select(self, rows: Mask | Indices | slice) -> Self:
        """Return some pushes, any of them as often as its number is given."""
        some = super().select(rows)
        if self.given is None:
            return some
        return replace(some, given={name: values[rows] for name, values in self.given.items()})

    def in_episodes(self, episode: Int[ndarray, "M"]) -> Self:
        """Return the same pushes with other episodes."""
        return replace(self, episode=episode)

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
    def everything(cls, pushes: int) -> Self:
        """Return one row with all pushes."""
        return cls(csr_matrix(np.ones((1, pushes))))

    @classmethod
    def first(cls, pushes: int, counts: Int[ndarray, "R"]) -> Self:
        """Return rows with so many of the first pushes each."""
        matrix = np.arange(pushes) < counts[:, None]
        return cls(csr_matrix(matrix.astype(np.float64)))

    @classmethod
    def of_episodes(cls, episodes: Int[ndarray, "M"], count: int) -> Self:
        """Return a row for each of so many episodes, with all of its pushes."""
        order, size = np.argsort(episodes, kind="stable"), len(episodes)
        return cls(csr_matrix((np.ones(size), (episodes[order], order)), shape=(count, size)))

    @classmethod
    def earlier(
        cls,
        episodes: Int[ndarray, "M"],
        steps: Int[ndarray, "M"],
        most: Int[ndarray, "M"] | None = None,
    ) -> Self:
        """Return a row for each push, with the earlier pushes of its episode.

        `most` (M,) limits them to so many of the latest; None: all.
        """
        order, first, _ = _in_episodes(episodes, steps)
        number = np.arange(len(order))
        count = number - first
        if most is not None:
            count = np.minimum(count, most[order])
        return cls(_of_ranges(order, number - count, count))

    @classmethod
    def others(cls, episodes: Int[ndarray, "M"]) -> Self:
        """Return a row for each push, with all other pushes of its episode, later ones too."""
        order, first, count = _in_episodes(episodes, np.zeros_like(episodes))
        matrix = _of_ranges(order, first, count)
        matrix.setdiag(0.0)
        matrix.eliminate_zeros()
        return cls(matrix)

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

    def gather(self, values: Float[ndarray, "P *V"]) -> Float[ndarray, "R *V"]:
        """Return sums over the pairs of each row."""
        count = len(values)
        pairs = csr_matrix(
            (np.ones(count), np.arange(count), self.matrix.indptr), shape=(self.rows, count)
        )
        return type(self)(pairs).total(values)

    def total(self, values: Float[ndarray, "M *V"]) -> Float[ndarray, "R *V"]:
        """Return sums over the pushes of each row."""
        sums = self.matrix @ values.reshape(len(values), int(np.prod(values.shape[1:])))
        return np.asarray(sums).reshape(self.rows, *values.shape[1:])


def _in_episodes(episodes: ndarray, steps: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """Return pushes by episode and step, where each one's episode begins, and its size."""
    order = np.lexsort((steps, episodes))
    _, first, place, count = np.unique(
        episodes[order], return_index=True, return_inverse=True, return_counts=True
    )
    return order, first[place], count[place]


def _of_ranges(order: ndarray, first: ndarray, count: ndarray) -> csr_matrix:
    """Return the matrix in which push order[i] has pushes order[first[i] : first[i] + count[i]]."""
    size = len(order)
    ends = np.cumsum(count)
    places = np.arange(ends[-1] if size else 0) - np.repeat(ends - count - first, count)
    rows = np.repeat(order, count)
    return csr_matrix((np.ones(len(places)), (rows, order[places])), shape=(size, size))


def errors_of(predicted: ndarray, truth: ndarray) -> Float[ndarray, "*B N 3"]:
    """Return errors of bodies [m]: x, y, and the turn on an arm of `TURN_ARM` radii.

    Scenes (*B, N, 8) may be broadcast.
    """
    off = predicted - truth
    turn = TURN_ARM * wrap_angle(off[..., THETA]) * truth[..., RADIUS]
    return np.concatenate([off[..., POSITION], turn[..., None]], axis=-1)


def log_density(errors: ndarray, scales: ndarray) -> Float[ndarray, "*B K"]:
    """Return the logarithm of the density of errors (*B, N, 3) for each of K scales (*B, N, K)."""
    squared = (errors**2).sum(axis=-1)
    terms = -0.5 * (TAIL + SIZE) * np.log1p(squared[..., None] / scales**2 / TAIL)
    return np.asarray((terms - SIZE * np.log(scales)).sum(axis=-2))


def over_factors(log_densities: Float[ndarray, "*B K"]) -> Float[ndarray, "*B"]:
    """Return the logarithm of the mean over the factors."""
    return log_sum(log_densities, -1) - np.log(len(FACTORS))


def log_sum(logarithms: ndarray, axis: int) -> ndarray:
    """Return the logarithm of a sum of exponentials."""
    most = logarithms.max(axis=axis, keepdims=True)
    total = np.log(np.exp(logarithms - most).sum(axis=axis, keepdims=True))
    return np.asarray((most + total).squeeze(axis))
