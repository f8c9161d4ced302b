"""A push in the world: the tool's way, the samples during it, and the outcome."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LENGTH, PushLimits, strokes
from sain_core.scene import unit
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Mask, PushArray, Scene
from sain_core.world import Outcome


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
        """Return the tool's way for a push (3,) or (4,) in a scene (N, 8), of disks by default."""
        start, heading = strokes(scene, push, limits, bodies)
        return cls(start, start + push[LENGTH] * unit(heading), float(heading))

    def from_further_back(self, way: float) -> "Stroke":
        """Return this stroke with a start that lies further back by a way [m]."""
        return replace(self, start=self.start - way * unit(np.asarray(self.heading)))

    @property
    def length(self) -> float:
        """The tool's travel [m]."""
        return float(np.linalg.norm(self.end - self.start))


@dataclass(frozen=True)
class Sample:
    """The world at one control step.

    Attributes:
        time: simulated time [s]; it never goes back, not even at a reset.
        joint_positions: (7,) [rad].
        joint_velocities: (7,) [rad/s].
        tool: the place of the tip, (3,) [m].
        commanded_tool: the commanded place of the tip, (3,) [m].
        scene: the disks, (N, 8).
        phase: "approach", "push", "settle", "lift" or "rest".
    """

    time: float
    joint_positions: Float[ndarray, "7"]
    joint_velocities: Float[ndarray, "7"]
    tool: Float[ndarray, "3"]
    commanded_tool: Float[ndarray, "3"]
    scene: Scene
    phase: str


Observer = Callable[[Sample], None]


@dataclass(frozen=True)
class StrokeOutcome(Outcome):
    """An executed push, with what only simulated worlds know of it.

    Attributes:
        duration: simulated time [s].
        settled: False when the disks still moved after the longest wait.
        fallen: (N,) which disks are no longer on the table.
    """

    duration: float
    settled: bool
    fallen: Mask

    @property
    def off_table(self) -> bool:
        """Whether any disk fell off the table."""
        return bool(np.any(self.fallen))


def is_idle(push: PushArray) -> bool:
    """Tell whether a push has no length, and so moves nothing."""
    return bool(push[LENGTH] == 0.0)
