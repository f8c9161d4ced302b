"""How well the places of a grid explain pushes, and what that says about its parameters."""

from collections import OrderedDict
from dataclasses import dataclass, field
from threading import Lock
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.types import Scalars
from sain_model.inference.evidence import (
    FACTORS,
    Known,
    ObservedPushes,
    errors_of,
    log_density,
    log_sum,
    over_factors,
)
from sain_model.inference.kinds import Kind, Places

CHUNK: Final = 32_768  # predictions at a time: bounds memory
KEPT: Final = 256  # pushes

Curves = Float[ndarray, "M G K"]  # logarithm of the density of each push at each place and factor


@dataclass(frozen=True, eq=False)
class Marginals:
    """What pushes say about the parameters of a grid, for each of R rows.

    Attributes:
        places: means of the vectors z; parameters without a grid stay as believed before.
        spreads: standard deviations of z.
        log_evidence: of the kind of physics with these parameters alone.
    """

    places: Places
    spreads: Places
    log_evidence: Float[ndarray, "R"]


def marginals(kind: Kind, totals: Float[ndarray, "R G K"]) -> Marginals:
    """Return what pushes whose curves have these totals say."""
    log_weights = totals + kind.grid_log_prior[:, None]
    log_evidence = over_factors(log_sum(log_weights, 1))
    weights = np.exp(log_sum(log_weights, 2) - np.log(len(FACTORS)) - log_evidence[:, None])
    places = weights @ kind.grid
    variance = weights @ kind.grid**2 - places**2
    fixed = np.array([name not in kind.on_grid for name in kind.names], dtype=bool)
    spreads = np.where(fixed, kind.deviations, np.sqrt(np.maximum(variance, 0.0)))
    return Marginals(places, spreads, log_evidence)


def curves_of(kind: Kind, pushes: ObservedPushes) -> Curves:
    """Return how well each place of a kind's grid explains each push."""
    grid = kind.values(kind.grid)
    count, bodies = len(kind.grid), pushes.bodies
    size, parts = max(CHUNK // count, 1), [np.empty((0, count, len(FACTORS)))]
    for first in range(0, len(pushes), size):
        part = pushes.select(slice(first, first + size))
        many = part.select(np.repeat(np.arange(len(part)), count))
        values = {name: np.tile(some, len(part)) for name, some in grid.items()}
        after = kind.step(bodies, many.state, many.action, values | dict(many.given or {}))
        after = after.reshape(len(part), count, *after.shape[1:])
        scales = part.scales(FACTORS)[:, None]
        parts.append(log_density(errors_of(after, part.next_state[:, None]), scales))
    return np.concatenate(parts)


@dataclass(frozen=True, eq=False)
class LatestCurves:
    """Curves of the latest pushes, kept for the next history: that has one push more."""

    _kept: OrderedDict[tuple[int, bytes], tuple[Kind, ndarray]] = field(default_factory=OrderedDict)
    _lock: Lock = field(default_factory=Lock)

    def of(self, kind: Kind, pushes: ObservedPushes) -> Curves:
        """Return the curves of some pushes; only those of new ones are computed."""
        if len(pushes) > KEPT // 4 or pushes.given is not None:
            return curves_of(kind, pushes)
        noise = pushes.state[:, :0] if pushes.noise is None else pushes.noise
        rows = zip(pushes.state, pushes.action, pushes.next_state, noise, strict=True)
        about = id(kind), repr(pushes.bodies).encode()
        keys = [(about[0], b"".join([about[1], *(part.tobytes() for part in row)])) for row in rows]
        with self._lock:
            found = {key: self._kept[key] for key in keys if key in self._kept}
        new = [index for index, key in enumerate(keys) if key not in found]
        if new:
            fresh = curves_of(kind, pushes.select(np.array(new)))
            found |= {keys[index]: (kind, one) for index, one in zip(new, fresh, strict=True)}
        with self._lock:
            for key in keys:
                self._kept[key] = found[key]
                self._kept.move_to_end(key)
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        if not keys:
            return curves_of(kind, pushes)
        return np.stack([found[key][1] for key in keys])


LATEST: Final = LatestCurves()


def grid_values(
    kind: Kind, pushes: ObservedPushes, known: Known
) -> tuple[dict[str, Scalars], dict[str, Scalars]]:
    """Return mean values and spreads of a grid's parameters for each row; for training.

    ``Known.others`` says what the rest of an episode's pushes say about the friction of each push,
    ``Known.earlier`` what those before it say. A row without pushes has the values of the prior.
    A push is predicted once at each place of the grid, however many rows it is in.

    Returns:
        Two dictionaries by name: values (R,), and standard deviations of their z in the unit of
        the parameter (R,): of the logarithm, where its spread is one.
    """
    if not kind.on_grid:
        return {}, {}
    found = marginals(kind, known.total(LATEST.of(kind, pushes)))
    columns = [kind.names.index(name) for name in kind.on_grid]
    values = kind.values(found.places)
    return (
        {name: values[name] for name in kind.on_grid},
        {
            kind.names[column]: kind.parameters[column].spread * found.spreads[:, column]
            for column in columns
        },
    )
