"""Which pushes an episode tries."""

from dataclasses import dataclass
from math import pi
from typing import Protocol

import numpy as np

from sain_core.config import Config, option
from sain_core.push import PaperGrid, PushLimits
from sain_core.scene import MID, POSITION, TARGET, wrap_angle
from sain_core.types import PushArray, Scene


class PushSampler(Protocol):
    """Draws a push to try in a scene; whether it can be carried out shows later."""

    def draw(self, generator: np.random.Generator, scene: Scene) -> PushArray:
        """Return a push (3,) for a scene (N, 8)."""
        ...


@dataclass(frozen=True)
class CircleSampler(Config):
    """Pushes from any side of the disk; a share of them roughly through the target."""

    limits: PushLimits = PushLimits()
    aimed: float = option(0.6, "share of pushes aimed through the target", minimum=0.0, maximum=1.0)
    aim_spread: float = option(
        0.35, "standard deviation of the aim", unit="rad", minimum=0.0, maximum=pi
    )
    shortest: float = option(0.02, "shortest travel", unit="m", minimum=0.0, maximum=0.15)

    def draw(self, generator: np.random.Generator, scene: Scene) -> PushArray:
        """Return a push (3,) for a scene (N, 8)."""
        limits = self.limits
        angle = generator.uniform(-limits.max_angle, limits.max_angle)
        length = generator.uniform(self.shortest, limits.max_length)
        heading = generator.uniform(-pi, pi)
        if generator.uniform() < self.aimed:
            way = scene[TARGET, POSITION] - scene[MID, POSITION]
            heading = np.arctan2(way[1], way[0]) + generator.normal(0.0, self.aim_spread)
        return np.array([wrap_angle(np.asarray(heading - angle)), angle, length])


class GridSampler:
    """The paper's: one of 105 pushes, each as likely (section III-B a)."""

    def __init__(self, grid: PaperGrid) -> None:
        """Draw from this grid."""
        self._pushes = grid.pushes()

    def draw(self, generator: np.random.Generator, scene: Scene) -> PushArray:
        """Return a push (3,), whatever the scene."""
        return np.asarray(self._pushes[generator.integers(len(self._pushes))])
