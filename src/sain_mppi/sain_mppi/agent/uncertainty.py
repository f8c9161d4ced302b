"""How certain the poses of bodies are, and whether a goal is reached with enough probability."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, erf, sqrt
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import option
from sain_core.errors import OutOfRangeError
from sain_core.goal import Goal, Judgement
from sain_core.scene import (
    MASS,
    POSE,
    POSITION,
    SETTLED_SPEED,
    SETTLED_SPIN,
    THETA,
    VELOCITY,
    wrap_angle,
)
from sain_core.types import Mask, Scalars, Scene, Scenes
from sain_core.world import ObservationConfig

POINTS: Final = 201  # of the integral of a probability
FEWEST_FRAMES: Final = 2  # of noisy ones: one shows no motion
OUTLIER: Final = 3.7  # standard deviations: a prediction that is further off does not count
MOTION: Final = 4.5  # standard deviations of a slope: more is motion


@dataclass(frozen=True)
class EstimatorConfig(ObservationConfig):
    """How bodies are observed, as far as the planner has it, and what it makes of it.

    With exact and immediate observations each settled scene is taken as it is.
    """

    precision: float = option(
        0.001,
        "standard deviation of positions down to which frames at rest are averaged",
        unit="m",
        minimum=1e-4,
        maximum=0.02,
    )
    turn_precision: float = option(
        0.01, "the same for headings", unit="rad", minimum=1e-3, maximum=0.35
    )
    most_frames: int = option(90, "frames that are waited for at most", minimum=FEWEST_FRAMES)
    confidence: float = option(
        0.95, "least probability with which a goal counts as reached", minimum=0.5, maximum=0.999
    )

    @property
    def frames(self) -> int:
        """The number of frames at rest that an estimate is made of."""
        place, turn = self.noise_std
        if not (place or turn):
            return 1
        wanted = ceil(max(place / self.precision, turn / self.turn_precision) ** 2 - 1e-9)
        return min(max(wanted, FEWEST_FRAMES), self.most_frames)


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """How certain the poses of N bodies are: standard deviations of normal errors."""

    places: Scalars  # (N,) [m], of each coordinate
    turns: Scalars  # (N,) [rad]
    confidence: float = 1.0  # least probability with which a goal counts as reached

    def within(self, body: int, distance: float, tolerance: float) -> float:
        """Return the probability that a body, seen so far from a place, is within a tolerance [m].

        With normal errors of both coordinates, along and across the line to the place.
        """
        std = float(self.places[body])
        if std == 0.0:
            return float(distance <= tolerance)
        along = np.linspace(-tolerance, tolerance, POINTS)
        density = np.exp(-0.5 * ((along - distance) / std) ** 2) / (std * sqrt(2.0 * np.pi))
        across = np.sqrt(np.maximum(tolerance**2 - along**2, 0.0)) / (std * sqrt(2.0))
        return float(np.trapezoid(density * [erf(a) for a in across.tolist()], along))

    def turned_within(self, body: int, turn: float, tolerance: float) -> float:
        """Return the probability that a body's heading, seen so far off, is within a tolerance."""
        std = float(self.turns[body])
        if std == 0.0:
            return float(abs(turn) <= tolerance)
        high, low = ((end - turn) / (std * sqrt(2.0)) for end in (tolerance, -tolerance))
        return 0.5 * (erf(high) - erf(low))

    def is_reached(self, judged: Judgement) -> bool:
        """Tell whether all poses of a goal are met with enough probability."""
        probability = 1.0
        for pose, distance, turn in zip(
            judged.goal.poses, judged.distances, judged.turns, strict=True
        ):
            probability *= self.within(pose.body, float(distance), pose.tolerance)
            if pose.heading is not None:
                probability *= self.turned_within(pose.body, float(turn), pose.heading_tolerance)
        return probability >= self.confidence

    def check_tolerance(self, goal: Goal) -> None:
        """Check that a goal counts as reached where the bodies are seen exactly at it.

        Raises `OutOfRangeError`: its tolerances are too small for that.
        """
        nothing = np.zeros(len(goal.poses))
        there = Judgement(goal, nothing, nothing, np.zeros(0), at_rest=True, on_table=True)
        if not self.is_reached(there):
            raise OutOfRangeError(
                "the tolerances are too small for what is observed: poses have standard deviations"
                f" of {1e3 * self.places.max():.1f} mm and {self.turns.max():.3f} rad, and bodies"
                f" seen at the goal are within them with less than {100 * self.confidence:g} %;"
                " choose wider tolerances, or a smaller estimator.precision or"
                " estimator.confidence"
            )


Estimate = tuple[Scene, Uncertainty]
"""Poses of bodies at rest (N, 8), and how certain they are."""


def in_motion(scenes: Scenes, times: Float[ndarray, "B"], noise: tuple[float, float]) -> bool:
    """Tell whether frames (B, N, 8) of such noise show motion beyond that, and beyond rest."""
    offset = times - times.mean()
    weight = float((offset**2).sum())
    if len(times) < FEWEST_FRAMES or weight == 0.0:
        return False
    poses = _unwrapped(scenes)
    speeds = np.abs(np.tensordot(offset, poses, axes=1)) / weight  # (N, 3)
    slow = np.array([SETTLED_SPEED, SETTLED_SPEED, SETTLED_SPIN])
    scatter = np.array([noise[0], noise[0], noise[1]]) / sqrt(weight)
    return bool((speeds > slow + MOTION * scatter).any())


def _unwrapped(scenes: Scenes) -> Float[ndarray, "B N 3"]:
    """Return poses with headings that do not jump."""
    poses = scenes[..., POSE].copy()
    first = poses[0, :, THETA]
    poses[..., THETA] = first + wrap_angle(poses[..., THETA] - first)
    return poses


def fuse(
    frames: Sequence[Scene], noise: tuple[float, float], expected: Estimate | None = None
) -> Estimate:
    """Return where frames (N, 8) of bodies at rest, and what was expected, place the bodies.

    What is expected of a body counts by its inverse variance, unless it is an outlier.
    """
    scenes = np.stack(frames)
    scene, count = scenes[0].copy(), len(frames)
    scene[:, POSE] = _unwrapped(scenes).mean(axis=0) if count > 1 else scenes[0, :, POSE]
    scene[:, MASS:] = scenes[..., MASS:].mean(axis=0)
    scene[:, VELOCITY] = 0.0
    places, turns = (np.full(len(scene), std / sqrt(count)) for std in noise)
    if expected is not None:
        predicted, certain = expected
        off = predicted[:, POSE] - scene[:, POSE]
        off[:, THETA] = wrap_angle(off[:, THETA])
        far = np.linalg.norm(off[:, POSITION], axis=1) > OUTLIER * np.hypot(places, certain.places)
        share, places = _weights(places, certain.places, far)
        scene[:, POSITION] += share[:, None] * off[:, POSITION]
        far |= np.abs(off[:, THETA]) > OUTLIER * np.hypot(turns, certain.turns)
        share, turns = _weights(turns, certain.turns, far)
        scene[:, THETA] += share * off[:, THETA]
    scene[:, THETA] = wrap_angle(scene[:, THETA])
    return scene, Uncertainty(places, turns)


def _weights(observed: Scalars, expected: Scalars, outlier: Mask) -> tuple[Scalars, Scalars]:
    """Return the share (N,) by which what is expected counts, and the std (N,) of the mean."""
    total = observed**2 + expected**2
    share = np.where(outlier | (total == 0.0), 0.0, observed**2 / np.maximum(total, 1e-30))
    return share, observed * np.sqrt(1.0 - share)
