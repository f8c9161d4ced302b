"""The brightness and the depths of images."""

from typing import Any, Final

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from sain_core.errors import InvalidInputError
from sain_core.wire.images import pixel_rows

TO_GREY: Final[dict[str, tuple[int, int | None]]] = {  # bytes of a pixel, and the conversion
    "mono8": (1, None),
    "8UC1": (1, None),
    "rgb8": (3, cv2.COLOR_RGB2GRAY),
    "bgr8": (3, cv2.COLOR_BGR2GRAY),
    "rgba8": (4, cv2.COLOR_RGBA2GRAY),
    "bgra8": (4, cv2.COLOR_BGRA2GRAY),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2GRAY_YUY2),
    "yuv422": (2, cv2.COLOR_YUV2GRAY_UYVY),
}
DEPTHS: Final = {"16UC1": ("u2", 1e-3), "mono16": ("u2", 1e-3), "32FC1": ("f4", 1.0)}
"""Types of depth images, with the size of their unit [m]."""
RANGE: Final = (0.05, 10.0)  # [m], of distances that a camera over a table sees

Grey = UInt8[ndarray, "height width"]
Depth = Float[ndarray, "height width"]


def decode_grey(message: Any) -> Grey:
    """Return the brightness of an image.

    Raises `InvalidInputError`: an encoding that is not read, or data of another size.
    """
    if message.encoding not in TO_GREY:
        raise InvalidInputError(
            f"the image has the encoding {message.encoding!r}; allowed: {', '.join(TO_GREY)}:"
            " let the driver or image_proc convert it"
        )
    channels, conversion = TO_GREY[message.encoding]
    pixels = pixel_rows(message, channels).reshape(message.height, message.width, channels)
    if conversion is None:
        return np.ascontiguousarray(pixels[..., 0])
    return np.asarray(cv2.cvtColor(pixels, conversion))


def decode_depth(message: Any) -> Depth:
    """Return the distances along the optical axis [m]; NaN: unknown. Raises as `decode_grey`."""
    if message.encoding not in DEPTHS:
        raise InvalidInputError(
            f"the depth image has the encoding {message.encoding!r}; allowed: {', '.join(DEPTHS)}"
        )
    kind, unit = DEPTHS[message.encoding]
    order = ">" if message.is_bigendian else "<"
    rows = np.ascontiguousarray(pixel_rows(message, int(kind[1]))).view(order + kind)
    metres = rows.reshape(message.height, message.width).astype(np.float64) * unit
    known = metres[metres > 0.0]
    if not ((known > RANGE[0]) & (known < RANGE[1])).any():
        found = f"their median is {np.median(known):.3g} m" if len(known) else "all are unknown"
        raise InvalidInputError(
            f"the depth image has no distance of {RANGE[0]:g} to {RANGE[1]:g} m, {found}: 16 bits"
            " must be in mm, floats in m, bytes in the stated order, and the camera uncovered"
        )
    return np.where(metres > 0.0, metres, np.nan)
