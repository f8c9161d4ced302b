"""Where a camera should stand so that the arm does not hide what matters.

The arm is taken as capsules. A place is hidden when the line from the eye to it passes through one.
"""

from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.types import Points

AZIMUTHS: Final = np.radians([0, 12, -12, 24, -24, 75, 90, 105, 60, -45, -60])  # from the default
ELEVATIONS: Final = np.radians([0, 8, -8, 16])
ENOUGH: Final = 0.75  # of the places: a camera that sees more is not better
DETOUR: Final = 0.05  # of the places that a turn of the camera by 1 rad must bring

Eye = Float[ndarray, "3"]
Capsules = Float[ndarray, "F C 2 3"]  # in each of F frames, both ends of C capsules [m]
Places = Float[ndarray, "F P 3"]  # in each of F frames, P places [m]


def candidate_eyes(eye: Eye, focus: Eye) -> Float[ndarray, "E 3"]:
    """Return eyes about a focus as far from it as the given one, which is the first."""
    offset = eye - focus
    distance = np.linalg.norm(offset)
    azimuth, elevation = np.arctan2(offset[1], offset[0]), np.arcsin(offset[2] / distance)
    turns, lifts = np.meshgrid(azimuth + AZIMUTHS, elevation + ELEVATIONS, indexing="ij")
    level = np.cos(lifts)
    way = np.stack([level * np.cos(turns), level * np.sin(turns), np.sin(lifts)], axis=-1)
    return focus + distance * way.reshape(-1, 3)


def rank_eyes(
    eyes: Float[ndarray, "E 3"],
    capsules: Capsules,
    radii: Float[ndarray, "C"],
    groups: list[Places],
) -> Float[ndarray, "E 3"]:
    """Sort eyes, the best first: by the share of a group of places that the worst frame shows.

    A group is what belongs together, such as the top of a disk. Eyes near the first are preferred.
    """
    scores = []
    for eye in eyes:
        shares = [visible(eye, capsules, radii, places).mean(axis=1).min() for places in groups]
        score = min(ENOUGH, *(float(share) for share in shares))
        scores.append(score - DETOUR * _angle(eyes[0], eye))
    return eyes[np.argsort(-np.array(scores), kind="stable")]


def visible(eye: Eye, capsules: Capsules, radii: Float[ndarray, "C"], places: Places) -> np.ndarray:
    """Return which places (F, P) no capsule of their frame hides from the eye."""
    first, second = capsules[:, None, :, 0], capsules[:, None, :, 1]  # (F, 1, C, 3)
    apart = segment_distances(eye, places[:, :, None], first, second)  # (F, P, C)
    return np.asarray((apart > radii).all(axis=-1))


def segment_distances(eye: Eye, end: ndarray, first: ndarray, second: ndarray) -> ndarray:
    """Return distances between segments eye-end and first-second, points (..., 3)."""
    sight, rod, gap = end - eye, second - first, eye - first
    a, e = (sight**2).sum(-1), np.maximum((rod**2).sum(-1), 1e-12)
    b, c, f = (sight * rod).sum(-1), (sight * gap).sum(-1), (rod * gap).sum(-1)
    s = np.clip((b * f - c * e) / np.maximum(a * e - b * b, 1e-12), 0.0, 1.0)
    t = np.clip((b * s + f) / e, 0.0, 1.0)
    s = np.clip((b * t - c) / np.maximum(a, 1e-12), 0.0, 1.0)
    way = gap + s[..., None] * sight - t[..., None] * rod
    return np.asarray(np.linalg.norm(way, axis=-1))


def circle(
    centre: Points, radius: float, height: float, count: int = 12
) -> Float[ndarray, "F P 3"]:
    """Return so many places on level circles about centres (F, 2)."""
    turns = np.arange(count) * 2 * np.pi / count
    flat = centre[:, None] + radius * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    return np.concatenate([flat, np.full((*flat.shape[:2], 1), height)], axis=-1)


def _angle(one: Eye, other: Eye) -> float:
    cosine = one @ other / (np.linalg.norm(one) * np.linalg.norm(other))
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))
