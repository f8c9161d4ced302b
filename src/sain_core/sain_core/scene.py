"""A scene is N bodies on the table, N >= 1, each with a state of 8 numbers.

``x y theta vx vy omega mass radius`` [m, m, rad, m/s, m/s, rad/s, kg, m], in the frame
``world``: origin below the arm's base, x forward, y left, z up, table at z = 0. Shapes and roles
are separate (`sain_core.shapes.bodies`). Without them, all bodies are disks as in the paper: disk 0
is the mid disk, the only one that the tool may touch; disk 1 is the target; the others are in the
way. The paper's s in R^16 (section II-B c) is N = 2, flattened.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.errors import InvalidInputError, OffTableError
from sain_core.types import Angles, Mask, Points, Scalars, Scene, Scenes

X, Y, THETA, VX, VY, OMEGA, MASS, RADIUS = range(8)
POSITION: Final = slice(X, Y + 1)
POSE: Final = slice(X, THETA + 1)
VELOCITY: Final = slice(VX, OMEGA + 1)
STATE_SIZE: Final = 8
STATE_NAMES: Final = ("x", "y", "theta", "vx", "vy", "omega", "mass", "radius")

MID: Final = 0
TARGET: Final = 1

DISK_HEIGHT: Final = 0.04  # [m], of every body
NOMINAL_MASS: Final = 8.0  # [kg], the paper, section III-A
SETTLED_SPEED: Final = 1e-3  # [m/s]
SETTLED_SPIN: Final = 1e-2  # [rad/s]
SWEEPS: Final = 100  # over all pairs of disks that are to be parted
OVERLAP_TOLERANCE: Final = 1e-3  # [m], touching disks may be measured as slightly overlapping


@dataclass(frozen=True)
class Table(Config):
    """The table top: an upright rectangle at z = 0. A disk is on it when its centre is."""

    x_min: float = option(0.16, "near edge", unit="m")
    x_max: float = option(1.16, "far edge", unit="m")
    y_min: float = option(-0.60, "right edge", unit="m")
    y_max: float = option(0.60, "left edge", unit="m")
    height: float = option(0.20, "height above the arm's base", unit="m", minimum=0.0, maximum=0.4)

    def contains(self, points: Points) -> Mask:
        """Tell which points (..., 2) lie on the table."""
        x, y = points[..., 0], points[..., 1]
        return np.asarray(
            (x >= self.x_min) & (x <= self.x_max) & (y >= self.y_min) & (y <= self.y_max)
        )

    def describe(self) -> str:
        """Return the table's extent in words, for error messages."""
        return f"x in [{self.x_min}, {self.x_max}] m, y in [{self.y_min}, {self.y_max}] m"


def wrap_angle(angle: Angles) -> Angles:
    """Wrap angles [rad] to (-pi, pi]."""
    return np.asarray(np.pi - np.mod(np.pi - angle, 2 * np.pi))


def make_scene(
    positions: Points, masses: Scalars, radii: Scalars, headings: Angles | None = None
) -> Scene:
    """Build a scene (N, 8) at rest from positions (N, 2), masses (N,) and radii (N,)."""
    scene = np.zeros((len(positions), STATE_SIZE))
    scene[:, POSITION] = positions
    scene[:, MASS] = masses
    scene[:, RADIUS] = radii
    if headings is not None:
        scene[:, THETA] = wrap_angle(headings)
    return scene


def check_finite(values: Float[ndarray, "*B C"], names: Sequence[str], of: str) -> None:
    """Raise `InvalidInputError` for the first number, of a column with a name, that is not finite.

    `of` may have a place for the number of the row, as ``before: {name} of disk {row}``.
    """
    if not np.isfinite(values).all():
        *rows, column = np.argwhere(~np.isfinite(values))[0].tolist()
        what = of.format(name=names[column], row=rows[0] if rows else 0)
        raise InvalidInputError(f"{what} is {values[(*rows, column)]}; must be finite")


