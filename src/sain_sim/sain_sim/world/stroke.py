"""The tool's way of a push."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LENGTH, PushLimits, strokes
from sain_core.scene import unit
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import PushArray, Scene


@dataclass(frozen=True)
class Stroke:
    """The tool's way in the world: a straight line from start (2,) to end (2,) [m]."""

    start: Float[ndarray, "2"]
    end: Float[ndarray, "2"]
    heading: float

    @classmethod
    def of_push(
        cls, scene: Scene, push: PushArray, limits: PushLimits, bodies: Bodies = PAPER_DISKS
    ) -> "Stroke":
        """Return the tool's way for a push (5,) in a scene (N, 8), of disks by default."""
        start, heading = strokes(scene, push, limits, bodies)
        return cls(start, start + push[LENGTH] * unit(heading), float(heading))

    def from_further_back(self, way: float) -> "Stroke":
        """Return this stroke with a start that lies further back by a way [m]."""
        return replace(self, start=self.start - way * unit(np.asarray(self.heading)))

    @property
    def length(self) -> float:
        """The tool's travel [m]."""
        return float(np.linalg.norm(self.end - self.start))


def is_idle(push: PushArray) -> bool:
    """Tell whether a push has no length, and so moves nothing."""
    return bool(push[LENGTH] == 0.0)
