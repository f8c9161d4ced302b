"""The ratio of masses and the friction with the table, inferred together on a grid of both.

A tool that moves as commanded shows ratios of masses only. Pushes that move one body with another
tell them apart from friction; other pushes tell friction alone.
"""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.history import PushHistory
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.compute.latest_pushes import LatestPushes
from sain_model.identification.evidence import log_sum
from sain_model.physics.friction import FrictionConfig, FrictionFilter, ways
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import with_mass_ratio

RATIOS: Final = 17  # looked at, evenly in their logarithm
REACH: Final = 3.0  # standard deviations, from the one stated


@dataclass(frozen=True, eq=False)
class EpisodePhysics:
    """What pushes tell of the table's friction and of the masses, for each of R rows.

    Attributes:
        friction: to reckon with; the nominal one where a row knows no push.
        friction_log_std: standard deviation of its logarithm.
        mass_ratio: to reckon with, times that of the physics; 1 where a row knows no push.
        mass_log_std: standard deviation of its logarithm; 0: masses are measured.
    """

    friction: Scalars
    friction_log_std: Scalars
    mass_ratio: Scalars
    mass_log_std: Scalars


@dataclass(frozen=True)
class MassFilter:
    """Infers friction, and the ratio of masses where these are not measured.

    Attributes:
        friction: infers friction where masses are known.
        log_std: of the ratio before any push; 0: masses are measured, and one ratio is looked at.
    """

    friction: FrictionFilter
    log_std: float = 0.0
    _latest: LatestPushes = field(
        default_factory=LatestPushes, init=False, compare=False, repr=False
    )

    @cached_property
    def _log_ratios(self) -> Float[ndarray, "L"]:
        reach = REACH * self.log_std
        return np.linspace(-reach, reach, RATIOS) if reach else np.zeros(1)

    @cached_property
    def _log_ratio_prior(self) -> Float[ndarray, "L"]:
        return -0.5 * (self._log_ratios / self.log_std) ** 2 if self.log_std else np.zeros(1)

    @property
    def size(self) -> int:
        """The number G of pairs of a ratio and a friction that are looked at."""
        return len(self._log_ratios) * len(self.friction.grid)

    @cached_property
    def log_prior(self) -> Float[ndarray, "G"]:
        """The logarithm of the probability of each pair before any push."""
        friction = self.friction.start().log_weights
        both = self._log_ratio_prior[:, None] + friction
        return (both - log_sum(both.ravel(), 0)).ravel()

    def predict(self, scenes: Scenes, pushes: Pushes) -> Float[ndarray, "M G N 8"]:
        """Predict each push with each pair; masses are those of the pair."""
        grid, count = self.friction.grid, len(pushes)
        actions, frictions = np.repeat(pushes, len(grid), axis=0), np.tile(grid, count)
        parts = []
        for ratio in np.exp(self._log_ratios):
            weighed = np.repeat(with_mass_ratio(scenes, ratio), len(grid), axis=0)
            after = self.friction.physics.step(weighed, actions, {"friction": frictions})
            parts.append(after.reshape(count, len(grid), *scenes.shape[1:]))
        return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)

    def likelihoods(self, history: PushHistory) -> Float[ndarray, "M G"]:
        """Return how well each pair explains each of M pushes, as they were observed.

        Pushes of the last call are not simulated again.
        """
        errors = self._latest.rows(history, self._errors)
        noise = None if history.noise is None else history.noise[:, : errors.shape[-1]]
        moved = ways(history.state, history.next_state)
        return self.friction.weigh(errors, moved, noise)

    def _errors(
        self, scenes: Scenes, pushes: Pushes, next_scenes: Scenes
    ) -> Float[ndarray, "M G W"]:
        each = [
            self.friction.errors(with_mass_ratio(scenes, ratio), pushes, next_scenes)
            for ratio in np.exp(self._log_ratios)
        ]
        return np.concatenate(each, axis=1)

    def told(self, sums: Float[ndarray, "R G"], counts: Int[ndarray, "R"]) -> EpisodePhysics:
        """Return what sums of log-likelihoods tell, each of so many pushes."""
        each = sums.reshape(len(sums), len(self._log_ratios), -1)  # (R, L, F)
        prior = self._log_ratio_prior
        friction = self.friction.told(log_sum(each + prior[:, None], 1), counts)
        log_weights = log_sum(each + self.friction.start().log_weights, 2) + prior
        weights = np.exp(log_weights - log_sum(log_weights, 1)[:, None])
        mean = weights @ self._log_ratios
        variance = (weights * (self._log_ratios - mean[:, None]) ** 2).sum(axis=1)
        ratio = np.where(counts == 0, 1.0, np.exp(mean))
        return EpisodePhysics(friction.mean, friction.spread, ratio, np.sqrt(variance))


@lru_cache(maxsize=16)  # a filter remembers pushes, also those of the episode before
def mass_filter(prior: PlanarPrior, config: FrictionConfig, log_std: float) -> MassFilter:
    """Return what infers friction and masses with a prior, about what it assumes."""
    return MassFilter(prior.filter(config), log_std)
