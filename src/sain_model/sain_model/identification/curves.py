"""How well each friction explains single pushes, for one kind of physics; kept for a while."""

from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.dataset import Transitions
from sain_core.scene import POSITION
from sain_core.shapes.bodies import Bodies
from sain_model.identification.evidence import errors_of, log_density, picked, scales_of
from sain_model.identification.structures import Structure
from sain_model.physics.friction import CHUNK, WATCHED, FrictionFilter, ways
from sain_model.physics.planar import PlanarPrior

KEPT: Final = 256  # pushes
Key = tuple[str, Bodies | None, bytes]


@dataclass(frozen=True, eq=False)
class Curves:
    """For each of M pushes and F frictions.

    Attributes:
        likelihood: logarithm, with the noise of a structure's own inference of friction.
        density: logarithm, for each factor of the noise.
    """

    likelihood: Float[ndarray, "M F"]
    density: Float[ndarray, "M F K"]


class PushCurves:
    """Curves of the pushes that were asked for last: a past push never changes."""

    def __init__(self) -> None:
        """Begin with none."""
        self._kept: OrderedDict[Key, tuple[ndarray, ndarray]] = OrderedDict()
        self._lock = Lock()

    def of(self, structure: Structure, bodies: Bodies | None, pushes: Transitions) -> Curves:
        """Return the curves of some pushes; only those of new ones are computed."""
        if len(pushes) > KEPT // 2:
            return curves_of(structure, bodies, pushes)
        rows = zip(pushes.state, pushes.action, pushes.next_state, strict=True)
        keys = [(structure.name, bodies, b"".join(part.tobytes() for part in row)) for row in rows]
        with self._lock:
            found = {key: self._kept[key] for key in keys if key in self._kept}
        new = [index for index, key in enumerate(keys) if key not in found]
        if new:
            made = curves_of(structure, bodies, picked(pushes, np.array(new)))
            fresh = zip(new, made.likelihood, made.density, strict=True)
            found |= {keys[index]: (first, second) for index, first, second in fresh}
        with self._lock:
            for key in keys:
                self._kept[key] = found[key]
                self._kept.move_to_end(key)
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        return Curves(*(np.stack([found[key][part] for key in keys]) for part in (0, 1)))


def curves_of(structure: Structure, bodies: Bodies | None, pushes: Transitions) -> Curves:
    """Return how well each friction explains each push."""
    friction, scale = filter_of(structure, bodies), scales_of(pushes, bodies)
    grid, moved = friction.grid, ways(pushes.state, pushes.next_state)
    size = max(CHUNK // len(grid), 1)
    parts: list[tuple[ndarray, ndarray]] = []
    for first in range(0, len(pushes), size):
        rows = slice(first, first + size)
        off = _errors(friction, picked(pushes, rows))  # (m, F, N, 3)
        watched = np.linalg.norm(off[:, :, WATCHED, POSITION], axis=-1)
        parts.append(
            (
                friction.weigh(watched, moved[rows]),
                log_density(off, scale[rows, None]),
            )
        )
    return Curves(*(np.concatenate(some) for some in zip(*parts, strict=True)))


def filter_of(structure: Structure, bodies: Bodies | None) -> FrictionFilter:
    """Return what infers the friction of an episode with one kind of physics."""
    return PlanarPrior(structure.config, bodies).filter(structure.friction)


def _errors(friction: FrictionFilter, pushes: Transitions) -> Float[ndarray, "M F N 3"]:
    count, grid = len(pushes), friction.grid
    scenes, actions = (np.repeat(a, len(grid), axis=0) for a in (pushes.state, pushes.action))
    predicted = friction.physics.step(scenes, actions, np.tile(grid, count))
    predicted = predicted.reshape(count, len(grid), *pushes.state.shape[1:])
    return errors_of(predicted, pushes.next_state[:, None])
