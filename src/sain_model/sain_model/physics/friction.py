"""The friction between disks and table, inferred from an episode's earlier pushes.

No single scene shows it. A prior at the right friction predicts a push well. On a grid of F,

    p(F | pushes) ~ p(F) prod_i prod_disk t(|predicted_i(F) - seen_i| / scale_i)

with Student's t in the plane, so that one push that no friction explains does not decide, and a
scale that grows with how far the disk moved. Mid disk and target are looked at, no others.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, Protocol, Self, runtime_checkable

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.history import PushHistory
from sain_core.scene import MID, POSITION, TARGET
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scenes
from sain_model.compute.latest_pushes import LatestPushes
from sain_model.physics.parameters import Values

WATCHED: Final = slice(MID, TARGET + 1)  # the first bodies, one or two
CHUNK: Final = 32_768  # predictions at a time: bounds memory


@runtime_checkable
class FrictionPhysics(Protocol):
    """Physics that can be told the friction: the planar prior."""

    @property
    def bodies(self) -> Bodies:
        """What it predicts."""
        ...

    def step(self, scenes: Scenes, pushes: Pushes, values: Values | None = None) -> Scenes:
        """Predict scenes (B, N, 8) after pushes (B, 5), with values by name (B,)."""
        ...


@dataclass(frozen=True)
class FrictionConfig(Config):
    """What is believed of the friction beforehand, and how far physics is trusted.

    The prior is wide on purpose: about the nominal 0.12 it reaches from 0.03 to 0.48, well beyond
    the randomised world's 0.08 to 0.20. The noise is fitted to training data by
    `sain_model.data.friction_noise`.
    """

    reach: float = option(
        4.0, "frictions from the nominal one / this to the nominal one x this", minimum=1.01
    )
    points: int = option(61, "frictions looked at, evenly in their logarithm", minimum=2)
    width: float = option(
        0.5, "of the prior: standard deviation of the logarithm about the nominal", minimum=0.01
    )
    noise: float = option(
        0.0003, "error of physics for a disk that hardly moved", unit="m", minimum=1e-6
    )
    outline_noise: float = option(
        0.002, "likewise, in scenes with bodies that are not round", unit="m", minimum=1e-6
    )
    noise_share: float = option(
        0.02, "and by how much it grows, share of the way that the body moved", minimum=0.0
    )
    tail: float = option(3.0, "degrees of freedom of Student's t", minimum=1.0)


@dataclass(frozen=True, eq=False)
class FrictionBelief:
    """What is believed of the friction after some pushes.

    Attributes:
        grid: the frictions looked at.
        log_weights: of each, up to a constant.
        nominal: what is assumed before the first push.
        pushes: how many pushes it rests on.
    """

    grid: Float[ndarray, "F"]
    log_weights: Float[ndarray, "F"]
    nominal: float
    pushes: int = 0

    @property
    def weights(self) -> Float[ndarray, "F"]:
        """The probability of each friction."""
        return _normalised(self.log_weights)

    @property
    def mean(self) -> float:
        """The friction to reckon with: the mean of the logarithm, or the nominal one at first."""
        if self.pushes == 0:
            return self.nominal
        return float(np.exp(self.weights @ np.log(self.grid)))

    @property
    def spread(self) -> float:
        """Standard deviation of the logarithm: by about which share the mean may be off."""
        return float(_moments(self.log_weights, self.grid)[1])

    def after(self, log_likelihood: Float[ndarray, "F"]) -> Self:
        """Return the belief after one more push."""
        log_weights = self.log_weights + log_likelihood
        return type(self)(self.grid, log_weights, self.nominal, self.pushes + 1)


@dataclass(frozen=True, eq=False)
class EpisodeFriction:
    """For each of M pushes, what other pushes of its own episode tell."""

    mean: Float[ndarray, "M"]  # to reckon with; the nominal friction where there is no other push
    spread: Float[ndarray, "M"]  # standard deviation of its logarithm
    pushes: Int[ndarray, "M"]  # how many it rests on


@dataclass(frozen=True)
class FrictionFilter:
    """Infers friction with one physics: what was seen is compared with it."""

    physics: FrictionPhysics
    nominal: float  # assumed before the first push
    config: FrictionConfig = FrictionConfig()
    _latest: LatestPushes = field(
        default_factory=LatestPushes, init=False, compare=False, repr=False
    )

    @cached_property
    def grid(self) -> Float[ndarray, "F"]:
        """The frictions looked at; their middle is the nominal one, as the prior's is."""
        return self.nominal * np.exp(self._logs)

    @cached_property
    def _logs(self) -> Float[ndarray, "F"]:
        reach = np.log(self.config.reach)
        return np.linspace(-reach, reach, self.config.points)

    @cached_property
    def _log_prior(self) -> Float[ndarray, "F"]:
        return -0.5 * (self._logs / self.config.width) ** 2

    def start(self) -> FrictionBelief:
        """Return what is believed when an episode begins."""
        return FrictionBelief(self.grid, self._log_prior, self.nominal)

    def infer(self, history: PushHistory) -> FrictionBelief:
        """Return what is believed after these pushes."""
        return self.believe(self.likelihoods(history))

    def likelihoods(self, history: PushHistory) -> Float[ndarray, "M F"]:
        """Return how well each friction explains each of M pushes, as they were observed.

        Pushes of the last call are not simulated again.
        """
        errors = self._latest.rows(history, self.errors)
        noise = None if history.noise is None else history.noise[:, WATCHED]
        return self.weigh(errors, ways(history.state, history.next_state), noise)

    def believe(self, likelihood: Float[ndarray, "M F"]) -> FrictionBelief:
        """Return what is believed after pushes with these log likelihoods."""
        belief = self.start()
        for push in likelihood:
            belief = belief.after(push)
        return belief

    def log_likelihood(
        self, scenes: Scenes, pushes: Pushes, next_scenes: Scenes
    ) -> Float[ndarray, "M F"]:
        """Return how well each friction explains each of M pushes, up to a constant a push."""
        errors = self.errors(scenes, pushes, next_scenes)
        return self.weigh(errors, ways(scenes, next_scenes))

    def errors(
        self, scenes: Scenes, pushes: Pushes, next_scenes: Scenes
    ) -> Float[ndarray, "M F W"]:
        """Return how far off mid disk and target are predicted at each friction [m]."""
        grid, count = self.grid, len(pushes)
        errors = np.empty((count, len(grid), min(scenes.shape[1], WATCHED.stop)))
        size = max(CHUNK // len(grid), 1)
        for first in range(0, count, size):
            rows = slice(first, min(first + size, count))
            predicted = self.physics.step(
                np.repeat(scenes[rows], len(grid), axis=0),
                np.repeat(pushes[rows], len(grid), axis=0),
                {"friction": np.tile(grid, rows.stop - first)},
            ).reshape(rows.stop - first, len(grid), *scenes.shape[1:])
            off = (predicted - next_scenes[rows, None])[:, :, WATCHED, POSITION]
            errors[rows] = np.linalg.norm(off, axis=-1)
        return errors

    def weigh(
        self,
        errors: Float[ndarray, "M F W"],
        moved: Float[ndarray, "M W"],
        noise: Float[ndarray, "M W"] | None = None,
    ) -> Float[ndarray, "M F"]:
        """Return the log-likelihood of errors [m] of disks that moved so far [m].

        `noise` [m] is the standard deviation of what was seen of them, where it is not exact.
        """
        config = self.config
        least = config.noise if self.physics.bodies.all_round else config.outline_noise
        scale = least + config.noise_share * moved[:, None]
        if noise is not None:
            scale = np.hypot(scale, noise[:, None])
        terms = np.log1p((errors / scale) ** 2 / config.tail)
        return np.asarray(-0.5 * (config.tail + 2.0) * terms.sum(axis=-1))

    def earlier(
        self,
        log_likelihood: Float[ndarray, "M F"],
        episodes: Int[ndarray, "M"],
        steps: Int[ndarray, "M"],
        most: Int[ndarray, "M"] | None = None,
    ) -> EpisodeFriction:
        """Return for each of M pushes what the earlier pushes of its episode tell.

        Args:
            log_likelihood: of each push by itself.
            episodes: (M,), which episode each belongs to.
            steps: (M,), its place in the episode.
            most: (M,), how many of the earlier pushes count, the latest; None: all.
        """
        order = np.lexsort((steps, episodes))
        sums = np.zeros((len(order) + 1, log_likelihood.shape[1]))
        np.cumsum(log_likelihood[order], axis=0, out=sums[1:])
        _, first, place = np.unique(episodes[order], return_index=True, return_inverse=True)
        number = np.arange(len(order))  # of a push in this order
        known = number - first[place]
        if most is not None:
            known = np.minimum(known, most[order])
        told = sums[number] - sums[number - known]  # the push itself is not in it
        back = np.argsort(order)
        return self.told(told[back], known[back])

    def others(
        self, log_likelihood: Float[ndarray, "M F"], episodes: Int[ndarray, "M"]
    ) -> EpisodeFriction:
        """Return for each of M pushes what all other pushes of its episode tell, later ones too.

        With such hindsight, one learns what physics gets wrong, and not what the friction is.
        """
        _, place, count = np.unique(episodes, return_inverse=True, return_counts=True)
        sums = np.zeros((len(count), log_likelihood.shape[1]))
        np.add.at(sums, place, log_likelihood)
        return self.told(sums[place] - log_likelihood, count[place] - 1)

    def told(self, told: Float[ndarray, "M F"], pushes: Int[ndarray, "M"]) -> EpisodeFriction:
        """Return what sums of log-likelihoods tell, each of so many pushes."""
        mean, spread = _moments(self._log_prior + told, self.grid)
        return EpisodeFriction(np.where(pushes == 0, self.nominal, np.exp(mean)), spread, pushes)


def ways(scenes: Scenes, next_scenes: Scenes) -> Float[ndarray, "M W"]:
    """Return how far mid disk and target moved [m]."""
    moved = (next_scenes - scenes)[:, WATCHED, POSITION]
    return np.asarray(np.linalg.norm(moved, axis=-1))


def _normalised(log_weights: ndarray) -> ndarray:
    weights = np.exp(log_weights - log_weights.max(axis=-1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=-1, keepdims=True))


def _moments(log_weights: ndarray, grid: ndarray) -> tuple[ndarray, ndarray]:
    """Return mean and standard deviation of the logarithm of the friction."""
    weights, logs = _normalised(log_weights), np.log(grid)
    mean = weights @ logs
    variance = (weights * (logs - mean[..., None]) ** 2).sum(axis=-1)
    return mean, np.sqrt(variance)
