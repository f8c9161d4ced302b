"""What pushes of an episode say about the physics: its kind and its parameters.

Of each kind of physics, the parameters that have a grid are inferred on it, the others stay as
believed. About the kind with the greatest evidence, all parameters are inferred together, by
Gauss-Newton. What has the greatest evidence predicts.
"""

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.inference.evidence import (
    FACTORS,
    Known,
    ObservedPushes,
    curves_of,
    marginals,
)
from sain_model.inference.gauss_newton import fit
from sain_model.inference.kinds import Belief, Kind, Places

STEPS: Final = 3
STEPS_OF_BODIES: Final = 12  # of a body on a surface, whose own pushes may be many


@dataclass(frozen=True, eq=False)
class Posterior:
    """What each of R rows says about the kinds of a belief."""

    belief: Belief
    kind: Int[ndarray, "R"]  # number of the most likely one
    # whether all parameters are inferred; else those of the grid alone
    inferred: Bool[ndarray, "R"]
    places: Places  # vectors z of that kind; 0 beyond its own parameters
    spreads: Places  # standard deviations of z
    corrected: Bool[ndarray, "R"]  # whether the network corrects it

    @classmethod
    def at(cls, belief: Belief, kind: int, places: Places, corrected: Bool[ndarray, "R"]) -> Self:
        """Return rows with one kind of physics at vectors z (R, D)."""
        nothing = np.zeros(len(places), np.int64)
        return cls(belief, nothing + kind, nothing > 0, places, np.zeros_like(places), corrected)

    def of_rows(self, rows: Int[ndarray, "C"] | slice) -> Self:
        """Return some rows, any of them as often as its number is given."""
        arrays = {name: some[rows] for name, some in vars(self).items() if name != "belief"}
        return replace(self, **arrays)

    @property
    def by_kind(self) -> list[tuple[Int[ndarray, "C"], Kind]]:
        """The rows of each kind that has any."""
        return _of_kinds(self.belief, self.kind)

    def moved(self, name: str, deviations: float) -> Self:
        """Return the rows with a parameter so many of its standard deviations away."""
        places = self.places.copy()
        for rows, kind in self.by_kind:
            if name in kind.names:
                column = kind.names.index(name)
                places[rows, column] += deviations * self.spreads[rows, column]
        return replace(self, places=places)

    def values(self, name: str) -> Scalars:
        """Return the value of a parameter (R,)."""
        found = np.empty(len(self.kind))
        for rows, kind in self.by_kind:
            found[rows] = kind.value(name, self.places[rows])
        return found

    def log_spread(self, name: str) -> Scalars:
        """Return the spread (R,) of a parameter: of its logarithm, if it is a factor."""
        found = np.zeros(len(self.kind))
        for rows, kind in self.by_kind:
            if name in kind.names:
                column = kind.names.index(name)
                found[rows] = kind.parameters[column].spread * self.spreads[rows, column]
        return found

    def believed(self) -> dict[str, Scalars]:
        """Return the values (R,) of all parameters that pushes show, by name.

        Where a parameter is none of a row's kind, it has the value of that kind's prior.
        """
        names = dict.fromkeys(name for kind in self.belief.kinds for name in kind.names)
        return {name: self.values(name) for name in names}

    def step(self, bodies: Bodies, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict push i (M, N, 8) with the physics of row i."""
        predicted = np.empty_like(scenes)
        for rows, kind in self.by_kind:
            values = kind.values(self.places[rows])
            predicted[rows] = kind.step(bodies, scenes[rows], pushes[rows], values)
        return predicted


def infer(belief: Belief, pushes: ObservedPushes, known: Known) -> Posterior:
    """Return what each row of known pushes says of the physics, with the belief before them."""
    width, rows = max(len(kind.names) for kind in belief.kinds), np.arange(known.rows)
    alone = [marginals(kind, known.total(_curves(kind, pushes))) for kind in belief.kinds]
    odds = np.array([kind.log_odds_of(pushes.bodies) for kind in belief.kinds])
    log_evidence = np.stack([one.log_evidence for one in alone], axis=1) + odds
    best = log_evidence.argmax(axis=1)
    places, spreads = (
        np.stack([np.pad(p, ((0, 0), (0, width - p.shape[1]))) for p in parts], axis=1)[rows, best]
        for parts in ([one.places for one in alone], [one.spreads for one in alone])
    )
    inferred = np.zeros(known.rows, dtype=bool)
    for chosen, kind in _of_kinds(belief, best):
        some = chosen[known.counts[chosen] > 0]
        if not len(some) or len(kind.on_grid) == len(kind.names):
            continue
        part, count = known.of_rows(some), len(kind.names)
        observed = replace(pushes.select(part.push), episode=part.row)
        steps = STEPS_OF_BODIES if kind.of_bodies else STEPS
        found = fit(kind, [observed], places[some, :count], steps)
        together = found.log_evidence + kind.log_odds_of(pushes.bodies)
        better = together > log_evidence[some, best[some]]
        inferred[some] = better
        places[some[better], :count] = found.places[better]
        deviations = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
        spreads[some[better], :count] = deviations[better]
    return Posterior(belief, best, inferred, places, spreads, inferred)


def _of_kinds(belief: Belief, numbers: Int[ndarray, "R"]) -> list[tuple[Int[ndarray, "C"], Kind]]:
    """Return the rows of each kind that has any."""
    found = [(np.flatnonzero(numbers == number), kind) for number, kind in enumerate(belief.kinds)]
    return [(rows, kind) for rows, kind in found if len(rows)]


def _curves(kind: Kind, pushes: ObservedPushes) -> Float[ndarray, "M G K"]:
    """Return how well places of a grid explain pushes; nothing of what cannot be is computed."""
    if kind.log_odds_of(pushes.bodies) == -np.inf:
        return np.zeros((len(pushes), len(kind.grid), len(FACTORS)))
    return curves_of(kind, pushes)
