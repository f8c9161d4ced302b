"""Lenses of every model: to pixels and back, and calibrations that are not used."""

from typing import Any

import numpy as np
import pytest

from sain_core.errors import InvalidInputError
from sain_vision.optics import CameraModel, check_calibration

WIDTH, HEIGHT = 1280, 960
K = np.array([[840.0, 0, 639.5], [0, 850.0, 479.5], [0, 0, 1]])
GRID = np.stack(np.meshgrid(np.linspace(0, WIDTH - 1, 33), np.linspace(0, HEIGHT - 1, 25)), -1)
PIXELS = GRID.reshape(-1, 2)
LENSES = {
    "plumb_bob": (0.5, 0.5, 0.01, 0.01, 0.3),
    "rational_polynomial": (1.0, 0.3, 0.005, 0.005, 0.1, 1.0, 0.4, 0.1),
    "equidistant": (0.1, 0.05, 0.02, 0.01),
}
C1 = [0.929988205433, 0.165922805667, 0, 0, 0.002885974478, 1.331432461739, 0.435830116272,
      0.027607271448]  # fmt: skip


def camera_of(lens: str, numbers: Any, focal: float = 840.0, skew: float = 0.0) -> CameraModel:
    matrix = np.array([[focal, skew, 639.5], [0, focal, 479.5], [0, 0, 1.0]])
    values = np.array(numbers, dtype=float)
    return CameraModel(WIDTH, HEIGHT, matrix, values, np.eye(3), np.zeros(3), lens)


@pytest.mark.parametrize("lens", LENSES)
def test_a_pixel_comes_back_to_itself_or_is_refused(lens):
    """Random lenses, some of which no calibration would give: never a ray of another pixel."""
    random, used = np.random.default_rng(0), []
    for _ in range(100):
        numbers = random.uniform(-1, 1, len(LENSES[lens])) * LENSES[lens]
        camera = camera_of(lens, numbers, random.uniform(300, 1500), random.uniform(-10, 10))
        rays = camera.rays(PIXELS)
        good = np.isfinite(rays).all(axis=1)
        off = np.linalg.norm(camera.project(3.0 * rays[good]) - PIXELS[good], axis=1)
        assert off.max(initial=0.0) < 0.01
        used.append(good.mean())
    assert np.mean(used) > 0.5


@pytest.mark.parametrize(
    ("lens", "numbers", "focal"),
    [
        ("plumb_bob", [-0.3, 0.09, 0, 0, 0], 840),
        ("rational_polynomial", C1, 664),
        ("equidistant", [0.0] * 4, 600),
    ],
)
def test_rays_are_those_of_the_lens_own_formula(lens, numbers, focal):
    """Each formula as its source has it, written once more: OpenCV's manual, and r = f * angle."""
    camera = camera_of(lens, numbers, focal, skew=5.0)
    check_calibration(WIDTH, HEIGHT, camera.matrix, lens, camera.distortion)  # which all pass
    r = np.linspace(0.01, 1.1, 40)
    k = [*numbers, *[0.0] * 8]
    if lens == "equidistant":
        bent = np.arctan(r) * (1 + k[0] * np.arctan(r) ** 2)
    else:
        bent = r * (1 + k[0] * r**2 + k[1] * r**4 + k[4] * r**6)
        bent /= 1 + k[5] * r**2 + k[6] * r**4 + k[7] * r**6
    angle = 0.7
    x, y = bent * np.cos(angle), bent * np.sin(angle)
    pixels = np.column_stack([focal * x + 5.0 * y + 639.5, focal * y + 479.5])
    rays = camera.rays(pixels)
    right = np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    np.testing.assert_allclose(rays[:, :2], right, rtol=1e-6)


def test_beyond_the_fold_of_a_lens_nothing_is_seen():
    camera = camera_of("plumb_bob", [-0.3, 0, 0, 0, 0], 900)  # folds at a slope of 1.05
    assert np.isnan(camera.project(np.array([[1.3, 0.0, 1.0]]))).all()
    assert np.isfinite(camera.project(np.array([[1.0, 0.0, 1.0]]))).all()
    far = np.array([[639.5 + 900 * 0.75, 479.5]])  # the fold is at 0.70
    assert np.isnan(camera.rays(far)).any()


