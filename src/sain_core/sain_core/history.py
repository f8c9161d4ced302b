"""What an episode has shown so far: its pushes, and where they led.

Friction cannot be seen in a scene. A model may infer it from the episode's earlier pushes
(`sain_core.model.Model.condition`); they say nothing of another episode.
"""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.dataset import Column, Transitions
from sain_core.errors import InvalidInputError
from sain_core.push import PUSH_SIZE, STROKE_SIZE, is_stroke
from sain_core.scene import MASS, RADIUS, STATE_SIZE
from sain_core.types import PushArray, Scene

SAME_KIND: Final = 0.05  # share by which one mass or radius may be measured differently


@dataclass(frozen=True, eq=False)
class PushHistory(Transitions):
    """P earlier pushes of one episode, the oldest first.

    Attributes:
        noise: (P, N), standard deviation [m] of each coordinate of the way that a body was seen to
            move; None: the scenes are exact.

    Raises:
        InvalidInputError: arrays that do not fit together, NaN or Inf, a noise that is negative, or
            a mass or radius that is not positive or that a push changed by more than `SAME_KIND`.
    """

    noise: Float[ndarray, "P N"] | None = None

    def __post_init__(self) -> None:
        """Check that the arrays can be what they should be."""
        shape = self.state.shape
        if len(shape) != 3 or shape[1] < 1 or shape[2] != STATE_SIZE:
            raise InvalidInputError(f"past state has shape (P, N, 8) with N >= 1, not {shape}")
        parts: list[tuple[str, tuple[int, ...]]] = [
            (Column.ACTION, (shape[0], STROKE_SIZE if is_stroke(self.action) else PUSH_SIZE)),
            (Column.NEXT_STATE, shape),
        ]
        if self.noise is not None:
            parts.append(("noise", shape[:2]))
        for name, right in parts:
            found = getattr(self, name).shape
            if found != right:
                raise InvalidInputError(f"past {name} has shape {right}, not {found}")
        for key, array in self.arrays.items():
            finite = np.isfinite(array)
            if not finite.all():
                where = [int(index) for index in np.argwhere(~finite)[0]]
                raise InvalidInputError(f"past {key}{where} is NaN or Inf; it must be finite")
        kinds = self.state[..., [MASS, RADIUS]]
        if (kinds <= 0.0).any():
            raise InvalidInputError("past state has a mass or radius that is not positive")
        share = np.abs(self.next_state[..., [MASS, RADIUS]] / kinds - 1.0).max(initial=0.0)
        if share > SAME_KIND:
            raise InvalidInputError(
                f"a past push changed a mass or radius by {100 * share:.1f} %; at most"
                f" {100 * SAME_KIND:g} % may be measured differently"
            )
        if self.noise is not None and (self.noise < 0.0).any():
            raise InvalidInputError(f"past noise is {self.noise.min()} m; it must be 0 or more")

    @classmethod
    def empty(cls, disks: int = 2) -> Self:
        """Return the history of an episode of this many disks that has just begun."""
        states = np.empty((0, disks, STATE_SIZE))
        return cls(states, np.empty((0, PUSH_SIZE)), states)

    def then(
        self,
        scene: Scene,
        push: PushArray,
        next_scene: Scene,
        noise: Float[ndarray, "N"] | None = None,
    ) -> Self:
        """Return the history after one more push, from a scene (N, 8) to the next one.

        A history is of pushes (5,) or of strokes (8,).

        Masses and radii are those of the scene before. `noise` (N,) [m]: see `PushHistory`.

        Raises:
            InvalidInputError: see `PushHistory`, or scenes of another number of disks.
        """
        for name, array in (("scene", scene), ("next scene", next_scene)):
            if array.shape != self.state.shape[1:]:
                right = self.state.shape[1:]
                raise InvalidInputError(f"{name} has shape {array.shape}; its past has {right}")
        both = None
        if noise is not None or self.noise is not None:
            new = np.zeros(self.disks) if noise is None else noise
            both = np.concatenate([self.noise_or_zero, new[None]])
        return type(self)(
            np.concatenate([self.state, scene[None]]),
            np.concatenate([self.action, push[None]]),
            np.concatenate([self.next_state, next_scene[None]]),
            both,
        )

    @property
    def noise_or_zero(self) -> Float[ndarray, "P N"]:
        """The noise; 0 where the scenes are exact."""
        return np.zeros(self.state.shape[:2]) if self.noise is None else self.noise

    def equals(self, other: "PushHistory") -> bool:
        """Return whether another history holds the same pushes, to the bit."""
        mine, others = self.arrays, other.arrays
        same = mine.keys() == others.keys()
        return same and all(np.array_equal(array, others[name]) for name, array in mine.items())

    def latest(self, most: int) -> Self:
        """Return the history of the latest pushes, at most so many."""
        return self.select(slice(max(len(self) - most, 0), None))
