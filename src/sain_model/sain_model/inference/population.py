"""What pushes of bodies on surfaces show of one another: a Gaussian model of their parameters.

A parameter of a body on a surface is the sum of four parts. One is common to all, one is of the
body on any surface, one of the surface under any body, one of this body on this surface alone. So a
body that was pushed on one surface brings its values to another, as far as a parameter is of the
body (the pressure under it), and not of the surface (where the tool really is). How large the parts
are, `PARTS`, is believed beforehand, and learned from many bodies by the EM algorithm.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_model.inference.evidence import ObservedPushes
from sain_model.inference.kinds import Kind
from sain_model.inference.posterior import Fit, Parts, fit

PARTS: Final = {  # shares of a parameter's variance: common, of the body, of the surface, of both
    "pressure": (0.1, 0.7, 0.05, 0.15),
    "tool_friction": (0.3, 0.3, 0.15, 0.25),
    "torsion": (0.1, 0.1, 0.4, 0.4),
    "body": (0.0, 0.25, 0.0, 0.75),  # other parameters by their scope
    "table": (0.0, 0.0, 0.3, 0.7),
    "tool": (0.5, 0.0, 0.3, 0.2),
    "episode": (0.3, 0.0, 0.3, 0.4),
}
STEPS: Final = 25  # of a fit
SWEEPS: Final = 2  # of fits of all bodies, each given the others
EM_STEPS: Final = 30
LEAST: Final = 0.1  # of the prior's information, beside that of pushes
WORTH: Final = 1.0  # of the shares, in observed parts


class Pair(NamedTuple):
    """A body on a surface, by name; any other name is of one that was not pushed yet."""

    body: str
    surface: str

    def __str__(self) -> str:
        return f"{self.body} on {self.surface}" if self.surface else self.body


class Shown(NamedTuple):
    """What the pushes of one pair show: a Gaussian likelihood of its vector z."""

    place: Float[ndarray, "D"]  # the most likely one, with what others show
    information: Float[ndarray, "D D"]
    pull: Float[ndarray, "D"]  # information times the mean of the likelihood


@dataclass(frozen=True, eq=False)
class Population:
    """Bodies on surfaces, and what is believed of another one."""

    kind: Kind  # of physics, and what is believed before any push
    variances: Float[ndarray, "4 D"]  # of the four parts
    shown: Mapping[Pair, Shown] = field(default_factory=dict)

    @classmethod
    def before(cls, kind: Kind) -> Self:
        """Return what is believed before any push."""
        shares = [PARTS.get(one.name, PARTS[one.scope]) for one in kind.parameters]
        return cls(kind, np.reshape(shares, (len(shares), 4)).T * kind.deviations**2)

    @classmethod
    def of(cls, kind: Kind, pushes: Mapping[Pair, Parts]) -> Self:
        """Return what pushes of bodies show, which also show how far bodies differ.

        For other bodies, what they show beside the belief before any push counts: a fit with a
        belief from the same pushes would make extreme values more extreme.
        """
        if not pushes:
            return cls.before(kind)
        first = cls.before(kind)._fitted(pushes).learned()
        again = first._fitted(pushes).shown
        shown = {pair: one._replace(place=again[pair].place) for pair, one in first.shown.items()}
        return replace(first, shown=shown)

    def learn(self, pushes: Mapping[Pair, Parts]) -> Self:
        """Return what is believed after pushes of these pairs, which replace earlier ones."""
        population = self
        for _ in range(SWEEPS if len(pushes) > 1 else 1):
            population = population._fitted(pushes)
        return population

    def belief(
        self, pair: Pair, own: bool = False
    ) -> tuple[Float[ndarray, "D"], Float[ndarray, "D D"]]:
        """Return mean and covariance of a pair's vector z, from all others and perhaps its own."""
        pairs, size = [pair, *(one for one in self.shown if one != pair)], len(self.kind.names)
        prior = np.zeros((len(pairs), size, len(pairs), size))
        for column, covariance in enumerate(self._covariances(pairs)):
            prior[:, column, :, column] = covariance
        information, pull = np.zeros(prior.shape), np.zeros((len(pairs), size))
        for row, one in enumerate(pairs):
            if one in self.shown and (own or row > 0):
                information[row, :, row], pull[row] = self.shown[one][1:]
        wide, known = (some.reshape(pull.size, pull.size) for some in (prior, information))
        covariance = np.linalg.solve(np.eye(pull.size) + wide @ known, wide)
        block = covariance[:size, :size]
        return covariance[:size] @ pull.ravel(), 0.5 * (block + block.T)

    def place(self, pair: Pair) -> Float[ndarray, "D"]:
        """Return the most likely vector z of a pair, pushed or not."""
        return self.shown[pair].place if pair in self.shown else self.belief(pair)[0]

    def kind_of(self, pair: Pair, own: bool = True) -> Kind:
        """Return what is believed of a pair, with or without what its own pushes show."""
        return self.kind.believing(*self.belief(pair, own))

    def learned(self) -> Self:
        """Return the population with variances of the parts that its pairs show."""
        return replace(self, variances=self._learned_variances())

    def _fitted(self, pushes: Mapping[Pair, Parts]) -> Self:
        """Fit each pair, given what is known of the others before."""
        found = {pair: self._fit(pair, parts) for pair, parts in pushes.items()}
        return replace(self, shown={**self.shown, **found})

    def _fit(self, pair: Pair, parts: Parts) -> Shown:
        mean, covariance = self.belief(pair)
        kind = self.kind.believing(mean, covariance)
        start = np.zeros(len(mean)) if pair not in self.shown else self.shown[pair].place - mean
        found = fit(kind, [_alone(part) for part in parts], start[None], STEPS)
        information, pull = likelihoods(found, mean)
        return Shown(mean + found.places[0], information[0], pull[0])

    def _covariances(self, pairs: list[Pair]) -> Float[ndarray, "D P P"]:
        bodies, surfaces = (np.array(names, object) for names in zip(*pairs, strict=True))
        each = np.eye(len(pairs), dtype=bool)
        same = np.ones_like(each), bodies[:, None] == bodies, surfaces[:, None] == surfaces, each
        return np.einsum("kd,kpq->dpq", self.variances, np.stack(same))

    def _learned_variances(self) -> Float[ndarray, "4 D"]:
        """Return the variances of the parts that the pairs show, by the EM algorithm."""
        pairs = list(self.shown)
        labels = [("", *pair, str(pair)) for pair in pairs]
        parts = sorted({(number, label) for row in labels for number, label in enumerate(row)})
        design = np.array(
            [[float(row[number] == label) for number, label in parts] for row in labels]
        )
        of = np.array([number for number, _ in parts])
        counts, size = np.bincount(of), len(self.kind.names)
        each = np.stack([self.shown[pair].information for pair in pairs])
        information = np.einsum("pl,pde,pm->ldme", design, each, design)
        information = information.reshape(len(parts) * size, -1)
        pull = (design.T @ np.stack([self.shown[pair].pull for pair in pairs])).ravel()
        before = variances = self.before(self.kind).variances
        for _ in range(EM_STEPS):
            precision = 1.0 / np.maximum(variances[of], 1e-9)
            covariance = np.linalg.inv(np.diag(precision.ravel()) + information)
            mean, spread = covariance @ pull, np.diag(covariance)
            squared = (mean**2 + spread).reshape(len(parts), size)
            totals = np.stack([squared[of == number].sum(axis=0) for number in range(len(counts))])
            variances = (totals + WORTH * before) / (counts + WORTH)[:, None]
            variances = np.where(before > 0.0, variances, 0.0)
        return np.asarray(variances)


def likelihoods(
    found: Fit, mean: Float[ndarray, "D"]
) -> tuple[Float[ndarray, "C D D"], Float[ndarray, "C D"]]:
    """Return the Gaussian likelihoods of vectors z of C fits that began with a belief about a mean.

    The mode of a likelihood is beyond the place of its fit: there the prior pulls back. What pushes
    do not show has none. All fits have the same noise at least: few pushes, fitted closely, do not
    show that theirs is less.
    """
    usual = np.sqrt((found.factor**2).mean())
    share = (found.factor / np.maximum(found.factor, usual)) ** 2
    information, prior = share[:, None, None] * found.normal.information, found.kind.precision
    back = (found.places @ prior)[..., None]
    mode = mean + found.places + np.linalg.solve(information + LEAST * prior, back)[..., 0]
    return information, (information @ mode[..., None])[..., 0]


def _alone(part: ObservedPushes) -> ObservedPushes:
    return replace(part, episode=np.zeros(len(part), np.int64))