def edited(row: int, column: int, value: float) -> np.ndarray:
    matrix = K.copy()
    matrix[row, column] = value
    return matrix


@pytest.mark.parametrize(
    ("matrix", "lens", "numbers", "text"),
    [
        (np.zeros((3, 3)), "plumb_bob", 5, "not calibrated, K is all zeros: calibrate first"),
        (K.T, "plumb_bob", 5, r"last row \[639.5, 479.5, 1.0\] .* is K transposed"),
        (edited(2, 2, 2.0), "plumb_bob", 5, "these must be 0 0 1"),
        (edited(1, 0, 3.0), "plumb_bob", 5, "3 below fx"),
        (edited(0, 0, np.nan), "plumb_bob", 5, "NaN or Inf"),
        (edited(0, 0, -840.0), "plumb_bob", 5, "focal lengths are -840 and 850 px"),
        (edited(0, 0, 1700.0), "plumb_bob", 5, "are 1700 and 850 px; one may be at most 1.2 ti"),
        (edited(0, 2, 1300.0), "plumb_bob", 5, r"principal point is \(1300, 479.5\) px; .* 384 to"),
        (2 * K - np.diag([0, 0, 1.0]), "plumb_bob", 5, "is K of images of another size, or of a"),
        (edited(0, 1, -50.0), "plumb_bob", 5, "skew is -50 px; at most 42 px is allowed: calib"),
        (K, "fisheye", 4, "is 'fisheye'; allowed: plumb_bob, rational_polynomial, equidistant"),
        (K, "plumb_bob", 8, "plumb_bob has 8 numbers; allowed: 5 or 4"),
        (K, "equidistant", 0, "equidistant has 0 numbers; allowed: 4"),
    ],
)  # fmt: skip
def test_what_a_calibration_may_not_be(matrix, lens, numbers, text):
    with pytest.raises(InvalidInputError, match=text):
        check_calibration(WIDTH, HEIGHT, matrix, lens, np.full(numbers, 0.01))


@pytest.mark.parametrize(
    ("lens", "numbers", "text"),
    [
        ("plumb_bob", [-50, 0, 0, 0, 0], r"\(-50, 0, 0, 0, 0\) folds at \(5\d\d, 480\) px, where"),
        ("plumb_bob", [1e300, 0, 0, 0, 0], r"\(1e\+300, 0, 0, 0, 0\) folds at"),
        ("plumb_bob", [1000, 0, 0, 0, 0], r"\(1000, .*\) moves \(0, 480\) px to [\d.]+ times its"),
        ("rational_polynomial", [0, 0, 0, 0, 0, -5, 0, 0], "calibrate the camera again, with the"),
        ("equidistant", [50, 0, 0, 0], r"equidistant \(50, 0, 0, 0\) moves"),
    ],
)  # fmt: skip
def test_a_lens_that_cannot_be_is_named_with_the_place(lens, numbers, text):
    with pytest.raises(InvalidInputError, match=text):
        check_calibration(WIDTH, HEIGHT, K, lens, np.array(numbers, dtype=float))


@pytest.mark.parametrize(
    ("lens", "numbers", "focal"),
    [
        ("plumb_bob", [-0.3, 0, 0, 0, 0], 950.0),  # folds between the edges and the corners
        ("plumb_bob", [-2.0, 90.0, 0, 0, 0], 9000.0),  # a telescope
        ("equidistant", [-0.02, 0.01, 0, 0], 320.0),  # shows a circle
        ("equidistant", [0.0] * 4, 250.0),  # sees behind itself
    ],
)
def test_lenses_that_can_be_are_used(lens, numbers, focal):
    matrix = np.array([[focal, 0, 645.0], [0, focal, 470.0], [0, 0, 1]])
    camera = check_calibration(WIDTH, HEIGHT, matrix, lens, np.array(numbers))
    assert np.isfinite(camera.rays(np.array([[640.0, 480.0]]))).all()
    assert camera.misses_corners == (focal in (950.0, 320.0, 250.0))
