"""How sure a prediction is: what its ensemble and its friction leave open, and 90 % regions.

A disk's region is a circle about its predicted place. Its radius is

    r = factor(score) * score,   score = (noise + a members + b friction + c way) exp(d elongation)

with ``members`` how far the ensemble's members disagree, ``friction`` how far the prediction
moves with what is not known of the friction, and ``way`` how far the disk is predicted to move,
all in metres, and ``elongation`` how near a body's supports are to one line, from 0 to 1. For disks
it is not looked at. What a, b, c, d and the factors are was fitted to validation episodes
(`sain_model.training.interval_fit`) and stands on the checkpoint's card. The region of a heading is
an arc at the body's circumscribed radius, with a score and factors of its own.

A body or a world may be unlike those of these episodes. So a model compares the errors of earlier
pushes with their regions. Errors over regions have a distribution with heavy tails, times a factor
of the body, which earlier pushes show (`Law`). The region is a quantile of the next error that is
predicted so. Which quantile it is, is conformal: by it, regions held the stated share of the
validation pushes, by the number of earlier pushes, and hardly less of any kind of world.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any, Final, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.special import betaln, fdtr, softmax

from sain_core.config import Config, option, typed_settings
from sain_core.errors import ConfigError
from sain_core.model import REGION_STD
from sain_core.push import pushed_bodies
from sain_core.scene import POSITION, RADIUS, THETA, wrap_angle
from sain_core.transitions import PushHistory, Transitions
from sain_core.types import Indices, Scalars, Scenes

LEVEL: Final = 0.9  # share of the pushes whose region holds the disk
LEAST: Final = 0.05  # smaller errors over regions count as this
FACTORS: Final = np.linspace(-3.0, 6.0, 91)  # logarithms of a body's factor
COUNTS: Final = (0, 1, 3, 10)  # earlier pushes, from which on the quantile is another one
HEAVY: Final = 3.0  # degrees of freedom of Student's t, of the factors' logarithm beforehand


@dataclass(frozen=True)
class Region(Config):
    """The radius of one body's region."""

    noise: float = option(
        1e-4, "score of a body about which nothing is open", unit="m", minimum=1e-12
    )
    members: float = option(1.0, "weight of the members' spread", minimum=0.0)
    friction: float = option(1.0, "weight of the friction's spread", minimum=0.0)
    way: float = option(0.0, "weight of the predicted way", minimum=0.0)
    elongation: float = 0.0  # weight of the elongation of a body's supports, in the exponent
    scores: tuple[float, ...] = option((1e-4,), "rising scores", unit="m", minimum=1e-12)
    factors: tuple[float, ...] = option((2.0,), "the radius is so many scores", minimum=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        rising = all(a < b for a, b in pairwise(self.scores))
        if len(self.scores) != len(self.factors) or not self.scores or not rising:
            raise ConfigError(
                f"Region has scores {self.scores} and factors {self.factors}; it needs one"
                " factor for each score, and the scores must rise"
            )

    def score(
        self, members: Scalars, friction: Scalars, way: Scalars, elongation: Scalars | float
    ) -> Scalars:
        """Return the score (B,) [m]."""
        told = self.members * members + self.friction * friction + self.way * way
        return np.asarray((self.noise + told) * np.exp(self.elongation * elongation))

    def radius(self, score: Scalars) -> Scalars:
        """Return the radius (B,) [m] at scores (B,) [m]: factors between scores by their log."""
        logs = np.interp(np.log(score), np.log(self.scores), np.log(self.factors))
        return np.asarray(score * np.exp(logs))


@dataclass(frozen=True)
class Law(Config):
    """The distribution of errors over regions: (error / (size factor))^2 is Fisher's F.

    That is Student's t in so many dimensions. The factor is of a body, or of an episode.
    """

    size: float = option(0.0, "of the errors over their regions; 0: regions stay", minimum=0.0)
    dimensions: float = option(2.0, "degrees of freedom of the numerator", minimum=0.1)
    tail: float = option(4.0, "degrees of freedom of the denominator", minimum=0.5)
    bodies: float = option(0.5, "spread of the logarithm of the factor", minimum=0.01)
    # the quantiles that are regions, from so many earlier pushes on as `COUNTS` says
    levels: tuple[float, ...] = (LEVEL,) * len(COUNTS)

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.levels) != len(COUNTS) or not all(0.0 < one <= 1.0 for one in self.levels):
            raise ConfigError(
                f"Law has levels {self.levels}; it needs {len(COUNTS)}, above 0 and at most 1"
            )

    def curves(self, ratio: Scalars) -> Float[ndarray, "M G"]:
        """Return log densities of the logarithm of errors over regions (M,) at each factor."""
        square = np.log(self.dimensions / self.tail) + 2.0 * np.log(self._over(ratio))
        shape = 0.5 * self.dimensions, 0.5 * self.tail
        return np.asarray(shape[0] * square - sum(shape) * np.logaddexp(0.0, square)) - betaln(
            *shape
        )

    def posterior(self, total: Float[ndarray, "B G"]) -> Float[ndarray, "B G"]:
        """Return probabilities of factors after pushes whose curves have these totals."""
        before = -0.5 * (HEAVY + 1.0) * np.log1p((FACTORS / self.bodies) ** 2 / HEAVY)
        return np.asarray(softmax(before + total, axis=1))

    def below(self, ratio: Scalars) -> Float[ndarray, "M G"]:
        """Return the probability of smaller errors over regions than these, at each factor."""
        return np.asarray(fdtr(self.dimensions, self.tail, self._over(ratio) ** 2))

    def quantile(self, total: Float[ndarray, "B G"], pushes: Int[ndarray, "B"]) -> Scalars:
        """Return what regions are multiplied by after pushes whose curves have these totals."""
        if self.size == 0.0:
            return np.ones(len(pushes))
        level = np.asarray(self.levels)[np.searchsorted(COUNTS, pushes, side="right") - 1]
        shares = self.posterior(total) @ self.below(np.exp(FACTORS)).T  # (B, G)
        rows = zip(level, shares, strict=True)
        return np.exp([np.interp(*row, FACTORS) for row in rows])

    def _over(self, ratio: Scalars) -> Float[ndarray, "M G"]:
        return np.asarray(np.maximum(ratio, LEAST)[:, None] / (self.size * np.exp(FACTORS)))


