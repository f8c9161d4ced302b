"""Walls for models that have none: what is predicted to end beyond one ends at it."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from sain_core.model import Model
from sain_core.scene import POSITION, RADIUS, THETA
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scenes
from sain_pusht.agent import WALLS


@dataclass(frozen=True, eq=False)
class InsideWalls(Model):
    """A `Model` of one block in a square room.

    The block is moved straight back out of a wall. How the wall turns it is left out.
    """

    dynamics: Model
    bodies: Bodies

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the dynamics for this block."""
        return type(self)(self.dynamics.with_bodies(bodies), bodies)

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict the scenes (B, 1, 8) after pushes (B, 5)."""
        after = self.dynamics.step(scenes, pushes)
        corners = self.bodies.shapes[0].outline(1.0)  # (M, 2)
        cos, sin = np.cos(after[:, 0, THETA]), np.sin(after[:, 0, THETA])
        turns = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], 1)  # (B, 2, 2)
        offsets = after[:, :1, RADIUS, None] * np.einsum("bij,mj->bmi", turns, corners)
        places = after[:, :1, POSITION] + offsets  # (B, M, 2)
        low, high = WALLS
        back = np.maximum(low - places.min(axis=1), 0.0)
        back -= np.maximum(places.max(axis=1) - high, 0.0)
        after[:, 0, POSITION] += back
        return after
