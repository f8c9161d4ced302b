"""A camera over a table: rays of pixels, the places where they meet a level plane, and back.

Pixels are counted from the centre of the upper left one, as OpenCV and ``CameraInfo`` do. The
camera's optical frame has x right, y down and z ahead (REP-103).
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial.transform import Rotation

from sain_core.errors import InvalidInputError
from sain_core.guarding.plugins import did_you_mean
from sain_core.scene import Table

LENSES: Final = {"plumb_bob": (5, 4), "rational_polynomial": (8,), "equidistant": (4,)}
"""Models of distortion, as ``CameraInfo`` names them, with how many numbers each has."""

WIDEST: Final = np.radians(89.5)  # from the optical axis to a ray
FOCAL: Final = (0.05, 100.0)  # lengths, in widths of the image: of a fisheye and of a telescope
MIDDLE: Final = (0.3, 0.7)  # shares of the image between which the principal point lies
SKEW: Final = 0.05  # focal lengths
STRETCH: Final = 1.5  # times as far from the principal point that a lens may show a place
OBLONG: Final = 1.2  # times that a pixel may be longer than it is wide, or wider
FLAT: Final = 0.05
ROUND_TRIP: Final = 0.01  # [px], from a pixel to its ray and back
ROUNDS: Final = 8  # of Newton's method, which converges in two or three
GRAZING: Final = 0.1  # sine of the smallest angle between a ray and the plane
RADII: Final = 4096  # from the optical axis to the widest ray
LOOKS: Final = 33  # along a line, or each side of a grid, of an image
TABLE: Final = Table()
STEP: Final = 0.5  # [px] over which a derivative is a difference

Pixels = Float[ndarray, "P 2"]
Slopes = Float[ndarray, "P 2"]  # x / z and y / z of rays in the optical frame
PlanePoints = Float[ndarray, "P 2"]  # [m]
WorldPoints = Float[ndarray, "P 3"]  # [m]
Matrix = Float[ndarray, "3 3"]


@dataclass(frozen=True, eq=False)
class CameraModel:
    """A calibrated camera at a known place."""

    width: int  # of its images [px]
    height: int  # of its images [px]
    matrix: Matrix  # (3, 3) focal lengths, skew and principal point [px]
    distortion: Float[ndarray, "D"]  # (D,) of the lens, as OpenCV has it; zeros: none
    rotation: Matrix  # (3, 3) from its optical frame to the world
    place: Float[ndarray, "3"]  # (3,) [m] in the world
    lens: str = "plumb_bob"  # model of the distortion, of `LENSES`

    def slopes(self, pixels: Pixels) -> Slopes:
        """Return the slopes (P, 2) of the rays of pixels; NaN where the lens has no inverse.

        That is where the distortion is not monotone, or where the way to the slope and back to the
        pixel misses it by more than `ROUND_TRIP`.
        """
        target = _normalised(self, pixels)
        slopes, bent = _radii(self.lens, tuple(self.distortion.tolist()))
        radius = np.linalg.norm(target, axis=1)
        share = np.interp(radius, bent, slopes) / np.maximum(radius, 1e-12)
        found = target * np.where(radius > 1e-9, share, 1.0)[:, None]
        for _ in range(ROUNDS):
            off = target - self._bend(found)
            if not (np.abs(off) > 1e-12).any():
                break
            right, down, area = self._gradient(found)
            steps = np.stack([_cross(off, down), _cross(right, off)], axis=1)
            found = found + steps / np.where(area > 0.0, area, np.nan)[:, None]
        missed = (target - self._bend(found)) @ self.matrix[:2, :2].T
        good = (np.linalg.norm(missed, axis=1) < ROUND_TRIP) & self._in_sight(found)
        return np.where(good[:, None], found, np.nan)

    def _in_sight(self, slopes: Slopes) -> Bool[ndarray, "P"]:
        """Return which slopes the lens shows, and shows once."""
        widest = _radii(self.lens, tuple(self.distortion.tolist()))[0][-1]
        return (np.linalg.norm(slopes, axis=1) <= widest) & (self._gradient(slopes)[2] > 0.0)

    def _bend(self, slopes: Slopes) -> Slopes:
        """Return where slopes (P, 2) are seen, in focal lengths from the principal point."""
        x, y = slopes.T
        square = x**2 + y**2
        straight = slopes * _stretch(self.lens, self.distortion, np.sqrt(square))[:, None]
        if self.lens == "equidistant":
            return straight
        p1, p2 = self.distortion[2:4]
        across = 2 * p1 * x * y + p2 * (square + 2 * x**2)
        return straight + np.stack([across, p1 * (square + 2 * y**2) + 2 * p2 * x * y], axis=1)

    def _gradient(self, slopes: Slopes) -> tuple[Slopes, Slopes, Float[ndarray, "P"]]:
        """Return the derivatives of `_bend` by either slope, and their determinant.

        It is positive up to the fold of the lens, beyond which it shows places a second time.
        """
        step = 1e-6 * (1.0 + np.linalg.norm(slopes, axis=1))[:, None]
        right, down = (
            (self._bend(slopes + step * way) - self._bend(slopes - step * way)) / (2 * step)
            for way in np.eye(2)
        )
        return right, down, _cross(right, down)

    def rays(self, pixels: Pixels) -> WorldPoints:
        """Return the directions (P, 3) in the world in which pixels look; NaN as `slopes`."""
        flat = self.slopes(pixels)
        return np.asarray(np.column_stack([flat, np.ones(len(flat))]) @ self.rotation.T)

    def rays_of_all(self) -> Float[ndarray, "height width 3"]:
        """Return the directions in which all pixels look; as `rays`."""
        grid = np.stack(np.meshgrid(np.arange(self.width), np.arange(self.height)), axis=-1)
        flat = self.rays(grid.reshape(-1, 2).astype(np.float64))
        return flat.reshape(self.height, self.width, 3)

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

    def project(self, points: WorldPoints, rim: bool = False) -> Pixels:
        """Return where places (P, 3) [m] in the world are seen; NaN: behind the camera.

        Beyond what the lens can see they are NaN, too, or, if asked for, at its rim.
        """
        local = (points - self.place) @ self.rotation
        flat = local[:, :2] / np.where(local[:, 2:] > 1e-6, local[:, 2:], np.nan)
        if rim:
            widest = _radii(self.lens, tuple(self.distortion.tolist()))[0][-1]
            flat = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True) / widest, 1.0)
        else:
            flat = np.where(self._in_sight(flat)[:, None], flat, np.nan)
        bent = self._bend(flat)
        return np.asarray(np.column_stack([bent, np.ones(len(bent))]) @ self.matrix[:2].T)

    @property
    def misses_corners(self) -> bool:
        """Whether the lens has no inverse in a corner of the image."""
        corners = np.array([(x, y) for x in (0, self.width - 1) for y in (0, self.height - 1)])
        return not np.isfinite(self.slopes(corners.astype(np.float64))).all()

    def moved(self, rotation: Matrix, place: Float[ndarray, "3"]) -> "CameraModel":
        """Return the same camera at another pose in the world."""
        return replace(self, rotation=rotation, place=place)


def _normalised(camera: CameraModel, pixels: Pixels) -> Slopes:
    """Return pixels in focal lengths from the principal point."""
    return (np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(camera.matrix).T)[:, :2]


def _cross(one: Slopes, other: Slopes) -> Float[ndarray, "P"]:
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])


def _stretch(
    lens: str, distortion: Float[ndarray, "D"], radius: Float[ndarray, "P"]
) -> Float[ndarray, "P"]:
    """Return by which factor the lens moves rays of slopes away from the principal point."""
    if lens == "equidistant":
        angle = np.arctan(radius)
        even = np.polynomial.polynomial.polyval(angle**2, np.append(1.0, distortion))
        return np.asarray(even * np.where(radius > 1e-9, angle / np.maximum(radius, 1e-9), 1.0))
    k1, k2, _, _, k3, k4, k5, k6 = np.pad(distortion, (0, 8 - len(distortion)))
    above, below = (
        np.polynomial.polynomial.polyval(radius**2, [1.0, *ks])
        for ks in ((k1, k2, k3), (k4, k5, k6))
    )
    return np.asarray(above / np.where(below > 0.0, below, np.nan))


@lru_cache
def _radii(
    lens: str, distortion: tuple[float, ...]
) -> tuple[Float[ndarray, "R"], Float[ndarray, "R"]]:
    """Return slopes, and where they are seen, up to where the distortion is no longer monotone.

    A lens that shows a ray `FLAT` times as far off for each radian as in its middle counts as such.
    """
    angles = np.linspace(0.0, WIDEST, RADII)
    slopes = np.tan(angles)
    bent = slopes * _stretch(lens, np.array(distortion), slopes)
    falls = np.flatnonzero(~(np.diff(bent) > FLAT * angles[1]))
    end = falls[0] + 1 if len(falls) else len(slopes)
    return slopes[:end], bent[:end]


def check_calibration(
    width: int, height: int, matrix: Matrix, model: str, distortion: Float[ndarray, "D"]
) -> CameraModel:
    """Return the camera that a calibration of raw images states, at no place yet.

    Raises `InvalidInputError`: naming what is wrong.
    """
    if not (np.isfinite(matrix).all() and np.isfinite(distortion).all()):
        raise InvalidInputError("the camera's calibration has NaN or Inf; all must be finite")
    if not matrix.any():
        raise InvalidInputError(
            "the camera is not calibrated, K is all zeros: calibrate first, with"
            " `ros2 run camera_calibration cameracalibrator`"
        )
    _check_matrix(width, height, matrix)
    ideal = not distortion.any()
    if model not in LENSES and not (ideal and not model):
        hint = did_you_mean(model, LENSES)
        raise InvalidInputError(
            f"the camera's distortion model is {model!r}{hint}; allowed: {', '.join(LENSES)}"
        )
    lens = model or "plumb_bob"
    if len(distortion) not in LENSES[lens] and not (ideal and lens != "equidistant"):
        raise InvalidInputError(
            f"the distortion {lens} has {len(distortion)} numbers; allowed:"
            f" {' or '.join(map(str, LENSES[lens]))}"
        )
    numbers = np.zeros(5) if ideal and lens != "equidistant" else distortion
    camera = CameraModel(width, height, matrix, numbers, np.eye(3), np.zeros(3), lens)
    _check_lens(camera)
    return camera


def _check_lens(camera: CameraModel) -> None:
    """Check that a lens is one from the principal point to the middle of each edge of the image.

    Corners may be lost, see `CameraModel.misses_corners`.

    Raises `InvalidInputError`: the distortion folds, or it stretches the image as no lens does.
    """
    wide, high = camera.width - 1, camera.height - 1
    edges = np.array([(0, high / 2), (wide, high / 2), (wide / 2, 0), (wide / 2, high)])
    pixels = np.linspace(camera.matrix[:2, 2], edges, LOOKS)[1:].reshape(-1, 2)
    with np.errstate(all="ignore"):  # of any numbers
        slopes = camera.slopes(pixels)
        seen = np.linalg.norm(_normalised(camera, pixels), axis=1)
        all_slopes, bent = _radii(camera.lens, tuple(camera.distortion.tolist()))
        beyond = (len(all_slopes) == RADII) & (seen > bent[-1])  # of a fisheye: there is no image
        folds = ~np.isfinite(slopes).all(axis=1) & ~beyond
        stretch = np.where(beyond, 0.0, seen / np.linalg.norm(slopes, axis=1))
    far = np.nanmax(stretch, initial=0.0)
    if not folds.any() and far <= STRETCH:
        return
    if folds.any():
        x, y = pixels[np.argmax(folds)].tolist()
        what = f"folds at ({x:.0f}, {y:.0f}) px, where it has no inverse"
    else:
        x, y = pixels[np.nanargmax(stretch)].tolist()
        what = f"moves ({x:.0f}, {y:.0f}) px to {far:.3g} times its distance from the principal"
        what += f" point, more than {STRETCH:g} times"
    numbers = ", ".join(f"{one:g}" for one in camera.distortion.tolist())
    raise InvalidInputError(
        f"the distortion {camera.lens} ({numbers}) {what}; it must be that of a lens up to the"
        f" middle of each edge of {camera.width} x {camera.height} px: calibrate the camera again,"
        " with the board also near all edges"
    )


def sees_table(camera: CameraModel) -> bool:
    """Return whether a pixel of a camera shows a point of the table."""
    grid = (np.linspace(0, size - 1, LOOKS) for size in (camera.width, camera.height))
    pixels = np.stack(np.meshgrid(*grid), axis=-1).reshape(-1, 2)
    with np.errstate(all="ignore"):  # of any pose
        return bool(TABLE.contains(camera.on_plane(pixels, 0.0)).any())


def check_view(camera: CameraModel, what: str, hint: str = "") -> None:
    """Check that a camera sees a part of the table.

    Raises `InvalidInputError`: no pixel sees one; with where the camera is and looks.
    """
    if sees_table(camera):
        return
    x, y, z = camera.place.tolist()
    across, along, up = camera.rotation[:, 2].tolist()
    where = "under the table" if z <= 0.0 else f"{z:.3g} m above the table"
    raise InvalidInputError(
        f"{what} shows no point of the table ({TABLE.describe()}): it is at ({x:.3g}, {y:.3g}) m,"
        f" {where}, and looks along ({across:.2f}, {along:.2f}, {up:.2f}); correct its pose: place"
        f" in m, turn as x y z w, of the optical frame (z ahead) in the world{hint}"
    )


def _check_matrix(width: int, height: int, matrix: Matrix) -> None:
    """Check the camera's matrix K; raises `InvalidInputError`."""
    if width < 1 or height < 1:
        raise InvalidInputError(
            f"the camera's calibration is for {width} x {height} px; both must be positive"
        )
    (fx, skew, cx), (shear, fy, cy), last = matrix.tolist()
    if last != [0.0, 0.0, 1.0] or shear != 0.0:
        raise InvalidInputError(
            f"the camera's K has the last row {last} and {shear:g} below fx; these must be 0 0 1"
            " and 0: is K transposed, as MATLAB's IntrinsicMatrix?"
        )
    low, high = (share * width for share in FOCAL)
    if not (low <= fx <= high and low <= fy <= high):
        raise InvalidInputError(
            f"the camera's focal lengths are {fx:g} and {fy:g} px; for images of {width} px both"
            f" must be {low:g} to {high:g}: is the camera calibrated, in px?"
        )
    if max(fx, fy) > OBLONG * min(fx, fy):
        raise InvalidInputError(
            f"the camera's focal lengths are {fx:g} and {fy:g} px; one may be at most {OBLONG:g}"
            " times the other: calibrate with images as they come, neither stretched nor halved"
        )
    if abs(skew) > SKEW * fx:
        raise InvalidInputError(
            f"the camera's skew is {skew:g} px; at most {SKEW * fx:.3g} px is allowed: calibrate"
            " the camera again, or set it to 0"
        )
    least, most = MIDDLE
    if not (least * width <= cx <= most * width and least * height <= cy <= most * height):
        raise InvalidInputError(
            f"the camera's principal point is ({cx:g}, {cy:g}) px; in images of {width} x"
            f" {height} px it must be at {least * width:g} to {most * width:g} and"
            f" {least * height:g} to {most * height:g} px: is K of images of another size, or of"
            " a part of them?"
        )


def turn_of(rotation: Matrix) -> Float[ndarray, "4"]:
    """Return the unit quaternion x y z w of a matrix (3, 3)."""
    return Rotation.from_matrix(rotation).as_quat()


def rotation_of(turn: Float[ndarray, "4"]) -> Matrix:
    """Return the matrix (3, 3) of a unit quaternion x y z w."""
    return Rotation.from_quat(turn).as_matrix()