@dataclass(frozen=True)
class Intervals(Config):
    """The regions of a model's disks; further disks are taken like the target."""

    level: float = option(
        LEVEL, "share of pushes whose region holds the disk", minimum=0.01, maximum=0.99
    )
    mid: Region = Region()  # of pushed bodies
    target: Region = Region()  # of others
    turn: Region = Region()  # of headings
    places: Law = Law()  # of errors of pushed bodies
    headings: Law = Law()  # without a size, headings have no regions

    @classmethod
    def parse(cls, part: dict[str, Any]) -> Self:
        """Return the intervals on a card; raises what values of another kind raise."""
        if missing := [item.name for item in fields(cls) if item.name not in part]:
            raise ConfigError(f"they lack {', '.join(missing)}")
        return cls(**typed_settings(cls, part))

    @property
    def adapts(self) -> bool:
        """Whether earlier pushes change regions."""
        return self.places.size > 0.0

    def curves(self, prediction: "Prediction", pushes: Transitions) -> Float[ndarray, "M 2 G"]:
        """Return what errors of pushed bodies say of their factors: of places and headings.

        0 where these have no regions. Where pushes were observed with noise, regions include it.
        """
        found = np.zeros((len(pushes), 2, len(FACTORS)))
        laws = self.places, self.headings
        for column, ratio in enumerate(ratios(prediction, pushes)):
            if laws[column].size > 0.0:
                found[:, column] = laws[column].curves(ratio)
        return found

    def widening(
        self, total: Float[ndarray, "B 2 G"], pushes: Int[ndarray, "B"]
    ) -> Float[ndarray, "2 B"]:
        """Return factors of regions of places and headings after pushes with these curves."""
        laws = self.places, self.headings
        return np.stack([law.quantile(total[:, row], pushes) for row, law in enumerate(laws)])

    def about(
        self,
        opened: "Prediction",
        scenes: Scenes,
        pushed: Indices,
        elongation: Float[ndarray, "N"],
    ) -> "Prediction":
        """Return a prediction from scenes (B, N, 8) with the region of every body.

        `pushed` (B,) are the bodies that pushes are against, `elongation` is of bodies' supports.
        """
        way = np.linalg.norm((opened.mean - scenes)[..., POSITION], axis=-1)
        radii, arcs = np.empty_like(way), np.empty_like(way)
        for disk in range(way.shape[1]):
            parts = (opened.members[:, disk], opened.friction[:, disk], way[:, disk])
            mid, target, arcs[:, disk] = (
                each.radius(each.score(*parts, float(elongation[disk])))
                for each in (self.mid, self.target, self.turn)
            )
            radii[:, disk] = np.where(pushed == disk, mid, target)
        turn = arcs / scenes[..., RADIUS] if self.headings.size > 0.0 else None
        return replace(opened, radius=radii, turn=turn)


@dataclass(frozen=True)
class Prediction:
    """Where pushes lead, and how sure that is."""

    mean: Float[ndarray, "B N 8"]  # the predicted scenes, the members' mean
    # standard deviation of the members' places [m]; 0 for a lone network
    members: Float[ndarray, "B N"]
    # how far the place moves with one standard deviation of the friction, and of the ratio of
    # masses where these are not measured [m]
    friction: Float[ndarray, "B N"]
    # of the circle that holds the disk [m]; None: the model has no intervals
    radius: Float[ndarray, "B N"] | None = None
    # half of the interval that holds the heading [rad]; None: it has none of headings
    turn: Float[ndarray, "B N"] | None = None

    def widened(self, factors: Float[ndarray, "2 B"]) -> "Prediction":
        """Return it with regions of places and headings times factors."""
        assert self.radius is not None
        turn = None if self.turn is None else self.turn * factors[1][:, None]
        return replace(self, radius=self.radius * factors[0][:, None], turn=turn)


def ratios(prediction: Prediction, pushes: Transitions) -> Iterator[Scalars]:
    """Yield errors of pushed bodies over their regions (M,): of places, and of headings."""
    assert prediction.radius is not None
    row = np.arange(len(pushes)), pushed_bodies(pushes.action)
    off = (prediction.mean - pushes.next_state)[row]
    noise = np.zeros(len(pushes))
    if isinstance(pushes, PushHistory) and pushes.noise is not None:
        noise = REGION_STD * pushes.noise[row]
    yield np.linalg.norm(off[:, POSITION], axis=-1) / np.hypot(prediction.radius[row], noise)
    if prediction.turn is not None:
        arm = pushes.state[row][:, RADIUS]
        yield np.abs(wrap_angle(off[:, THETA])) / np.hypot(prediction.turn[row], noise / arm)
