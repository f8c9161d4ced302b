"""Where bodies are, and how sure that is: frames at rest, and what a push should have led to."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, sqrt
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import option
from sain_core.observation import ObservationConfig
from sain_core.scene import (
    MASS,
    POSE,
    POSITION,
    RADIUS,
    SETTLED_SPEED,
    SETTLED_SPIN,
    SWEEPS,
    THETA,
    VELOCITY,
    surface_gaps,
    wrap_angle,
)
from sain_core.types import Mask, Scalars, Scene, Scenes

FEWEST_FRAMES: Final = 4  # of noisy ones: fewer show no motion
OUTLIER: Final = 3.7  # standard deviations: a prediction that is further off does not count
TOUCHING: Final = 1e-9  # [m], overlaps up to this are none
MOTION: Final = 4.5  # standard deviations of a slope: more is motion


@dataclass(frozen=True)
class EstimatorConfig(ObservationConfig):
    """How bodies are observed, as far as the planner is told, and what it makes of it.

    With exact and immediate observations each settled scene is taken as it is.
    """

    precision: float = option(
        0.001,
        "standard deviation of positions down to which frames at rest are averaged",
        unit="m",
        minimum=1e-4,
        maximum=0.02,
    )
    turn_precision: float = option(
        0.01, "the same for headings", unit="rad", minimum=1e-3, maximum=0.35
    )
    most_frames: int = option(90, "frames that are waited for at most", minimum=FEWEST_FRAMES)
    confidence: float = option(
        0.95, "least probability with which a goal counts as reached", minimum=0.5, maximum=0.999
    )

    @property
    def frames(self) -> int:
        """The number of frames at rest that an estimate is made of."""
        place, turn = self.noise_std
        if not (place or turn):
            return 1
        wanted = ceil(max(place / self.precision, turn / self.turn_precision) ** 2 - 1e-9)
        return min(max(wanted, FEWEST_FRAMES), self.most_frames)


@dataclass(frozen=True, eq=False)
class Estimate:
    """Poses of bodies at rest, with their standard deviations, without what is always the same.

    Attributes:
        scene: (N, 8).
        places: (N,) [m], of each coordinate.
        turns: (N,) [rad].
    """

    scene: Scene
    places: Scalars
    turns: Scalars


def in_motion(scenes: Scenes, times: Float[ndarray, "B"], noise: tuple[float, float]) -> bool:
    """Tell whether frames (B, N, 8) of such noise show motion beyond that, and beyond rest."""
    offset = times - times.mean()
    weight = float((offset**2).sum())
    if len(times) < FEWEST_FRAMES or weight == 0.0:
        return False
    poses = _unwrapped(scenes)
    speeds = np.abs(np.tensordot(offset, poses, axes=1)) / weight  # (N, 3)
    slow = np.array([SETTLED_SPEED, SETTLED_SPEED, SETTLED_SPIN])
    scatter = np.array([noise[0], noise[0], noise[1]]) / sqrt(weight)
    return bool((speeds > slow + MOTION * scatter).any())


def _unwrapped(scenes: Scenes) -> Float[ndarray, "B N 3"]:
    """Return poses with headings that do not jump."""
    poses = scenes[..., POSE].copy()
    first = poses[0, :, THETA]
    poses[..., THETA] = first + wrap_angle(poses[..., THETA] - first)
    return poses


def fuse(
    frames: Sequence[Scene], noise: tuple[float, float], expected: Estimate | None = None
) -> Estimate:
    """Return where frames (N, 8) of bodies at rest, and what was expected, place the bodies.

    What is expected of a body counts by its inverse variance, unless it is an outlier.
    """
    scenes = np.stack(frames)
    scene, count = scenes[0].copy(), len(frames)
    scene[:, POSE] = _unwrapped(scenes).mean(axis=0) if count > 1 else scenes[0, :, POSE]
    scene[:, MASS:] = scenes[..., MASS:].mean(axis=0)
    scene[:, VELOCITY] = 0.0
    places, turns = (np.full(len(scene), std / sqrt(count)) for std in noise)
    if expected is not None:
        off = expected.scene[:, POSE] - scene[:, POSE]
        off[:, THETA] = wrap_angle(off[:, THETA])
        far = np.linalg.norm(off[:, POSITION], axis=1) > OUTLIER * np.hypot(places, expected.places)
        share, places = _weights(places, expected.places, far)
        scene[:, POSITION] += share[:, None] * off[:, POSITION]
        far |= np.abs(off[:, THETA]) > OUTLIER * np.hypot(turns, expected.turns)
        share, turns = _weights(turns, expected.turns, far)
        scene[:, THETA] += share * off[:, THETA]
    scene[:, THETA] = wrap_angle(scene[:, THETA])
    return Estimate(scene, places, turns)


def _weights(seen: Scalars, expected: Scalars, outlier: Mask) -> tuple[Scalars, Scalars]:
    """Return the share (N,) by which what is expected counts, and the std (N,) of the mean."""
    total = seen**2 + expected**2
    share = np.where(outlier | (total == 0.0), 0.0, seen**2 / np.maximum(total, 1e-30))
    return share, seen * np.sqrt(1.0 - share)


def part_disks(scene: Scene) -> Scene:
    """Return a scene (N, 8) with disks that overlap just touching; each moves by half."""
    parted = scene.copy()
    for _ in range(SWEEPS):
        gaps = surface_gaps(parted)
        if gaps.min(initial=0.0) >= -TOUCHING:
            break
        first, second = np.unravel_index(np.argmin(gaps), gaps.shape)
        way = parted[second, POSITION] - parted[first, POSITION]
        apart = float(np.hypot(*way))
        wanted = float(parted[[first, second], RADIUS].sum())
        half = 0.5 * (wanted - apart) * (way / apart if apart > 0.0 else np.array([1.0, 0.0]))
        parted[first, POSITION] -= half
        parted[second, POSITION] += half
    return parted
