"""A look of a camera in files: depth as a PNG, its calibration, and where the camera was."""

import warnings
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from PIL import Image

from sain_core.config import check_number, check_numbers, check_text
from sain_core.errors import ConfigError, InvalidInputError, UntrustedFileError
from sain_core.guarding.documents import read_user_yaml
from sain_core.guarding.untrusted import read_regular
from sain_vision.extrinsics_file import read_extrinsics
from sain_vision.optics import CameraModel, check_calibration

IMAGE_BYTES: Final = 50_000_000
IMAGE_PIXELS: Final = 50_000_000
LARGEST_SIDE: Final = 50_000  # [px]
DEPTHS: Final = (0.05, 10.0)  # [m]
MILLIMETRE: Final = 1e-3  # [m], unit of depth images
INFO: Final = (
    "image_width", "image_height", "camera_matrix", "distortion_model", "distortion_coefficients",
)  # fmt: skip


def read_depth(path: Path) -> Float[ndarray, "height width"]:
    """Return the distances [m] of a PNG with 16 bits, in mm; NaN: unknown.

    Raises `ConfigError`: there is no such file, or it is another image.
    """
    pixels = _read_image(path)
    if pixels.dtype != np.uint16 or pixels.ndim != 2:
        raise ConfigError(
            f"{path} has pixels of {pixels.dtype} and shape {pixels.shape}; a depth image has one"
            " number of 16 bits, in mm, for each"
        )
    return known_depths(pixels * MILLIMETRE)


def known_depths(metres: Float[ndarray, "height width"]) -> Float[ndarray, "height width"]:
    """Return distances [m], NaN where they are unknown, which is 0.

    Raises `InvalidInputError`: none is one that a camera over a table sees.
    """
    known = metres[metres > 0.0]
    if not ((known > DEPTHS[0]) & (known < DEPTHS[1])).any():
        found = f"their median is {np.median(known):.3g} m" if len(known) else "all are unknown"
        raise InvalidInputError(
            f"the depth image has no distance of {DEPTHS[0]:g} to {DEPTHS[1]:g} m, {found}: 16 bits"
            " must be in mm, floats in m, bytes in the stated order, and the camera uncovered"
        )
    return np.where(metres > 0.0, metres, np.nan)


def read_camera(info: Path, extrinsics: Path) -> CameraModel:
    """Return the camera of two files: as `camera_calibration` and as `calibrate_camera` write them.

    Raises `ConfigError`: one of them cannot be used.
    """
    if info.is_file() and info.open("rb").read(6) == b"%YAML:":
        raise ConfigError(
            f"camera info {info} is a file of OpenCV's (%YAML:1.0); give the one that"
            " camera_calibration writes (ost.yaml)"
        )
    content = read_user_yaml(info, "camera info")
    if any(key not in content for key in INFO):
        raise ConfigError(f"camera info {info} must have {', '.join(INFO)}")
    try:
        width, height = (
            int(check_number(key, content[key], 1, LARGEST_SIDE, "px", whole=True))
            for key in INFO[:2]
        )
        matrix, lens = (
            np.array(check_numbers(f"{key}.data", _data(content[key]), size))
            for key, size in (("camera_matrix", 9), ("distortion_coefficients", None))
        )
        model = check_text("distortion_model", content["distortion_model"], 0)
        camera = check_calibration(width, height, matrix.reshape(3, 3), model, lens)
    except (ConfigError, InvalidInputError) as error:
        raise ConfigError(f"camera info {info} cannot be used: {error}") from error
    try:
        return read_extrinsics(extrinsics).placed(camera)
    except InvalidInputError as error:
        raise ConfigError(f"calibration {extrinsics}: {error}") from error


def _data(matrix: Any) -> Any:
    """Return the numbers of a matrix, which camera_calibration writes with its rows and columns."""
    return matrix.get("data") if isinstance(matrix, Mapping) else matrix


def _read_image(path: Path) -> Any:
    try:
        data = np.frombuffer(read_regular(path, IMAGE_BYTES), dtype=np.uint8)
    except OSError as error:
        raise ConfigError(f"image {path}: {error.strerror or error}") from error
    except UntrustedFileError as error:
        raise ConfigError(f"image {path} is not read: {error}") from error
    _check_header(path, data)
    pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ConfigError(f"{path} is no image that OpenCV reads; give a PNG")
    return pixels


def _check_header(path: Path, data: UInt8[ndarray, "B"]) -> None:
    """Check how many pixels a file announces, before any is decoded."""
    try:
        with warnings.catch_warnings(action="ignore"):
            width, height = Image.open(BytesIO(data.tobytes())).size
    except Image.DecompressionBombError as error:
        raise ConfigError(
            f"image {path} announces more pixels than the {IMAGE_PIXELS:,} that are read"
        ) from error
    except (OSError, ValueError, SyntaxError) as error:
        raise ConfigError(f"{path} is no image that OpenCV reads; give a PNG") from error
    if width * height > IMAGE_PIXELS:
        raise ConfigError(
            f"image {path} announces {width} x {height} px; at most {IMAGE_PIXELS:,} are read"
        )
