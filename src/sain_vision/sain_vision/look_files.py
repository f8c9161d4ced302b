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

from sain_core.errors import ConfigError, InvalidInputError, UntrustedFileError
from sain_core.guarding.documents import read_user_yaml
from sain_core.guarding.untrusted import read_regular
from sain_vision.extrinsics_file import read_extrinsics
from sain_vision.optics import CameraModel, check_calibration, rotation_of

IMAGE_BYTES: Final = 50_000_000
IMAGE_PIXELS: Final = 50_000_000
MILLIMETRE: Final = 1e-3  # [m], unit of depth images
INFO: Final = (
    "image_width", "image_height", "camera_matrix", "distortion_model", "distortion_coefficients",
)  # fmt: skip


def read_depth(path: Path) -> Float[ndarray, "height width"]:
    """Return the distances [m] of a PNG with 16 bits, in mm; NaN: unknown.

    Raises:
        ConfigError: there is no such file, or it is another image.
    """
    pixels = _read_image(path, cv2.IMREAD_UNCHANGED)
    if pixels.dtype != np.uint16 or pixels.ndim != 2:
        raise ConfigError(
            f"{path} has pixels of {pixels.dtype} and shape {pixels.shape}; a depth image has one"
            " number of 16 bits, in mm, for each"
        )
    return np.where(pixels > 0, pixels * MILLIMETRE, np.nan)


def read_picture(path: Path) -> UInt8[ndarray, "height width 3"]:
    """Return blue, green and red of an image; raises as `read_depth`."""
    return _read_image(path, cv2.IMREAD_COLOR)


def read_camera(info: Path, extrinsics: Path) -> CameraModel:
    """Return the camera of two files: as `camera_calibration` and as `calibrate_camera` write them.

    Raises:
        ConfigError: one of them cannot be used.
    """
    if info.is_file() and info.open("rb").read(6) == b"%YAML:":
        raise ConfigError(
            f"camera info {info} is a file of OpenCV's (%YAML:1.0); give the one that"
            " camera_calibration writes (ost.yaml)"
        )
    content = read_user_yaml(info, "camera info")
    if not isinstance(content, Mapping) or any(key not in content for key in INFO):
        raise ConfigError(f"camera info {info} must have {', '.join(INFO)}")
    try:
        size = int(content["image_width"]), int(content["image_height"])
        matrix = np.array(content["camera_matrix"]["data"], dtype=np.float64)
        if matrix.size != 9:
            raise InvalidInputError(f"K has {matrix.size} numbers; it needs 9, in 3 rows")
        lens = np.array(content["distortion_coefficients"]["data"], dtype=np.float64).ravel()
        camera = check_calibration(
            *size, matrix.reshape(3, 3), str(content["distortion_model"]), lens
        )
    except (TypeError, KeyError, ValueError, InvalidInputError) as error:
        raise ConfigError(f"camera info {info} cannot be used: {error}") from error
    pose = read_extrinsics(extrinsics)
    return camera.moved(rotation_of(pose.turn), pose.place)


def _read_image(path: Path, how: int) -> Any:
    try:
        data = np.frombuffer(read_regular(path, IMAGE_BYTES), dtype=np.uint8)
    except OSError as error:
        raise ConfigError(f"image {path}: {error.strerror or error}") from error
    except UntrustedFileError as error:
        raise ConfigError(f"image {path} is not read: {error}") from error
    _check_header(path, data)
    pixels = cv2.imdecode(data, how)
    if pixels is None:
        raise ConfigError(f"{path} is no image that OpenCV reads; give a PNG")
    return pixels


def _check_header(path: Path, data: UInt8[ndarray, "B"]) -> None:
    """Check how many pixels a file announces, before any is decoded."""
    try:
        with warnings.catch_warnings(action="ignore"):
            width, height = Image.open(BytesIO(data.tobytes())).size
    except Image.DecompressionBombError as error:
        raise ConfigError(f"image {path} is not read: {error}") from error
    except (OSError, ValueError, SyntaxError) as error:
        raise ConfigError(f"{path} is no image that OpenCV reads; give a PNG") from error
    if width * height > IMAGE_PIXELS:
        raise ConfigError(
            f"image {path} announces {width} x {height} px; at most {IMAGE_PIXELS:,} are read"
        )
