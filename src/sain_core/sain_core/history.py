"""What an episode has shown so far: its pushes, and where they led.

Friction cannot be seen in a scene. A dynamics that can learn it from the pushes before has
``with_history``; what an episode showed says nothing of another one.
"""

from dataclasses import dataclass
from typing import Protocol, Self, runtime_checkable

import numpy as np
from numpy import ndarray

from sain_core.dynamics import Dynamics, RolloutModel, StepwiseRollout
from sain_core.errors import InvalidInputError
from sain_core.push import PUSH_SIZE
from sain_core.scene import MASS, RADIUS, STATE_SIZE
from sain_core.types import PushArray, Scene


@dataclass(frozen=True, eq=False)
class PushHistory:
    """P earlier pushes of one episode, the oldest first.

    Attributes:
        scenes: (P, N, 8), settled, before each push.
        pushes: (P, 3), as they were executed.
        next_scenes: (P, N, 8), settled, after each push.

    Raises:
        InvalidInputError: arrays that do not fit together, NaN or Inf, or a mass or radius that
            is not positive or that a push changed.
    """

    scenes: ndarray  # whatever comes from outside: its shape is checked here
    pushes: ndarray
    next_scenes: ndarray

    def __post_init__(self) -> None:
        """Check that the arrays can be what they should be."""
        shape = self.scenes.shape
        if len(shape) != 3 or shape[1] < 2 or shape[2] != STATE_SIZE:
            raise InvalidInputError(f"past scenes have shape (P, N, 8) with N >= 2, not {shape}")
        for name, right in (("pushes", (shape[0], PUSH_SIZE)), ("next_scenes", shape)):
            found = getattr(self, name).shape
            if found != right:
                raise InvalidInputError(f"past {name} have shape {right}, not {found}")
        for name in ("scenes", "pushes", "next_scenes"):
            finite = np.isfinite(getattr(self, name))
            if not finite.all():
                where = [int(index) for index in np.argwhere(~finite)[0]]
                raise InvalidInputError(f"past {name}{where} is NaN or Inf; it must be finite")
        kinds = self.scenes[..., [MASS, RADIUS]]
        if (kinds <= 0.0).any():
            raise InvalidInputError("past scenes have a mass or radius that is not positive")
        if (kinds != self.next_scenes[..., [MASS, RADIUS]]).any():
            raise InvalidInputError("a past push changed a mass or radius; it cannot")

    @classmethod
    def empty(cls, disks: int = 2) -> Self:
        """Return the history of an episode of this many disks that has just begun."""
        scenes = np.empty((0, disks, STATE_SIZE))
        return cls(scenes, np.empty((0, PUSH_SIZE)), scenes)

    def __len__(self) -> int:
        """Return the number of pushes P."""
        return len(self.pushes)

    @property
    def disks(self) -> int:
        """The number of disks N."""
        return int(self.scenes.shape[1])

    def then(self, scene: Scene, push: PushArray, next_scene: Scene) -> Self:
        """Return the history after one more push (3,), from a scene (N, 8) to the next one.

        Raises:
            InvalidInputError: see `PushHistory`, or scenes of another number of disks.
        """
        for name, array in (("scene", scene), ("next scene", next_scene)):
            if array.shape != self.scenes.shape[1:]:
                right = self.scenes.shape[1:]
                raise InvalidInputError(f"{name} has shape {array.shape}; its past has {right}")
        return type(self)(
            np.concatenate([self.scenes, scene[None]]),
            np.concatenate([self.pushes, push[None]]),
            np.concatenate([self.next_scenes, next_scene[None]]),
        )

    def equals(self, other: "PushHistory") -> bool:
        """Tell whether another history tells of the same pushes, to the bit."""
        return (
            np.array_equal(self.scenes, other.scenes)
            and np.array_equal(self.pushes, other.pushes)
            and np.array_equal(self.next_scenes, other.next_scenes)
        )

    def latest(self, most: int) -> Self:
        """Return the history of the latest pushes, at most so many."""
        first = max(len(self) - most, 0)
        return type(self)(self.scenes[first:], self.pushes[first:], self.next_scenes[first:])


@runtime_checkable
class LearningDynamics(Protocol):
    """A `Dynamics` that can learn from an episode's earlier pushes. Pure: `self` stays as it is."""

    def with_history(self, history: PushHistory) -> Dynamics:
        """Return the dynamics that these pushes speak for; without pushes the usual one."""
        ...


def informed(dynamics: Dynamics, history: PushHistory) -> Dynamics:
    """Return what a dynamics becomes by these pushes: itself, if it cannot learn from them."""
    return dynamics.with_history(history) if isinstance(dynamics, LearningDynamics) else dynamics


@runtime_checkable
class LearningRollout(Protocol):
    """A `RolloutModel` that can learn from an episode's earlier pushes."""

    def with_history(self, history: PushHistory) -> RolloutModel:
        """Return the model that these pushes speak for; without pushes the usual one."""
        ...


def informed_rollout(model: RolloutModel, history: PushHistory) -> RolloutModel:
    """Return what a rollout model becomes by these pushes: itself, if it cannot learn."""
    if isinstance(model, StepwiseRollout):
        return StepwiseRollout(informed(model.dynamics, history))
    return model.with_history(history) if isinstance(model, LearningRollout) else model
