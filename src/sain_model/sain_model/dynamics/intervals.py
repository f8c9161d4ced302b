"""How sure a prediction is: what its ensemble and its friction leave open, and a 90 % region.

A disk's region is a circle about its predicted place. Its radius is

    r = factor(score) * score,   score = (noise + a members + b friction + c way) exp(d elongation)

with ``members`` how far the ensemble's members disagree, ``friction`` how far the prediction
moves with what is not known of the friction, and ``way`` how far the disk is predicted to move,
all in metres, and ``elongation`` how near a body's supports are to one line, from 0 to 1. For disks
it is not looked at. What a, b, c, d and the factors are was fitted to validation episodes
(`sain_model.training.interval_fit`) and stands on the checkpoint's card.

A world may be unlike that of these episodes. So a model of any shape compares the errors of an
episode's earlier pushes with their radii, and widens its regions when they are larger than usual.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.dataset import Transitions
from sain_core.errors import ConfigError
from sain_core.history import PushHistory
from sain_core.model import REGION_STD
from sain_core.push import pushed_bodies
from sain_core.scene import MID, POSITION
from sain_core.types import Indices, Scalars, Scenes

LEVEL: Final = 0.9  # share of the pushes whose region holds the disk
LEAST_LOG: Final = -3.0  # smaller logarithms of error over radius count as this
UNLIKE_ODDS: Final = 0.3  # that a world is unlike that of the validation episodes, beforehand
UNLIKE_STD: Final = 2.0  # of the logarithm by which errors are larger there
UNLIKE_SCATTER: Final = 1.0  # standard deviation of that logarithm over the pushes of an episode
QUANTILE: Final = 1.28  # of a standard normal, at `LEVEL`


@dataclass(frozen=True)
class IntervalConfig(Config):
    """The radius of one disk's region."""

    noise: float = option(1e-4, "score of a disk about which nothing is open", unit="m", minimum=0)
    members: float = option(1.0, "of the members' spread", minimum=0.0)
    friction: float = option(1.0, "of the friction's spread", minimum=0.0)
    way: float = option(0.0, "of the predicted way", minimum=0.0)
    elongation: float = option(0.0, "of the elongation of a body's supports, in the exponent")
    scores: tuple[float, ...] = option((1e-4,), "at these scores, rising", unit="m", minimum=0.0)
    factors: tuple[float, ...] = option((2.0,), "the radius is so many scores", minimum=0.0)

    def __post_init__(self) -> None:
        """Check the fields, and that there is one factor for each score."""
        super().__post_init__()
        rising = all(a < b for a, b in zip(self.scores, self.scores[1:], strict=False))
        if len(self.scores) != len(self.factors) or not self.scores or not rising:
            raise ConfigError(
                f"IntervalConfig has scores {self.scores} and factors {self.factors}; it needs one"
                " factor for each score, and the scores must rise"
            )
        if min(self.scores) <= 0.0 or self.noise <= 0.0:
            raise ConfigError("IntervalConfig.scores and .noise must be greater than 0 m")

    def score(
        self,
        members: Scalars,
        friction: Scalars,
        way: Scalars,
        elongation: Scalars | float | None = None,
    ) -> Scalars:
        """Return the score (B,) [m]; elongation None: of disks."""
        told = self.members * members + self.friction * friction + self.way * way
        score = np.asarray(self.noise + told)
        return score if elongation is None else score * np.exp(self.elongation * elongation)

    def radius(self, score: Scalars) -> Scalars:
        """Return the radius (B,) [m] at scores (B,) [m]: factors between scores by their log."""
        logs = np.interp(np.log(score), np.log(self.scores), np.log(self.factors))
        return np.asarray(score * np.exp(logs))


