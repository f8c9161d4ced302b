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
pushes with their regions. Bodies differ by a factor whose spread was fitted: regions follow it.
Where errors are larger than any of these, regions widen further.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any, Final, Self

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.config import Config, option, typed_settings
from sain_core.errors import ConfigError
from sain_core.model import REGION_STD
from sain_core.push import pushed_bodies
from sain_core.scene import POSITION, RADIUS, THETA, wrap_angle
from sain_core.transitions import PushHistory, Transitions
from sain_core.types import Indices, Scalars, Scenes

LEVEL: Final = 0.9  # share of the pushes whose region holds the disk
LEAST_LOG: Final = -3.0  # smaller logarithms of error over radius count as this
UNLIKE_ODDS: Final = 0.3  # that a world is unlike that of the validation episodes, beforehand
UNLIKE_STD: Final = 2.0  # of the logarithm by which errors are larger there
UNLIKE_SCATTER: Final = 1.0  # standard deviation of that logarithm over the pushes of an episode
QUANTILE: Final = 1.28  # of a standard normal, at `LEVEL`


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
class Intervals(Config):
    """The regions of a model's disks; further disks are taken like the target.

    The logarithms of error over region are those of pushed bodies: of places, and of headings.
    """

    level: float = option(
        LEVEL, "share of pushes whose region holds the disk", minimum=0.01, maximum=0.99
    )
    mid: Region = Region()  # of pushed bodies
    target: Region = Region()  # of others
    turn: Region = Region()  # of headings
    usual_log: tuple[float, float] = (0.0, 0.0)  # mean logarithms of error over region
    # their standard deviations; 0 of places: regions are never widened; 0 of headings: these have
    # no regions
    usual_log_std: tuple[float, float] = option((0.0, 0.0), "", minimum=0.0)
    # how much of that is between bodies
    bodies_log_std: tuple[float, float] = option((0.0, 0.0), "", minimum=0.0)

    @classmethod
    def parse(cls, part: dict[str, Any]) -> Self:
        """Return the intervals on a card; raises what values of another kind raise."""
        if missing := [item.name for item in fields(cls) if item.name not in part]:
            raise ConfigError(f"they lack {', '.join(missing)}")
        return cls(**typed_settings(cls, part))

    @property
    def adapts(self) -> bool:
        """Whether earlier pushes can widen regions."""
        return self.usual_log_std[0] > 0.0

    def excess(self, prediction: "Prediction", pushes: Transitions) -> Float[ndarray, "2 M"]:
        """Return the logarithms by which errors of pushed bodies are larger than usual.

        First those of places, then those of headings; 0 where these have no regions. Where pushes
        were observed with noise, the regions include it.
        """
        usual = np.array(self.usual_log)[:, None]
        logs = [_log_ratio(*part) for part in _errors_and_regions(prediction, pushes)]
        logs += [np.broadcast_to(usual[1], logs[0].shape)] * (2 - len(logs))
        return np.asarray(np.stack(logs) - usual)

    def widening(
        self, total: Float[ndarray, "2 B"], pushes: Int[ndarray, "B"]
    ) -> Float[ndarray, "2 B"]:
        """Return factors of regions of places and headings after pushes with this total excess.

        There are two hypotheses: errors are as usual, but for a factor of the body; or larger by a
        logarithm that is normal with `UNLIKE_STD`. Its posterior mean, and what is open about it,
        count by the posterior probability of the second one. Without a spread of bodies, regions
        never become smaller.
        """
        count = np.maximum(pushes, 1)
        mean = total / count
        parts = self.usual_log_std, self.bodies_log_std
        std, bodies = (np.array(part)[:, None] for part in parts)
        usual, noise = std**2 / count + bodies**2, UNLIKE_SCATTER**2 / count
        usual = np.maximum(usual, 1e-12)
        wide = noise + UNLIKE_STD**2
        evidence = 0.5 * (mean**2 * (1.0 / usual - 1.0 / wide) - np.log(wide / usual))
        unlike = 1.0 / (1.0 + np.exp(-np.clip(evidence, -50.0, 50.0)) / UNLIKE_ODDS)
        unlike = np.where(mean > 0.0, unlike, 0.0)
        larger = mean * UNLIKE_STD**2 / wide
        scatter = np.sqrt(UNLIKE_SCATTER**2 + noise * UNLIKE_STD**2 / wide)
        log = unlike * (larger + QUANTILE * np.maximum(scatter - std, 0.0))
        log += (1.0 - unlike) * mean * bodies**2 / usual
        return np.asarray(np.where((pushes > 0) & (std > 0.0), np.exp(log), 1.0))

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
        turn = arcs / scenes[..., RADIUS] if self.usual_log_std[1] > 0.0 else None
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


def _errors_and_regions(
    prediction: Prediction, pushes: Transitions
) -> Iterator[tuple[Scalars, Scalars]]:
    """Yield errors of pushed bodies and their regions (M,): places [m], and headings [rad]."""
    assert prediction.radius is not None
    row = np.arange(len(pushes)), pushed_bodies(pushes.action)
    off = (prediction.mean - pushes.next_state)[row]
    noise = np.zeros(len(pushes))
    if isinstance(pushes, PushHistory) and pushes.noise is not None:
        noise = REGION_STD * pushes.noise[row]
    yield np.linalg.norm(off[:, POSITION], axis=-1), np.hypot(prediction.radius[row], noise)
    if prediction.turn is not None:
        arm = pushes.state[row][:, RADIUS]
        yield np.abs(wrap_angle(off[:, THETA])), np.hypot(prediction.turn[row], noise / arm)


def _log_ratio(off: Scalars, region: Scalars) -> Scalars:
    return np.maximum(np.log(np.maximum(off, 1e-12) / region), LEAST_LOG)
