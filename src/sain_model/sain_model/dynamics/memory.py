"""What earlier pushes of a body show of the errors of a model: Gaussian processes.

A push that is like an earlier one has an error like that one's. *Like* is a distance between eight
numbers: where the line of the push passes the body and its heading, in the body's frame; how the
model predicts the body to move; and the heading in the world. Errors grow with the predicted way.
How large they are, as a share of it, is averaged over the shares of `SHARES` by how well each
predicts each earlier push from the others (leave one out). One of them is 0: where it is the most
likely, the model stays as it is.
"""

from dataclasses import dataclass, field
from typing import Final, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.special import softmax

from sain_core.push import PushLimits, pushed_bodies, strokes
from sain_core.scene import POSITION, RADIUS, THETA, turned, unit, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.compute.compiling import callable_kernel, plain
from sain_model.compute.threads import run_blocks
from sain_model.inference.evidence import SIZE, TAIL, TURN_ARM, ObservedPushes

# One length of each input: offset [radii], heading in the body's frame (2), predicted move [radii]
# and turn [rad], heading in the world (2). Chosen on real pushes (docs/reference/real.md).
LENGTHS: Final = np.array([0.3, 0.5, 0.5, 0.2, 0.2, 0.2, 1.5, 1.5])
SHARES: Final = np.array([0.0, 0.02, 0.04, 0.08, 0.16])  # size of errors, share of the way
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
        away = turned(start - before[:, POSITION], -before[:, THETA]) / radius[:, None]
        offset = direction[:, 0] * away[:, 1] - direction[:, 1] * away[:, 0]
        move = turned(after[rows][:, POSITION] - before[:, POSITION], -before[:, THETA])
        turn = wrap_angle(after[rows][:, THETA] - before[:, THETA])
        ways = np.sqrt((move**2).sum(axis=1) + (TURN_ARM * radius * turn) ** 2)
        columns = offset, direction, move / radius[:, None], turn, unit(heading)
        return cls(body, np.column_stack(columns) / LENGTHS, ways)


@dataclass(frozen=True, eq=False)
class Memory:
    """What P pushes show of the errors of pushed bodies."""

    seen: Seen = field(repr=False)
    weights: Float[ndarray, "P 3"] = field(repr=False)  # of the kernel, times the ways

    @classmethod
    def of(cls, pushes: ObservedPushes, after: Scenes) -> Self | None:
        """Return what pushes show of a model that predicts them to lead to `after`.

        None: they show that it has no such errors, or there are fewer than two.
        """
        if len(pushes) < 2:
            return None
        pushes, after = pushes.select(slice(-MOST, None)), after[-MOST:]
        seen = Seen.of(pushes.state, pushes.action, after, pushes.bodies)
        rows = np.arange(len(pushes)), seen.body
        noise = pushes.scales(np.ones(1))[..., 0][rows]
        weights = _weights(_kernel(seen), errors_of_bodies(pushes, after), noise)
        return cls(seen, seen.ways[:, None] * weights) if np.any(weights) else None

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


def _kernel(seen: Seen) -> Float[ndarray, "P P"]:
    """Return the covariances of errors of pushes, for a share of 1."""
    apart = ((seen.inputs[:, None] - seen.inputs) ** 2).sum(axis=-1)
    same = seen.body[:, None] == seen.body
    return np.asarray(same * np.exp(-0.5 * apart) * np.outer(seen.ways, seen.ways))


def _weights(
    kernel: Float[ndarray, "P P"], errors: Float[ndarray, "P 3"], noise: Scalars
) -> Float[ndarray, "P 3"]:
    """Return the weights of a kernel's columns that predict errors, averaged over all shares.

    Noise has Student's t distribution with scales `noise` (P,) [m]: outliers count less, by
    iteratively reweighted least squares.
    """
    logs, each = [], []
    for share in SHARES:
        weight = np.ones(len(noise))
        for _ in range(SWEEPS):
            inverse = np.linalg.inv(share**2 * kernel + np.diag(noise**2 / weight))
            solved = inverse @ errors
            left = noise[:, None] ** 2 / weight[:, None] * solved
            weight = (TAIL + SIZE) / (TAIL + ((left / noise[:, None]) ** 2).sum(axis=1))
        without = solved / np.diag(inverse)[:, None]  # errors of predictions from the others
        squared = ((without / noise[:, None]) ** 2).sum(axis=1)
        logs.append(-0.5 * (TAIL + SIZE) * np.log1p(squared / TAIL).sum() + KEEP * (share == 0.0))
        each.append(share**2 * solved)
    if np.argmax(logs) == 0:
        return np.zeros_like(errors)
    return np.asarray(np.tensordot(softmax(logs), each, axes=1))
