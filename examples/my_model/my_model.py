"""A model of pushing in 40 lines: no masses, no friction, no disk that coasts.

The tool carries the mid disk along. Whatever the mid disk then overlaps is moved out of its way.
"""

import numpy as np

from sain_core.push import ANGLE, LENGTH, LOCATION, PushLimits
from sain_core.scene import MID, POSITION, RADIUS, VELOCITY, unit
from sain_core.types import Pushes, Scenes

SWEEPS = 20  # over all disks: one that is moved may move the next


class MyModel:
    """Predicts pushes by geometry alone. A `sain_core.dynamics.Dynamics`."""

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, 3) from scenes (B, N, 8)."""
        predicted = scenes.copy()
        travel = np.maximum(pushes[:, LENGTH] - PushLimits().clearance, 0.0)
        heading = pushes[:, LOCATION] + pushes[:, ANGLE]
        predicted[:, MID, POSITION] += travel[:, None] * unit(heading)
        for _ in range(SWEEPS):
            for disk in range(1, scenes.shape[1]):
                for other in range(disk):
                    _move_apart(predicted, disk, other)
        predicted[..., VELOCITY] = 0.0
        idle = pushes[:, LENGTH] == 0.0
        predicted[idle] = scenes[idle]
        return predicted


def _move_apart(scenes: Scenes, disk: int, other: int) -> None:
    """Move a disk out of another one, in place, along the line between their centres."""
    way = scenes[:, disk, POSITION] - scenes[:, other, POSITION]
    distance = np.maximum(np.linalg.norm(way, axis=-1), 1e-9)
    overlap = np.maximum(scenes[:, disk, RADIUS] + scenes[:, other, RADIUS] - distance, 0.0)
    scenes[:, disk, POSITION] += (overlap / distance)[:, None] * way


def load(name: str) -> MyModel:
    """Return the model; the entry point in ``pyproject.toml`` leads here."""
    return MyModel()
