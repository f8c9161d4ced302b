"""What earlier pushes of a body show of the errors of a model: Gaussian processes.

A push that is like an earlier one has an error like that one's. *Like* is a distance between eight
numbers: where the line of the push passes the body and its heading, in the body's frame; how the
model predicts the body to move; and the heading in the world. Errors grow with the predicted way.
How large they are, as a share of it, is averaged over the shares of `SHARES` by how well each
predicts each earlier push from the others (leave one out). One of them is 0: where it is the most
likely, the model stays as it is.

Recorded pushes of a body show its errors on another surface, too, as far as errors on two surfaces
are correlated. All correlations are averaged, by how well each predicts recorded and own pushes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import product
from typing import Final, NamedTuple, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.special import softmax

from sain_core.push import PushLimits, pushed_bodies, second_disks, strokes
from sain_core.scene import POSITION, RADIUS, THETA, turned, unit, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.types import Mask, Pushes, Scalars, Scenes
from sain_model.compute.compiling import callable_kernel, plain
from sain_model.compute.threads import run_blocks
from sain_model.inference.evidence import SIZE, TAIL, TURN_ARM, ObservedPushes
from sain_model.inference.kinds import CORRELATIONS, SHARES

# One length of each input: offset [radii], heading in the body's frame (2), predicted move [radii]
# and turn [rad], heading in the world (2). Chosen on real pushes (docs/reference/real.md).
LENGTHS: Final = np.array([0.3, 0.5, 0.5, 0.2, 0.2, 0.2, 1.5, 1.5])
KEEP: Final = 1.0  # logarithm of the odds that a model has no such errors, beforehand
MOST: Final = 128  # pushes: the latest ones
SWEEPS: Final = 4  # of weights for outliers
BLOCK: Final = 256  # pushes at a time


@callable_kernel
def recall(  # type: ignore[no-untyped-def]
    first, inputs, bodies, ways, earlier, earlier_bodies, weights, found
):
    """Write what a block of pushes is predicted to be off (B, 3), from earlier pushes (P)."""
    for row in range(first, min(first + BLOCK, len(inputs))):
        for other in range(len(earlier)):
            if earlier_bodies[other] != bodies[row]:
                continue
            apart = 0.0
            for column in range(inputs.shape[1]):
                apart += (inputs[row, column] - earlier[other, column]) ** 2
            like = ways[row] * np.exp(-0.5 * apart)
            for part in range(3):
                found[row, part] += like * weights[other, part]


@dataclass(frozen=True, eq=False)
class Seen:
    """Pushes of B scenes as a memory compares them."""

    body: Int[ndarray, "B"]  # that each is against
    inputs: Float[ndarray, "B 8"]  # over their lengths
    ways: Float[ndarray, "B"]  # [m], that the body is predicted to move and turn

    @classmethod
    def of(cls, scenes: Scenes, pushes: Pushes, after: Scenes, bodies: Bodies) -> Self:
        """Return pushes (B, A) of scenes (B, N, 8) that a model predicts to lead to `after`."""
        body = pushed_bodies(pushes)
        rows = np.arange(len(pushes)), body
        before, radius = scenes[rows], scenes[rows][:, RADIUS]
        start, heading = strokes(scenes, pushes, PushLimits(), bodies.fitted(scenes.shape[1]))
        direction = unit(heading - before[:, THETA])
        start = start + 0.5 * second_disks(pushes)[:, :2]  # the middle of the tool
        away = turned(start - before[:, POSITION], -before[:, THETA]) / radius[:, None]
        offset = direction[:, 0] * away[:, 1] - direction[:, 1] * away[:, 0]
        move = turned(after[rows][:, POSITION] - before[:, POSITION], -before[:, THETA])
        turn = wrap_angle(after[rows][:, THETA] - before[:, THETA])
        ways = np.sqrt((move**2).sum(axis=1) + (TURN_ARM * radius * turn) ** 2)
        columns = offset, direction, move / radius[:, None], turn, unit(heading)
        return cls(body, np.column_stack(columns) / LENGTHS, ways)

    @classmethod
    def joined(cls, some: Sequence[Self]) -> Self:
        """Return pushes one after the other."""
        names = [item.name for item in fields(cls)]
        return cls(*(np.concatenate([getattr(one, name) for one in some]) for name in names))

    def select(self, rows: Mask) -> Self:
        """Return some pushes."""
        return type(self)(self.body[rows], self.inputs[rows], self.ways[rows])

    def of_body(self, body: int) -> Self:
        """Return the same pushes, of the body of this number."""
        return replace(self, body=np.full_like(self.body, body))


class Solved(NamedTuple):
    """Errors of P pushes, explained by a kernel and noise."""

    solved: Float[ndarray, "P 3"]  # the inverse times the errors
    inverse: Float[ndarray, "P P"]  # of the covariance with the noise
    log_density: float  # of each error, given the others


@dataclass(frozen=True, eq=False)
class Recorded:
    """What R pushes of a body, on several surfaces, show of its errors on the surface 0."""

    seen: Seen
    errors: Float[ndarray, "R 3"]
    noise: Float[ndarray, "R"]  # [m]
    surface: Int[ndarray, "R"]
    log_odds: Float[ndarray, "S C"]  # of shares and correlations

    @classmethod
    def of(
        cls, pushes: ObservedPushes, after: Scenes, surface: Int[ndarray, "R"], log_odds: ndarray
    ) -> Self:
        """Return what pushes show of a model that predicts them to lead to `after`."""
        seen = Seen.of(pushes.state, pushes.action, after, pushes.bodies)
        return cls(seen, errors_of_bodies(pushes, after), _noise(pushes), surface, log_odds)

    @cached_property
    def solved(self) -> dict[tuple[float, float], Solved]:
        """The errors explained, for each share and correlation."""
        kernel, same = _kernel(self.seen, self.seen), self.surface[:, None] == self.surface
        return {
            (share, near): _solve(
                share**2 * np.where(same, 1.0, near) * kernel, self.errors, self.noise
            )
            for share, near in product(SHARES, CORRELATIONS)
        }

    @property
    def log_densities(self) -> Float[ndarray, "S C"]:
        """How well each share and correlation explains the errors."""
        logs = [one.log_density for one in self.solved.values()]
        return np.reshape(logs, (len(SHARES), len(CORRELATIONS)))

    def recalled(
        self, own: Seen, errors: Float[ndarray, "P 3"], noise: Scalars
    ) -> tuple[Float[ndarray, "R 3"], Float[ndarray, "P 3"]]:
        """Return weights of recorded pushes and of P own ones, averaged over all hypotheses."""
        across = _kernel(self.seen, own)
        within, logs, weights = _kernel(own, own), [], []
        hypotheses = zip(self.solved.items(), self.log_odds.ravel(), strict=True)
        for ((share, near), first), odds in hypotheses:
            close = share**2 * np.where(self.surface == 0, 1.0, near)[:, None]
            held = first.inverse @ (close * across)
            covariance = share**2 * within - (close * across).T @ held
            found = _solve(covariance, errors - (close * across).T @ first.solved, noise)
            logs.append(odds + found.log_density + KEEP * (share == 0.0))
            recorded = close * (first.solved - held @ found.solved)
            weights.append(np.concatenate([recorded, share**2 * found.solved]))
        mean = np.tensordot(softmax(logs), weights, axes=1)
        return mean[: len(self.noise)], mean[len(self.noise) :]


@dataclass(frozen=True, eq=False)
class Memory:
    """What P pushes show of the errors of pushed bodies."""

    seen: Seen = field(repr=False)
    weights: Float[ndarray, "P 3"] = field(repr=False)  # of the kernel, times the ways

    @classmethod
    def of(
        cls, pushes: ObservedPushes, after: Scenes, recorded: Mapping[int, Recorded] | None = None
    ) -> Self | None:
        """Return what pushes show of a model that predicts them to lead to `after`.

        `recorded` is what recordings show of bodies, by their numbers. None: pushes show that it
        has no such errors, or there are fewer than two, of bodies that were not recorded.
        """
        recorded = recorded or {}
        if len(pushes) < 2 and not recorded:
            return None
        pushes, after = pushes.select(slice(-MOST, None)), after[-MOST:]
        seen = Seen.of(pushes.state, pushes.action, after, pushes.bodies)
        errors, noise = errors_of_bodies(pushes, after), _noise(pushes)
        new = ~np.isin(seen.body, list(recorded))
        parts, some = list[tuple[Seen, ndarray]](), seen.select(new)
        if len(some.ways) > 1:
            parts = [(some, _weights(_kernel(some, some), errors[new], noise[new]))]
        for body, one in recorded.items():
            own = seen.body == body
            both = one.seen.of_body(body), seen.select(own)
            recalled = one.recalled(both[1].of_body(0), errors[own], noise[own])
            parts += zip(both, recalled, strict=True)
        weights = np.concatenate([one for _, one in parts]) if parts else np.zeros((0, 3))
        if not np.any(weights):
            return None
        joined = Seen.joined([some for some, _ in parts])
        return cls(joined, joined.ways[:, None] * weights)

    def correct(self, scenes: Scenes, pushes: Pushes, after: Scenes, bodies: Bodies) -> Scenes:
        """Return a prediction `after` (B, N, 8) without the errors that like pushes had."""
        new, found = Seen.of(scenes, pushes, after, bodies), np.zeros((len(pushes), 3))
        earlier = plain(self.seen.inputs), self.seen.body, plain(self.weights)
        some = plain(new.inputs), new.body, plain(new.ways)

        def work(first: int) -> None:
            recall(first, *some, *earlier, found)

        run_blocks(work, len(pushes), BLOCK)
        rows, corrected = (np.arange(len(pushes)), new.body), after.copy()
        before = scenes[rows]
        corrected[(*rows, POSITION)] += turned(found[:, :2], before[:, THETA])
        turn = found[:, 2] / (TURN_ARM * before[:, RADIUS])
        corrected[(*rows, THETA)] = wrap_angle(corrected[(*rows, THETA)] + turn)
        return corrected


def errors_of_bodies(pushes: ObservedPushes, after: Scenes) -> Float[ndarray, "M 3"]:
    """Return errors of pushed bodies [m] in their frames: x, y, and the turn as a way."""
    rows = np.arange(len(pushes)), pushed_bodies(pushes.action)
    before, off = pushes.state[rows], pushes.next_state[rows] - after[rows]
    turn = TURN_ARM * before[:, RADIUS] * wrap_angle(off[:, THETA])
    return np.column_stack([turned(off[:, POSITION], -before[:, THETA]), turn])


def _noise(pushes: ObservedPushes) -> Scalars:
    """Return the scales of the errors of pushed bodies (M,) [m]."""
    return pushes.scales(np.ones(1))[np.arange(len(pushes)), pushed_bodies(pushes.action), 0]


def _kernel(seen: Seen, others: Seen) -> Float[ndarray, "P Q"]:
    """Return the covariances of errors of pushes, for a share of 1."""
    apart = ((seen.inputs[:, None] - others.inputs) ** 2).sum(axis=-1)
    same = seen.body[:, None] == others.body
    return np.asarray(same * np.exp(-0.5 * apart) * np.outer(seen.ways, others.ways))


def _solve(kernel: Float[ndarray, "P P"], errors: Float[ndarray, "P 3"], noise: Scalars) -> Solved:
    """Explain errors by a kernel, and noise with Student's t distribution of scales (P,) [m].

    Outliers count less, by iteratively reweighted least squares.
    """
    weight = np.ones(len(noise))
    for _ in range(SWEEPS):
        inverse = np.linalg.inv(kernel + np.diag(noise**2 / weight))
        solved = inverse @ errors
        left = noise[:, None] ** 2 / weight[:, None] * solved
        weight = (TAIL + SIZE) / (TAIL + ((left / noise[:, None]) ** 2).sum(axis=1))
    without = solved / np.diag(inverse)[:, None]  # errors of predictions from the others
    squared = ((without / noise[:, None]) ** 2).sum(axis=1)
    return Solved(solved, inverse, -0.5 * (TAIL + SIZE) * np.log1p(squared / TAIL).sum())


def _weights(
    kernel: Float[ndarray, "P P"], errors: Float[ndarray, "P 3"], noise: Scalars
) -> Float[ndarray, "P 3"]:
    """Return the weights of a kernel's columns that predict errors, averaged over all shares."""
    each = [_solve(share**2 * kernel, errors, noise) for share in SHARES]
    logs = [
        one.log_density + KEEP * (share == 0.0) for one, share in zip(each, SHARES, strict=True)
    ]
    if np.argmax(logs) == 0:
        return np.zeros_like(errors)
    shared = [share**2 * one.solved for one, share in zip(each, SHARES, strict=True)]
    return np.asarray(np.tensordot(softmax(logs), shared, axes=1))
