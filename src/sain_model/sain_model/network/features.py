"""What the network sees: the scene in the frame of the push: no place and heading is special.

The frame's origin is the mid disk's centre before the push, its x axis points along the push's
``location``: the tool always comes from -x. Scenes that differ by where they are and how they are
turned have the same features, bit for bit up to rounding; renumbering disks renumbers rows.

Lengths are divided by constants, so that the inputs are of order one. E = N (N - 1) relations are
ordered pairs, sorted by the receiving disk.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import ANGLE, LENGTH, LOCATION
from sain_core.scene import MASS, MID, POSITION, RADIUS, THETA, wrap_angle
from sain_core.types import Angles, Pushes, Scenes
from sain_model.network.place_features import place_features
from sain_model.network.settings import DISK_FEATURES, PUSH_FRAME

FEATURE_VERSION: Final = 1  # raise it with every change of meaning, order or scale below
RELATION_FEATURES: Final = 16

GAP_BEFORE: Final = 10  # columns of the relation features: 0 where two disks touch, 1 far apart
GAP_AFTER: Final = 15

PLACE_SCALE: Final = 0.1  # [m]
MOVE_SCALE: Final = 0.05  # [m]
TURN_SCALE: Final = 0.2  # [rad]
GAP_SCALE: Final = 0.02  # [m], beyond which it hardly matters how far apart two disks are
MASS_MIDDLE: Final = 8.0  # [kg]
MASS_SCALE: Final = 1.0  # [kg]
RADIUS_MIDDLE: Final = 0.07  # [m]
RADIUS_SCALE: Final = 0.01  # [m]

Residual = Float[ndarray, "B N 3"]  # dx, dy [m] along the push frame's axes, dtheta [rad]


@dataclass(frozen=True)
class Features:
    """Network inputs of B pushes.

    Attributes:
        disks: what each disk is and how physics moves it.
        relations: how each ordered pair stands, before the push and after it.
    """

    disks: Float[ndarray, "B N D"]
    relations: Float[ndarray, "B E R"]


def make_features(
    scenes: Scenes, pushes: Pushes, physics_next: Scenes, frame: str = PUSH_FRAME
) -> Features:
    """Return the inputs of a network.

    Args:
        scenes: before the pushes.
        pushes: one for each scene.
        physics_next: the prior's prediction.
        frame: one of `FRAMES`; "world" adds the columns of `sain_model.network.place_features`.
    """
    features = _push_features(scenes, pushes, physics_next)
    if frame == PUSH_FRAME:
        return features
    places = place_features(scenes, pushes, physics_next)
    return replace(features, disks=np.concatenate([features.disks, places], axis=-1))


def _push_features(scenes: Scenes, pushes: Pushes, physics_next: Scenes) -> Features:
    frame = pushes[:, LOCATION]
    origin = scenes[:, MID : MID + 1, POSITION]
    before = turn(scenes[..., POSITION] - origin, -frame)  # (B, N, 2)
    after = turn(physics_next[..., POSITION] - origin, -frame)
    kinds = _kinds(scenes)
    return Features(
        _disk_features(scenes, pushes, physics_next, before, after, kinds),
        _relation_features(scenes, before, after, kinds),
    )


def relation_ends(disks: int) -> tuple[ndarray, ndarray]:
    """Return receiver and sender (E,) of every ordered pair, sorted by receiver."""
    receiver, sender = np.nonzero(~np.eye(disks, dtype=bool))
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


def _kinds(scenes: Scenes) -> Float[ndarray, "B N 3"]:
    """Return what does not move: whether it is the mid disk, mass and radius."""
    kinds = np.zeros((*scenes.shape[:2], 3))
    kinds[:, MID, 0] = 1.0
    kinds[..., 1] = (scenes[..., MASS] - MASS_MIDDLE) / MASS_SCALE
    kinds[..., 2] = (scenes[..., RADIUS] - RADIUS_MIDDLE) / RADIUS_SCALE
    return kinds


def _disk_features(
    scenes: Scenes,
    pushes: Pushes,
    physics_next: Scenes,
    before: Float[ndarray, "B N 2"],
    after: Float[ndarray, "B N 2"],
    kinds: Float[ndarray, "B N 3"],
) -> Float[ndarray, "B N D"]:
    features = np.empty((*scenes.shape[:2], DISK_FEATURES))
    features[..., :3] = kinds
    features[..., 3:5] = before / PLACE_SCALE
    # A disk on three feet looks the same after a third of a turn.
    feet = 3 * (scenes[..., THETA] - pushes[:, LOCATION, None])
    features[..., 5], features[..., 6] = np.cos(feet), np.sin(feet)
    moved = after - before
    features[..., 7:9] = moved / MOVE_SCALE
    features[..., 9] = np.linalg.norm(moved, axis=-1) / MOVE_SCALE
    features[..., 10] = wrap_angle(physics_next[..., THETA] - scenes[..., THETA]) / TURN_SCALE
    features[..., 11] = pushes[:, LENGTH, None] / PLACE_SCALE
    features[..., 12] = np.cos(pushes[:, ANGLE, None])
    features[..., 13] = np.sin(pushes[:, ANGLE, None])
    features[..., 14] = features[..., 11] * features[..., 13]  # how far the tool slides across
    return features


def _relation_features(
    scenes: Scenes,
    before: Float[ndarray, "B N 2"],
    after: Float[ndarray, "B N 2"],
    kinds: Float[ndarray, "B N 3"],
) -> Float[ndarray, "B E R"]:
    receiver, sender = relation_ends(scenes.shape[1])
    rims = scenes[:, receiver, RADIUS] + scenes[:, sender, RADIUS]
    features = np.empty((len(scenes), len(receiver), RELATION_FEATURES))
    features[..., 0:3] = kinds[:, receiver]
    features[..., 3:6] = kinds[:, sender]
    for first, places in ((GAP_BEFORE - 4, before), (GAP_AFTER - 4, after)):
        offset = places[:, sender] - places[:, receiver]
        distance = np.linalg.norm(offset, axis=-1)
        features[..., first : first + 2] = offset / PLACE_SCALE
        features[..., first + 2 : first + 4] = offset / (distance[..., None] + 1e-9)
        features[..., first + 4] = np.tanh((distance - rims) / GAP_SCALE)
    return features
