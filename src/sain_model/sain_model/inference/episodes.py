"""What the episodes of a laboratory show of the next one: a Gaussian model of their parameters.

A parameter of an episode is the sum of two parts: one of the laboratory, and one of the episode, or
of each of its bodies, if it is a parameter of bodies. Each episode is fitted by itself, and begins
with what all others show. How large the parts of episodes are is learned by the evidence (MacKay
1992). So the pushes of an episode show anew what differs between episodes, and no more than that.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_model.inference.kinds import WIDE, Kind, own_share
from sain_model.inference.population import likelihoods
from sain_model.inference.posterior import Fit, Parts, fit

WORTH: Final = 1.0  # of that share, in observed episodes
SWEEPS: Final = 30  # of variances and means


@dataclass(frozen=True, eq=False)
class Episodes:
    """Episodes of a laboratory, and what is believed of another one."""

    kind: Kind  # of physics, and what is believed before any push
    mean: Float[ndarray, "D"]  # vector z of the laboratory
    covariance: Float[ndarray, "D D"]  # of it
    own: Float[ndarray, "D"]  # variances of what episodes, or bodies, have of their own
    fit: Fit | None = None  # the latest one, relative to the mean before it
    # vectors z of scenes by episode (`Kind.of_scene`), each perhaps of fewer bodies than the latest
    at: Mapping[str, ndarray] = field(default_factory=dict)

    @classmethod
    def before(cls, kind: Kind) -> Self:
        """Return what is believed before any push.

        What is wide for a lone episode is not: many episodes show how wide it is.
        """
        usual = np.array([1.0 / WIDE.get(name, 1.0) for name in kind.names])
        own = np.array(list(map(own_share, kind.parameters))) * (usual * kind.deviations) ** 2
        covariance = np.outer(usual, usual) * kind.covariance
        return cls(kind, np.zeros(len(own)), covariance - np.diag(own), own)

    @property
    def bodies(self) -> int:
        """The most bodies of a scene that was fitted."""
        return 1 if self.fit is None else self.fit.kind.bodies

    @property
    def places(self) -> ndarray:
        """The vectors z of all episodes, in order, of scenes of so many bodies."""
        return np.stack(list(self.at.values()))

    @property
    def means(self) -> Float[ndarray, "C D"]:
        """Vectors z of all episodes with the means over their bodies."""
        design = self.kind.of_scene(self.bodies).design
        return np.asarray(self.places @ (design / design.sum(axis=0)))

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
        own = self.own * np.array([one.scope == "body" for one in self.kind.parameters])
        covariance = self.covariance + np.diag(self.own)
        return self.kind.believing(self.mean, covariance, np.diag(own))

    def learn(self, parts: Parts, names: Sequence[str], steps: int) -> Self:
        """Return what all these episodes show, by the names that `parts` count them by.

        Each is fitted from where it was, or from the mean, by so many steps at most.
        """
        kind = self.next.of_scene(max(part.disks for part in parts))
        mean = kind.design @ self.mean
        start = np.zeros((len(names), len(mean)))
        for row, name in enumerate(names):
            before = self.at.get(name, mean[:0])
            start[row, : len(before)] = before - mean[: len(before)]
        found = fit(kind, parts, start, steps)
        at = dict(zip(names, mean + found.places, strict=True))
        return replace(self, fit=found, at=at)._learned(*likelihoods(found, mean), kind.design)

    def _learned(
        self,
        information: Float[ndarray, "C E E"],
        pull: Float[ndarray, "C E"],
        design: Float[ndarray, "E D"],
    ) -> Self:
        """Return mean and variances that likelihoods of scenes show; see `Kind.design`."""
        first = self.before(self.kind)
        precision, own = np.linalg.inv(first.covariance), self.own
        for _ in range(SWEEPS):
            inside = np.linalg.inv(information + np.diag(design @ (1.0 / own)))
            tied = inside @ information
            shown = information - information @ tied  # of the mean, by each episode
            covariance = np.linalg.inv(precision + design.T @ shown.sum(axis=0) @ design)
            told = pull - (information @ inside @ pull[..., None])[..., 0]
            mean = covariance @ (design.T @ told.sum(axis=0))
            apart = (inside @ (pull - information @ (design @ mean))[..., None])[..., 0]
            along = tied @ design
            spread = inside + along @ covariance @ np.swapaxes(along, 1, 2)
            known = np.maximum(1.0 - np.diagonal(spread, axis1=1, axis2=2) / (design @ own), 0.0)
            own = design.T @ (apart**2).sum(axis=0) + WORTH * first.own
            own /= design.T @ known.sum(axis=0) + WORTH
        return replace(self, mean=mean, covariance=covariance, own=own)