def check_states(scene: Scene, table: Table | None = None) -> None:
    """Check an array that should be a scene (N, 8), but for overlaps.

    Raises `InvalidInputError`, and `OffTableError` where a table is given.
    """
    if scene.ndim != 2 or scene.shape[1] != STATE_SIZE or scene.shape[0] < 1:
        raise InvalidInputError(f"a scene has shape (N, 8) with N >= 1, not {scene.shape}")
    check_finite(scene, STATE_NAMES, "{name} of disk {row}")
    for column in (MASS, RADIUS):
        if (scene[:, column] <= 0).any():
            disk = int(np.argmin(scene[:, column]))
            value = scene[disk, column]
            raise InvalidInputError(
                f"{STATE_NAMES[column]} of disk {disk} is {value}; it must be positive"
            )
    if table is not None:
        check_on_table(scene, table)


def move_apart(scene: Scene) -> Scene:
    """Return the scene (N, 8) with overlapping disks just touching; the mid disk stays put.

    Of two that overlap the one with the higher index moves, along the line of centres. Where no
    way was found to part them all, what was found is returned.
    """
    apart = scene.copy()
    for _ in range(SWEEPS):
        if surface_gaps(apart).min() >= 0.0:
            break
        for far in range(1, len(apart)):
            for near in range(far):
                _part(apart, near, far)
    return apart


def _part(scene: Scene, near: int, far: int) -> None:
    """Move disk far of a scene away from disk near, in place, when they overlap."""
    way = scene[far, POSITION] - scene[near, POSITION]
    distance = float(np.hypot(*way))
    wanted = scene[near, RADIUS] + scene[far, RADIUS]
    if distance < wanted:
        direction = way / distance if distance > 0.0 else np.array([1.0, 0.0])
        scene[far, POSITION] = scene[near, POSITION] + (wanted + 1e-9) * direction


def check_on_table(scene: Scene, table: Table) -> None:
    """Raise `OffTableError` when a disk's centre is not on the table."""
    off = ~table.contains(scene[:, POSITION])
    if off.any():
        disk = int(np.argmax(off))
        x, y = scene[disk, POSITION]
        raise OffTableError(
            f"disk {disk} at ({x:.3f}, {y:.3f}) m is off the table; it covers {table.describe()}"
        )


def surface_gaps(scenes: Scenes) -> np.ndarray:
    """Return the gaps between disk surfaces [m], (..., N, N), infinite on the diagonal."""
    positions = scenes[..., POSITION]
    apart = np.linalg.norm(positions[..., :, None, :] - positions[..., None, :, :], axis=-1)
    radii = scenes[..., RADIUS]
    gaps = apart - radii[..., :, None] - radii[..., None, :]
    gaps[..., range(scenes.shape[-2]), range(scenes.shape[-2])] = np.inf
    return gaps


def is_settled(scenes: Scenes) -> Mask:
    """Tell which scenes (..., N, 8) have every disk slower than 1 mm/s and 10 mrad/s."""
    slow = np.hypot(scenes[..., VX], scenes[..., VY]) < SETTLED_SPEED
    still = np.abs(scenes[..., OMEGA]) < SETTLED_SPIN
    return np.asarray((slow & still).all(axis=-1))


def unit(angle: Angles) -> Points:
    """Return unit vectors (..., 2) that point along angles [rad]."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def turned(vectors: Float[ndarray, "*#B 2"], angles: Float[ndarray, "*#B"] | float) -> Points:
    """Return vectors (..., 2) turned by angles (...) [rad], which may be broadcast."""
    cos, sin = np.cos(angles), np.sin(angles)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def mirror_scenes(scenes: Scenes) -> Scenes:
    """Reflect scenes in the x axis."""
    mirrored = scenes.copy()
    for column in (Y, VY, OMEGA):
        mirrored[..., column] = -scenes[..., column]
    mirrored[..., THETA] = wrap_angle(-scenes[..., THETA])
    return mirrored
