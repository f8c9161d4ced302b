"""A cost: bodies stay near the middle of the table."""

import numpy as np

from sain_core.scene import POSITION
from sain_core.types import Scalars
from sain_mppi.objective.cost import Objective, Rollout

MIDDLE = np.array([0.5, 0.0])  # [m]


def off_centre(rollout: Rollout, objective: Objective) -> Scalars:
    """Return the largest distance (K,) [m] of a body from the middle after the last push."""
    away = rollout.after[:, -1, :, POSITION] - MIDDLE  # (K, N, 2)
    return np.linalg.norm(away, axis=-1).max(axis=-1)
