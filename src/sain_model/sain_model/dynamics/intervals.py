"""How sure a prediction is: what its ensemble and its friction leave open, and a 90 % region.

A disk's region is a circle about its predicted place. Its radius is

    r = factor(score) * score,   score = (noise + a members + b friction + c way) exp(d elongation)

with ``members`` how far the ensemble's members disagree, ``friction`` how far the prediction
moves with what is not known of the friction, and ``way`` how far the disk is predicted to move,
all in metres, and ``elongation`` how near a body's supports are to one line, from 0 to 1. For disks
it is not looked at. What a, b, c, d and the factors are was fitted to validation episodes
(`sain_model.training.interval_fit`) and stands on the checkpoint's card.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.scene import MID, POSITION
from sain_core.types import Indices, Scalars, Scenes

LEVEL: Final = 0.9  # share of the pushes whose region holds the disk


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
        friction: how far the place moves with one standard deviation of the friction [m].
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
