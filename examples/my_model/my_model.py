"""A model of pushing: the tool carries the mid disk, which moves the target out of its way."""

import numpy as np

from sain_core.model import Model
from sain_core.push import ANGLE, LENGTH, LOCATION, PushLimits
from sain_core.scene import MID, POSITION, RADIUS, TARGET, VELOCITY, unit


class MyModel(Model):
    """Predicts pushes of two disks by geometry alone."""

    def step(self, scenes: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """Predict the settled scenes (B, N, 8) after pushes (B, 5) from scenes (B, N, 8)."""
        after, pushed = scenes.copy(), pushes[:, LENGTH] > PushLimits().clearance
        way = (pushes[:, LENGTH] - PushLimits().clearance)[:, None]
        after[:, MID, POSITION] += way * unit(pushes[:, LOCATION] + pushes[:, ANGLE])
        apart = after[:, TARGET, POSITION] - after[:, MID, POSITION]
        distance = np.maximum(np.linalg.norm(apart, axis=1), 1e-9)
        overlap = np.maximum(after[:, [MID, TARGET], RADIUS].sum(axis=1) - distance, 0.0)
        after[:, TARGET, POSITION] += (overlap / distance)[:, None] * apart
        after[..., VELOCITY] = 0.0
        return np.where(pushed[:, None, None], after, scenes)


def load(name: str) -> MyModel:
    """Return the model; the entry point in ``pyproject.toml`` leads here."""
    return MyModel()
