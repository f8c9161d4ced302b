"""What the episodes of a laboratory show of the next one: a Gaussian model of their parameters.

A parameter of an episode is the sum of two parts: one of the laboratory, and one of the episode, of
its bodies and of where they are. Each episode is fitted by itself, and begins with what all others
show. How large the parts of episodes are is learned by the evidence (MacKay 1992). So the pushes of
an episode show anew what differs between episodes, and no more than that.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_model.inference.kinds import Kind
from sain_model.inference.population import likelihoods
from sain_model.inference.posterior import Fit, Parts, fit

# Share of a parameter's variance that is of the episode, beforehand, by its scope.
OWN: Final = {"body": 0.5, "episode": 0.5, "table": 0.1, "tool": 0.1}
WORTH: Final = 1.0  # of that share, in observed episodes
SWEEPS: Final = 30  # of variances and means


@dataclass(frozen=True, eq=False)
class Episodes:
    """Episodes of a laboratory, and what is believed of another one."""

    kind: Kind  # of physics, and what is believed before any push
    mean: Float[ndarray, "D"]  # vector z of the laboratory
    covariance: Float[ndarray, "D D"]  # of it
    own: Float[ndarray, "D"]  # variances of what episodes have of their own
    fit: Fit | None = None  # the latest one, relative to the mean before it
    at: Mapping[str, Float[ndarray, "D"]] = field(default_factory=dict)  # vectors z by episode

    @classmethod
    def before(cls, kind: Kind) -> Self:
        """Return what is believed before any push."""
        own = np.array([OWN[one.scope] for one in kind.parameters]) * kind.deviations**2
        return cls(kind, np.zeros(len(own)), kind.covariance - np.diag(own), own)

    @property
    def places(self) -> Float[ndarray, "C D"]:
        """The vectors z of all episodes, in order."""
        return np.stack(list(self.at.values()))

    @property
    def evidence(self) -> float:
        """The logarithm of the evidence of this kind; lowest where nothing was fitted.

        That the mean is learned from these episodes is paid for, by Laplace's approximation.
        """
        if self.fit is None:
            return -np.inf
        before = self.before(self.kind).covariance
        room = np.linalg.slogdet(self.covariance)[1] - np.linalg.slogdet(before)[1]
        far = self.mean @ np.linalg.solve(before, self.mean)
        return float(self.fit.log_evidence.sum() + 0.5 * (room - far))

    @property
    def next(self) -> Kind:
        """What is believed of the next episode."""
        return self.kind.believing(self.mean, self.covariance + np.diag(self.own))

    def learn(self, parts: Parts, names: Sequence[str], steps: int) -> Self:
        """Return what all these episodes show, by the names that `parts` count them by.

        Each is fitted from where it was, or from the mean, by so many steps at most.
        """
        start = np.stack([self.at.get(name, self.mean) for name in names]) - self.mean
        found = fit(self.next, parts, start, steps)
        at = dict(zip(names, self.mean + found.places, strict=True))
        return replace(self, fit=found, at=at)._learned(*likelihoods(found, self.mean))

    def _learned(self, information: Float[ndarray, "C D D"], pull: Float[ndarray, "C D"]) -> Self:
        """Return mean and variances that likelihoods of episodes show."""
        first = self.before(self.kind)
        precision, own = np.linalg.inv(first.covariance), self.own
        for _ in range(SWEEPS):
            inside = np.linalg.inv(information + np.diag(1.0 / own))
            tied = inside @ information
            shown = information - information @ tied  # of the mean, by each episode
            covariance = np.linalg.inv(precision + shown.sum(axis=0))
            told = pull - (information @ inside @ pull[..., None])[..., 0]
            mean = covariance @ told.sum(axis=0)
            apart = (inside @ (pull - information @ mean)[..., None])[..., 0]
            spread = inside + tied @ covariance @ np.swapaxes(tied, 1, 2)
            known = np.maximum(1.0 - np.diagonal(spread, axis1=1, axis2=2) / own, 0.0)
            own = (apart**2).sum(axis=0) + WORTH * first.own
            own /= known.sum(axis=0) + WORTH
        return replace(self, mean=mean, covariance=covariance, own=own)
