"""A look of a camera in files: depth as a PNG, its calibration, and where the camera was."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from sain_core.errors import ConfigError, InvalidInputError, UntrustedFileError
from sain_core.guarding.untrusted import read_regular, read_user_yaml
from sain_vision.extrinsics_file import read_extrinsics
from sain_vision.optics import CameraModel, check_calibration, rotation_of

IMAGE_BYTES: Final = 50_000_000
MILLIMETRE: Final = 1e-3  # [m], unit of depth images
INFO: Final = ("image_width", "image_height", "camera_matrix", "distortion_coefficients")


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
    content = read_user_yaml(info, "camera info")
    if not isinstance(content, Mapping) or any(key not in content for key in INFO):
        raise ConfigError(f"camera info {info} must have {', '.join(INFO)}")
    try:
        size = int(content["image_width"]), int(content["image_height"])
        matrix = np.array(content["camera_matrix"]["data"], dtype=np.float64).reshape(3, 3)
        lens = np.array(content["distortion_coefficients"]["data"], dtype=np.float64).ravel()
        check_calibration(*size, matrix, str(content.get("distortion_model", "")), lens)
    except (TypeError, KeyError, ValueError, InvalidInputError) as error:
        raise ConfigError(f"camera info {info} cannot be used: {error}") from error
    pose = read_extrinsics(extrinsics)
    lens = lens if lens.any() else np.zeros(5)
    return CameraModel(*size, matrix, lens, rotation_of(pose.turn), pose.place)


def _read_image(path: Path, how: int) -> Any:
    try:
        data = np.frombuffer(read_regular(path, IMAGE_BYTES), dtype=np.uint8)
    except OSError as error:
        raise ConfigError(f"image {path}: {error.strerror or error}") from error
    except UntrustedFileError as error:
        raise ConfigError(f"image {path} is not read: {error}") from error
    pixels = cv2.imdecode(data, how) if len(data) else None
    if pixels is None:
        raise ConfigError(f"{path} is no image that OpenCV reads; give a PNG")
    return pixels
