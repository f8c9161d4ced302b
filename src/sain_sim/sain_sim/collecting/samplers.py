"""Which pushes an episode tries; whether one can be carried out shows later."""

from math import pi
from typing import Final

import numpy as np

from sain_core.push import PaperGrid, PushLimits, make_push
from sain_core.scene import MID, POSITION, RADIUS, TARGET, wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.shapes.outline import outline_of
from sain_core.shapes.shape import Shape
from sain_core.types import PushArray, Scene

AIMED: Final = 0.6  # share of pushes aimed through the target
AIM_SPREAD: Final = 0.35  # [rad], standard deviation of the aim
SHORTEST: Final = 0.02  # [m], shortest travel


class CircleSampler:
    """Pushes from any side of the disk; a share of them roughly through the target."""

    def draw(
        self, generator: np.random.Generator, scene: Scene, bodies: Bodies = PAPER_DISKS
    ) -> PushArray:
        """Return a push (5,) for a scene (N, 8) of disks."""
        limits = PushLimits()
        angle = generator.uniform(-limits.max_angle, limits.max_angle)
        length = generator.uniform(SHORTEST, limits.max_length)
        heading = generator.uniform(-pi, pi)
        if generator.uniform() < AIMED:
            way = scene[TARGET, POSITION] - scene[MID, POSITION]
            heading = np.arctan2(way[1], way[0]) + generator.normal(0.0, AIM_SPREAD)
        return make_push(wrap_angle(np.asarray(heading - angle)), angle, length)


class OutlineSampler:
    """Pushes evenly along the outlines of all pushable bodies."""

    def draw(
        self, generator: np.random.Generator, scene: Scene, bodies: Bodies = PAPER_DISKS
    ) -> PushArray:
        """Return a push (5,) for a scene (N, 8) of bodies."""
        lengths = [scene[body, RADIUS] * perimeter(bodies.shapes[body]) for body in bodies.pushable]
        body = generator.choice(bodies.pushable, p=np.array(lengths) / sum(lengths))
        limits = PushLimits()
        location = -generator.uniform(-pi, pi)  # (-pi, pi]
        angle = generator.uniform(-limits.max_angle, limits.max_angle)
        length = generator.uniform(SHORTEST, limits.max_length)
        return make_push(location, angle, length, body=body)


def perimeter(shape: Shape) -> float:
    """Return the length of an outline [radii]."""
    return 2 * pi if shape.is_round else outline_of(shape).perimeter


class GridSampler:
    """The paper's: one of 105 pushes, each as likely (section III-B a)."""

    def __init__(self, grid: PaperGrid) -> None:
        """Draw from this grid."""
        self._pushes = grid.pushes()

    def draw(
        self, generator: np.random.Generator, scene: Scene, bodies: Bodies = PAPER_DISKS
    ) -> PushArray:
        """Return a push (5,), whatever the scene."""
        return np.asarray(self._pushes[generator.integers(len(self._pushes))])
