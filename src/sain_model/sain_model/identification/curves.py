"""How well pairs of a ratio of masses and a friction explain pushes, for one kind of physics."""

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
from sain_model.identification.masses import MassFilter, mass_filter
from sain_model.identification.structures import Structure
from sain_model.physics.friction import CHUNK, WATCHED, ways
from sain_model.physics.planar import PlanarPrior

KEPT: Final = 256  # pushes
Key = tuple[str, Bodies, bytes]


@dataclass(frozen=True, eq=False)
class Curves:
    """For each of M pushes and G pairs of a ratio of masses and a friction.

    Attributes:
        likelihood: logarithm, with the noise of a structure's own inference of friction.
        density: logarithm, for each factor of the noise.
    """

    likelihood: Float[ndarray, "M G"]
    density: Float[ndarray, "M G K"]


class PushCurves:
    """Curves of the pushes that were asked for last: a past push never changes."""

    def __init__(self) -> None:
        """Begin with none."""
        self._kept: OrderedDict[Key, tuple[ndarray, ndarray]] = OrderedDict()
        self._lock = Lock()

    def of(self, structure: Structure, bodies: Bodies, pushes: Transitions) -> Curves:
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


def curves_of(structure: Structure, bodies: Bodies, pushes: Transitions) -> Curves:
    """Return how well each pair explains each push."""
    masses, scale = filter_of(structure, bodies), scales_of(pushes, bodies)
    moved, size = ways(pushes.state, pushes.next_state), max(CHUNK // masses.size, 1)
    parts: list[tuple[ndarray, ndarray]] = []
    for first in range(0, len(pushes), size):
        rows = slice(first, first + size)
        predicted = masses.predict(pushes.state[rows], pushes.action[rows])
        off = errors_of(predicted, pushes.next_state[rows, None])  # (m, G, N, 3)
        watched = np.linalg.norm(off[:, :, WATCHED, POSITION], axis=-1)
        parts.append(
            (
                masses.friction.weigh(watched, moved[rows]),
                log_density(off, scale[rows, None]),
            )
        )
    return Curves(*(np.concatenate(some) for some in zip(*parts, strict=True)))


def filter_of(structure: Structure, bodies: Bodies) -> MassFilter:
    """Return what infers friction and masses of an episode with one kind of physics."""
    prior = PlanarPrior(structure.config, bodies)
    return mass_filter(prior, structure.friction, structure.mass_log_std)
