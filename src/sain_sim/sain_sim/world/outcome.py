"""A push in the world: the tool's way, the samples during it, and the outcome."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.types import Mask, Scene
from sain_core.world import Outcome


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
