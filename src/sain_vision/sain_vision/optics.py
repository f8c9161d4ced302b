"""A camera over a table: rays of pixels, the places where they meet a level plane, and back.

Pixels are counted from the centre of the upper left one, as OpenCV and ``CameraInfo`` do. The
camera's optical frame has x right, y down and z ahead (REP-103).
"""

from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial.transform import Rotation

from sain_core.errors import InvalidInputError

MODELS: Final = {"plumb_bob": (4, 5), "rational_polynomial": (8, 12, 14)}
"""Models of distortion that are used, with how many numbers each has."""

GRAZING: Final = 0.1  # sine of the smallest angle between a ray and the plane
STEP: Final = 0.5  # [px] over which a derivative is a difference

Pixels = Float[ndarray, "P 2"]
PlanePoints = Float[ndarray, "P 2"]  # [m]
WorldPoints = Float[ndarray, "P 3"]  # [m]
Matrix = Float[ndarray, "3 3"]


@dataclass(frozen=True, eq=False)
class CameraModel:
    """A calibrated camera at a known place.

    Attributes:
        width: of its images [px].
        height: of its images [px].
        matrix: (3, 3) focal lengths and principal point [px].
        distortion: (D,) of the lens, as OpenCV has it; zeros: none.
        rotation: (3, 3) from its optical frame to the world.
        place: (3,) [m] in the world.
    """

    width: int
    height: int
    matrix: Matrix
    distortion: Float[ndarray, "D"]
    rotation: Matrix
    place: Float[ndarray, "3"]

    def rays(self, pixels: Pixels) -> WorldPoints:
        """Return the directions (P, 3) in the world in which pixels (P, 2) look."""
        flat = cv2.undistortPoints(
            np.ascontiguousarray(pixels, dtype=np.float64)[:, None],
            self.matrix,
            self.distortion,
        )[:, 0]
        return np.asarray(np.column_stack([flat, np.ones(len(flat))]) @ self.rotation.T)

    def on_plane(self, pixels: Pixels, height: float) -> PlanePoints:
        """Return where pixels (P, 2) see a level plane at a height [m]; NaN: nowhere."""
        rays = self.rays(pixels)
        steep = rays[:, 2] < -GRAZING * np.linalg.norm(rays, axis=1)
        drop = np.where(steep & (self.place[2] > height), rays[:, 2], np.nan)
        return np.asarray(self.place[:2] + rays[:, :2] * ((height - self.place[2]) / drop)[:, None])

    def spread_on_plane(self, pixels: Pixels, height: float) -> Float[ndarray, "P 2 2"]:
        """Return the derivatives of `on_plane` by the pixels [m/px]."""
        columns = [
            (self.on_plane(pixels + step, height) - self.on_plane(pixels - step, height))
            / (2.0 * STEP)
            for step in STEP * np.eye(2)
        ]
        return np.stack(columns, axis=2)

    def project(self, points: WorldPoints) -> Pixels:
        """Return where places (P, 3) [m] in the world are seen; behind the camera: NaN."""
        local = (points - self.place) @ self.rotation
        ahead = np.where(local[:, 2] > 1e-6, local[:, 2], np.nan)
        seen, _ = cv2.projectPoints(
            np.ascontiguousarray(local / ahead[:, None])[:, None],
            np.zeros(3),
            np.zeros(3),
            self.matrix,
            self.distortion,
        )
        return np.asarray(seen[:, 0])

    def moved(self, rotation: Matrix, place: Float[ndarray, "3"]) -> "CameraModel":
        """Return the same camera at another pose in the world."""
        return replace(self, rotation=rotation, place=place)


def check_calibration(
    width: int, height: int, matrix: Matrix, model: str, distortion: Float[ndarray, "D"]
) -> None:
    """Check what a ``CameraInfo`` states.

    Raises:
        InvalidInputError: naming what is wrong.
    """
    if not (np.isfinite(matrix).all() and np.isfinite(distortion).all()):
        raise InvalidInputError("the camera's calibration has NaN or Inf; all must be finite")
    if matrix[0, 0] <= 0.0 or matrix[1, 1] <= 0.0:
        raise InvalidInputError(
            f"the camera's focal lengths are {matrix[0, 0]:g} and {matrix[1, 1]:g} px; both must"
            " be positive: is the camera calibrated?"
        )
    if not (0.0 <= matrix[0, 2] <= width and 0.0 <= matrix[1, 2] <= height):
        raise InvalidInputError(
            f"the camera's principal point is ({matrix[0, 2]:g}, {matrix[1, 2]:g}) px; it must be"
            f" within its {width} x {height} px"
        )
    if not distortion.any():
        return
    if model not in MODELS:
        raise InvalidInputError(
            f"the camera's distortion model is {model!r}; allowed: {', '.join(MODELS)}"
        )
    if len(distortion) not in MODELS[model]:
        raise InvalidInputError(
            f"the distortion {model} has {len(distortion)} numbers; allowed:"
            f" {', '.join(map(str, MODELS[model]))}"
        )


def turn_of(rotation: Matrix) -> Float[ndarray, "4"]:
    """Return the unit quaternion x y z w of a matrix (3, 3)."""
    return Rotation.from_matrix(rotation).as_quat()


def rotation_of(turn: Float[ndarray, "4"]) -> Matrix:
    """Return the matrix (3, 3) of a unit quaternion x y z w."""
    return Rotation.from_quat(turn).as_matrix()
