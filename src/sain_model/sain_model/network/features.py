"""Features and residuals of batches of pushes, with NumPy: what a network is trained on.

`network.feature_kernels` says what the features are.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor

from sain_core.push import LOCATION
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.types import Angles, Pushes, Scenes
from sain_model.compute.devices import CPU
from sain_model.network.feature_kernels import (
    ALL_LANES,
    DISK_FEATURES,
    PLACE_FEATURES,
    RELATION_FEATURES,
    NetworkWork,
    write_features,
)
from sain_model.network.settings import ANY_SHAPE, PUSH_FRAME, WORLD_FRAME, NetworkConfig
from sain_model.network.shape_feature_kernels import SHAPE_BODY_FEATURES
from sain_model.network.shape_relation_kernels import SHAPE_RELATION_FEATURES

Residual = Float[ndarray, "B N 3"]  # dx, dy [m] along the push frame's axes, dtheta [rad]


@dataclass(frozen=True)
class Features:
    """Network inputs of B pushes."""

    disks: Float[ndarray, "B N D"]  # what each disk is and how physics moves it
    relations: Float[ndarray, "B E R"]  # how each ordered pair stands, before the push and after

    def tensors(self, device: str = CPU) -> tuple[Float[Tensor, "B N D"], Float[Tensor, "B E R"]]:
        """Return them as PyTorch's networks take them."""
        disks, relations = (
            torch.from_numpy(array.astype(np.float32)).to(device)
            for array in (self.disks, self.relations)
        )
        return disks, relations


def count_features(config: NetworkConfig) -> tuple[int, int]:
    """Return how many features each body and each relation has."""
    places = PLACE_FEATURES if config.features == WORLD_FRAME else 0
    if config.bodies == ANY_SHAPE:
        return SHAPE_BODY_FEATURES + places, SHAPE_RELATION_FEATURES
    return DISK_FEATURES + places, RELATION_FEATURES


def make_features(
    scenes: Scenes, pushes: Pushes, physics_next: Scenes, frame: str = PUSH_FRAME
) -> Features:
    """Return the inputs of a network; the frame "world" adds places and headings."""
    batch, disks, _ = scenes.shape
    unused = np.empty(0)
    of_disk, of_relation = count_features(NetworkConfig(features=frame))
    work = NetworkWork(
        np.empty((disks, 4, batch)),
        np.empty((disks, batch)),
        np.empty((disks, of_disk, batch)),
        np.empty((disks * (disks - 1), of_relation, batch)),
        unused,
        unused,
    )
    columns = [np.ascontiguousarray(np.moveaxis(a, 0, -1)) for a in (scenes, pushes, physics_next)]
    write_features(*columns, ALL_LANES, frame == WORLD_FRAME, work)
    rows = (np.ascontiguousarray(np.moveaxis(a, -1, 0)) for a in (work.disks, work.relations))
    return Features(*rows)


def relation_ends(disks: int, with_tool: bool = False) -> tuple[ndarray, ndarray]:
    """Return receiver and sender (E,) of every ordered pair, sorted by receiver.

    With the tool, a pair of a body and itself stands for it and the tool.
    """
    pairs = np.ones((disks, disks), dtype=bool)
    if not with_tool:
        np.fill_diagonal(pairs, False)
    receiver, sender = np.nonzero(pairs)
    return receiver, sender


def apply_residual(physics_next: Scenes, pushes: Pushes, residual: Residual) -> Scenes:
    """Return the prior's prediction corrected by residuals that are given in the push frame."""
    corrected = physics_next.copy()
    corrected[..., POSITION] += turn(residual[..., :2], pushes[:, LOCATION])
    corrected[..., THETA] = wrap_angle(physics_next[..., THETA] + residual[..., 2])
    return corrected


def true_residual(next_scenes: Scenes, pushes: Pushes, physics_next: Scenes) -> Residual:
    """Return the residual that makes the prediction right: the inverse of `apply_residual`."""
    missing = next_scenes[..., POSITION] - physics_next[..., POSITION]
    turned = wrap_angle(next_scenes[..., THETA] - physics_next[..., THETA])
    return np.concatenate([turn(missing, -pushes[:, LOCATION]), turned[..., None]], axis=-1)


def turn(vectors: Float[ndarray, "B N 2"], angle: Angles) -> Float[ndarray, "B N 2"]:
    """Return vectors turned by an angle (B,) [rad] each."""
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
