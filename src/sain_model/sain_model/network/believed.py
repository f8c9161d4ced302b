"""What is believed of the physics, as inputs of a network that sees it.

A body's centre of mass, the grain of friction and the offset of the tool are seen in the frame of
the push, as all else is (`network.feature_kernels`): so they turn with the scene, and in a mirror
those across the push change their sign.
"""

from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LOCATION
from sain_core.scene import THETA
from sain_core.types import Scalars, Scenes
from sain_model.network.settings import NetworkConfig
from sain_model.physics.parameters import BY_NAME, Values

FACTORS: Final = {"tool_friction": 0.2, "torsion": 1.0}  # by name, where their logarithm is 0
LEAST: Final = 0.05  # share of that: a friction may be 0, and has no logarithm there
NUMBERS: Final = ("pressure",)
OF_BODY, OF_TABLE = 1.0, 0.0  # what turns with the body, and what with the world
VECTORS: Final = (  # x and y, in whose frame, and how often they turn when the frame turns once
    ("centre_x", "centre_y", OF_BODY, 1.0),
    ("grain_x", "grain_y", OF_BODY, 2.0),
    ("table_grain_x", "table_grain_y", OF_TABLE, 2.0),
    ("tip_x", "tip_y", OF_TABLE, 1.0),
)
SCALES: Final = {"pressure": 1.0}  # by name; else the spread of the parameter
BELIEVED_FEATURES: Final = len(FACTORS) + len(NUMBERS) + 2 * len(VECTORS)
MIRRORED_BELIEVED: Final = tuple(  # columns that change their sign in a mirror
    len(FACTORS) + len(NUMBERS) + 2 * number + 1 for number in range(len(VECTORS))
)


def believed_features(scenes: Scenes, headings: Scalars, values: Values) -> Float[ndarray, "B N P"]:
    """Return what is believed of each body's physics, scaled to be of order one.

    Args:
        scenes: (B, N, 8).
        headings: of the frames of the pushes, (B,) [rad].
        values: of parameters by name, (B,) or (B, N); those that are missing are 0 here.
    """
    columns = [
        np.log(_value(scenes, values, name, middle) / middle) / _scale(name)
        for name, middle in FACTORS.items()
    ]
    columns += [_value(scenes, values, name, 0.0) / _scale(name) for name in NUMBERS]
    for name_x, name_y, of_body, times in VECTORS:
        x, y = (_value(scenes, values, name, 0.0) / _scale(name) for name in (name_x, name_y))
        angle = times * (of_body * scenes[..., THETA] - headings[:, None])
        cos, sin = np.cos(angle), np.sin(angle)
        columns += [cos * x - sin * y, sin * x + cos * y]
    return np.stack(columns, axis=-1)


def network_beliefs(
    config: NetworkConfig, scenes: Scenes, frames: Float[ndarray, "B S"], values: Values
) -> Float[ndarray, "B N P"]:
    """Return what a network sees of what is believed: nothing, unless it was made to see it.

    `frames` are those of the pushes, as `network.features.push_frames` makes them.
    """
    if not config.believed:
        return np.empty((*scenes.shape[:2], 0))
    return believed_features(scenes, frames[:, LOCATION], values)


def _value(scenes: Scenes, values: Values, name: str, default: float) -> Float[ndarray, "B N"]:
    value = values.get(name, np.asarray(default))
    value = np.broadcast_to(value[:, None] if value.ndim == 1 else value, scenes.shape[:2])
    return np.maximum(value, LEAST * default) if name in FACTORS else value


def _scale(name: str) -> float:
    return SCALES.get(name, BY_NAME[name].spread)
