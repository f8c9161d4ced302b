"""Samples of the world during a push."""

from collections.abc import Callable
from dataclasses import dataclass

from jaxtyping import Float
from numpy import ndarray

from sain_core.types import Scene


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