@dataclass(frozen=True)
class Intervals(Config):
    """The regions of a model's disks; further disks are taken like the target."""

    level: float = option(LEVEL, "share of the pushes whose region contains the disk", minimum=0.01)
    mid: IntervalConfig = IntervalConfig()
    target: IntervalConfig = IntervalConfig()
    usual_log: float = option(0.0, "mean logarithm of error over radius of pushed bodies")
    usual_log_std: float = option(
        0.0, "its standard deviation; 0: regions are never widened", minimum=0.0
    )

    @property
    def adapts(self) -> bool:
        """Whether earlier pushes can widen regions."""
        return self.usual_log_std > 0.0

    def excess(self, off: Scalars, radius: Scalars) -> Scalars:
        """Return the logarithm by which errors (P,) [m] of pushed bodies are larger than usual."""
        logs = np.log(np.maximum(off, 1e-12) / radius)
        return np.asarray(np.maximum(logs, LEAST_LOG) - self.usual_log)

    def widening(self, total: Scalars, pushes: Int[ndarray, "B"]) -> Scalars:
        """Return factors (B,) of the radii after so many pushes with this total excess.

        There are two hypotheses: errors are as usual, or larger by a logarithm that is normal with
        `UNLIKE_STD`. Its posterior mean, and what is open about it, count by the posterior
        probability of the second one. Regions never become smaller.
        """
        count = np.maximum(pushes, 1)
        mean = total / count
        usual, noise = self.usual_log_std**2 / count, UNLIKE_SCATTER**2 / count
        wide = noise + UNLIKE_STD**2
        evidence = 0.5 * (mean**2 * (1.0 / usual - 1.0 / wide) - np.log(wide / usual))
        unlike = 1.0 / (1.0 + np.exp(-np.clip(evidence, -50.0, 50.0)) / UNLIKE_ODDS)
        larger = mean * UNLIKE_STD**2 / wide
        scatter = np.sqrt(UNLIKE_SCATTER**2 + noise * UNLIKE_STD**2 / wide)
        log = unlike * (larger + QUANTILE * np.maximum(scatter - self.usual_log_std, 0.0))
        return np.asarray(np.where((pushes > 0) & (mean > 0.0), np.exp(log), 1.0))

    def radii(
        self,
        opened: "Prediction",
        scenes: Scenes,
        pushed: Indices | None = None,
        elongation: Float[ndarray, "N"] | None = None,
    ) -> Float[ndarray, "B N"]:
        """Return the radius of every body's region for a prediction from these scenes.

        Args:
            opened: the prediction.
            scenes: (B, N, 8), before the pushes.
            pushed: which body each push is against (B,); None: body 0.
            elongation: of each body's supports (N,); None: they are disks.
        """
        way = np.linalg.norm((opened.mean - scenes)[..., POSITION], axis=-1)
        radii = np.empty_like(way)
        for disk in range(way.shape[1]):
            parts = (opened.members[:, disk], opened.friction[:, disk], way[:, disk])
            long = None if elongation is None else float(elongation[disk])
            mid, target = (
                each.radius(each.score(*parts, long)) for each in (self.mid, self.target)
            )
            first = np.full(len(way), MID) if pushed is None else pushed
            radii[:, disk] = np.where(first == disk, mid, target)
        return radii


@dataclass(frozen=True)
class Prediction:
    """Where pushes lead, and how sure that is.

    Attributes:
        mean: the predicted scenes, the members' mean.
        members: standard deviation of the members' places [m]; 0 for a lone network.
        friction: how far the place moves with one standard deviation of the friction, and of the
            ratio of masses where these are not measured [m].
        radius: of the circle that holds the disk [m]; None: the model has no intervals.
    """

    mean: Float[ndarray, "B N 8"]
    members: Float[ndarray, "B N"]
    friction: Float[ndarray, "B N"]
    radius: Float[ndarray, "B N"] | None = None

    @property
    def spread(self) -> Float[ndarray, "B N"]:
        """What is open altogether, the members and the friction [m]."""
        return np.hypot(self.members, self.friction)


def pushed_errors(told: Prediction, pushes: Transitions) -> tuple[Scalars, Scalars]:
    """Return how far off pushed bodies (M,) came to lie [m], and the radii of their regions.

    Where the pushes were observed with noise, the radii include it.
    """
    assert told.radius is not None
    row = np.arange(len(pushes)), pushed_bodies(pushes.action)
    off = np.linalg.norm((told.mean - pushes.next_state)[..., POSITION], axis=-1)
    radius = told.radius[row]
    if isinstance(pushes, PushHistory) and pushes.noise is not None:
        radius = np.hypot(radius, REGION_STD * pushes.noise[row])
    return off[row], radius
