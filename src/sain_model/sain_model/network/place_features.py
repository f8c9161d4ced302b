"""What tells places, headings and single disks apart, for a network that learns one laboratory.

The features of `network.features` are the same wherever a scene is and however it is turned,
so no network can learn from them what a tilted or patchy table does, nor where in a disk its
mass is. These ten do tell; what is learned with them holds for one table and one pair of disks.
"""

from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LOCATION
from sain_core.scene import POSITION, THETA
from sain_core.types import Pushes, Scenes
from sain_model.network.settings import PLACE_FEATURES

TABLE_MIDDLE: Final = np.array([0.5, 0.0])  # [m]
TABLE_SCALE: Final = 0.2  # [m]


def place_features(scenes: Scenes, pushes: Pushes, physics_next: Scenes) -> Float[ndarray, "B N P"]:
    """Return the features for pushes (B, 3) from scenes (B, N, 8), given the prior's prediction."""
    features = np.empty((*scenes.shape[:2], PLACE_FEATURES))
    features[..., 0:2] = (scenes[..., POSITION] - TABLE_MIDDLE) / TABLE_SCALE
    features[..., 2:4] = (physics_next[..., POSITION] - TABLE_MIDDLE) / TABLE_SCALE
    heading = pushes[:, LOCATION, None]
    for column, angle in (
        (4, heading),  # downhill is somewhere
        (6, 2 * heading),  # grain is the same there and back
        (8, scenes[..., THETA] - heading),  # a disk's mass lies to one side
    ):
        features[..., column], features[..., column + 1] = np.cos(angle), np.sin(angle)
    return features
