"""Regions of our network's predictions at several levels, of the position and of the heading.

A model states its regions at one level. Here the same scores (`sain_model.dynamics.intervals`) are
fitted at each level, to pushes that no weight was fitted to. The region of a heading is an arc at
the body's circumscribed radius, so that one score in metres serves both.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from benchmarks.real.pushes import PushTable
from benchmarks.real.rows import LEVELS
from sain_core.scene import wrap_angle
from sain_core.types import Scalars
from sain_model.dynamics.intervals import IntervalConfig
from sain_model.training.interval_fit import fit_disk

Scores = Float[ndarray, "3 M"]  # of the members, of the physics, and the predicted way [m]


@dataclass(frozen=True)
class Regions:
    """Regions for each of `LEVELS`.

    Attributes:
        places: of the position.
        arcs: of the heading, as arcs.
    """

    places: tuple[IntervalConfig, ...]
    arcs: tuple[IntervalConfig, ...]

    def radius(self, scores: Scores) -> Float[ndarray, "M L"]:
        """Return the radii of circles about places [m]."""
        return _radii(self.places, scores)

    def turn(self, scores: Scores, reach: Scalars) -> Float[ndarray, "M L"]:
        """Return half of the intervals about headings [rad], of bodies of such a radius (M,)."""
        return _radii(self.arcs, scores) / reach[:, None]


def _radii(configs: tuple[IntervalConfig, ...], scores: Scores) -> Float[ndarray, "M L"]:
    """Return radii that do not fall where the level rises."""
    radii = [config.radius(config.score(*scores)) for config in configs]
    return np.maximum.accumulate(np.stack(radii, axis=1), axis=1)


def fit_regions(pushes: PushTable, poses: Float[ndarray, "M 3"], scores: Scores) -> Regions:
    """Fit regions to predictions of pushes."""
    off = np.linalg.norm(poses[:, :2] - pushes.after[:, :2], axis=1)
    arcs = pushes.radius * np.abs(wrap_angle(poses[:, 2] - pushes.after[:, 2]))
    return Regions(
        tuple(fit_disk(scores, off, level) for level in LEVELS),
        tuple(fit_disk(scores, arcs, level) for level in LEVELS),
    )
