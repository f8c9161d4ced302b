"""How well predictions explain what was seen, for noise whose size is not known."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import csr_matrix

from sain_core.dataset import Transitions
from sain_core.scene import POSITION, RADIUS, THETA, wrap_angle
from sain_core.shapes.bodies import Bodies

NOISE: Final = 0.0005  # [m], scale of the error of a disk that hardly moved, times a factor
SHAPE_NOISE: Final = 0.001  # [m], likewise of bodies with corners
SHARE: Final = 0.02  # and by how much it grows, share of the way
FACTORS: Final = np.array([0.5, 1.0, 2.0, 4.0, 8.0])  # equally likely beforehand
TAIL: Final = 3.0  # degrees of freedom of Student's t: a push that nothing explains decides little
SIZE: Final = 3  # of an error: x, y, and a turn as a way
TURN_ARM: Final = 0.5  # [radii], on which a turn counts as a way


@dataclass(frozen=True, eq=False)
class Known:
    """Which of M pushes each of R rows knows, as P pairs in order of the rows."""

    row: Int[ndarray, "P"]
    push: Int[ndarray, "P"]
    rows: int
    pushes: int

    @classmethod
    def everything(cls, pushes: int) -> Self:
        """Return one row that knows all pushes."""
        return cls(np.zeros(pushes, np.int64), np.arange(pushes), 1, pushes)

    @classmethod
    def earlier(cls, episodes: Int[ndarray, "M"], steps: Int[ndarray, "M"]) -> Self:
        """Return a row for each push, that knows the earlier pushes of its episode."""
        order = np.lexsort((steps, episodes))
        _, first, place = np.unique(episodes[order], return_index=True, return_inverse=True)
        number = np.arange(len(order))
        count = number - first[place]
        row = np.repeat(number, count)
        push = np.arange(len(row)) - np.repeat(np.cumsum(count) - count - first[place], count)
        return cls(order[row], order[push], len(order), len(order)).sorted()

    def sorted(self) -> Self:
        """Return the same with pairs in the order of the rows."""
        order = np.argsort(self.row, kind="stable")
        return type(self)(self.row[order], self.push[order], self.rows, self.pushes)

    def of_rows(self, chosen: Int[ndarray, "C"]) -> Self:
        """Return what some rows know; they are numbered anew."""
        number = np.full(self.rows, -1)
        number[chosen] = np.arange(len(chosen))
        pairs = number[self.row] >= 0
        return type(self)(number[self.row[pairs]], self.push[pairs], len(chosen), self.pushes)

    @cached_property
    def counts(self) -> Int[ndarray, "R"]:
        """How many pushes each row knows."""
        return np.bincount(self.row, minlength=self.rows)

    def total(self, values: Float[ndarray, "M *V"]) -> Float[ndarray, "R *V"]:
        """Return sums over the pushes that each row knows."""
        return self.gather(values[self.push])

    def gather(self, values: Float[ndarray, "P *V"]) -> Float[ndarray, "R *V"]:
        """Return sums over the pairs of each row."""
        if self.rows == 1:
            return values.sum(axis=0, keepdims=True)
        ends = np.concatenate([[0], np.cumsum(self.counts)])
        picked = csr_matrix(
            (np.ones(len(self.row)), np.arange(len(self.row)), ends),
            shape=(self.rows, len(self.row)),
        )
        return np.asarray(picked @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:])


def picked(pushes: Transitions, rows: Int[ndarray, "P"] | slice) -> Transitions:
    """Return some of the pushes, any of them as often as its number is given."""
    return Transitions(pushes.state[rows], pushes.action[rows], pushes.next_state[rows])


def errors_of(predicted: ndarray, truth: ndarray) -> Float[ndarray, "*B N 3"]:
    """Return errors of bodies [m]: x, y, and the turn on an arm of `TURN_ARM` radii.

    Scenes (*B, N, 8) may be broadcast.
    """
    off = predicted - truth
    turn = TURN_ARM * wrap_angle(off[..., THETA]) * truth[..., RADIUS]
    return np.concatenate([off[..., POSITION], turn[..., None]], axis=-1)


def scales_of(pushes: Transitions, bodies: Bodies) -> Float[ndarray, "M N"]:
    """Return the scale of each body's error [m], for a factor of 1."""
    way = np.linalg.norm((pushes.next_state - pushes.state)[..., POSITION], axis=-1)
    return np.asarray((NOISE if bodies.are_paper_disks else SHAPE_NOISE) + SHARE * way)


def log_density(errors: ndarray, scale: ndarray) -> Float[ndarray, "*B K"]:
    """Return the logarithm of the density of errors for each factor, (*B, K).

    Args:
        errors: of bodies [m], (*B, N, 3).
        scale: for a factor of 1 [m], broadcast to (*B, N).
    """
    squared, wide = (errors**2).sum(axis=-1), scale[..., None] * FACTORS
    terms = -0.5 * (TAIL + SIZE) * np.log1p(squared[..., None] / wide**2 / TAIL)
    return np.asarray((terms - SIZE * np.log(wide)).sum(axis=-2))


def over_factors(log_densities: Float[ndarray, "*B K"]) -> Float[ndarray, "*B"]:
    """Return the logarithm of the mean over the factors."""
    return log_sum(log_densities, -1) - np.log(len(FACTORS))


def log_sum(logarithms: ndarray, axis: int) -> ndarray:
    """Return the logarithm of a sum of exponentials."""
    most = logarithms.max(axis=axis, keepdims=True)
    total = np.log(np.exp(logarithms - most).sum(axis=axis, keepdims=True))
    return np.asarray((most + total).squeeze(axis))
