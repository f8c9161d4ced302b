"""``sensor_msgs/Image`` to arrays; back: `sain_core.ros.codec.encode_image`."""

from typing import Any, Final

import numpy as np
from jaxtyping import UInt8
from numpy import ndarray

from sain_core.errors import InvalidInputError

CAMERAS: Final = "observation.images."  # begins what data sets and policies call a camera's images
USUAL: Final = "image_raw"  # how topics of images end by default
RGB, BGR, GREY = slice(3), slice(2, None, -1), (0, 0, 0)
# where red, green and blue are in the bytes of a pixel, and how many these are
CHANNELS: Final[dict[str, tuple[Any, int]]] = {
    "rgb8": (RGB, 3), "bgr8": (BGR, 3), "rgba8": (RGB, 4), "bgra8": (BGR, 4), "mono8": (GREY, 1),
    "8UC1": (GREY, 1),
}  # fmt: skip

Colour = UInt8[ndarray, "height width 3"]


def camera_key(topic: str, namespace: str) -> str:
    """Return the name of a topic's images: ``/sain/camera/color/image_raw`` is camera_color's."""
    parts = topic.removeprefix(f"{namespace}/").strip("/").split("/")[:-1]
    return CAMERAS + ("_".join(parts) or "camera")


def decode_colour(message: Any, step: int = 1) -> Colour:
    """Return the colours of an image, or of each so many pixels of it.

    Raises `InvalidInputError`: it has none that are read.
    """
    if message.encoding not in CHANNELS:
        raise InvalidInputError(
            f"the image has the encoding {message.encoding[:40]!r}; allowed: {', '.join(CHANNELS)}"
        )
    channels, size = CHANNELS[message.encoding]
    pixels = pixel_rows(message, size).reshape(message.height, message.width, size)
    return np.ascontiguousarray(pixels[::step, ::step, channels])


def pixel_rows(message: Any, size: int) -> UInt8[ndarray, "height bytes"]:
    """Return the bytes of an image's pixels, of so many bytes each; raises `InvalidInputError`."""
    height, width, step = message.height, message.width, message.step
    if height < 1 or width < 1:
        raise InvalidInputError(f"the image is {width} x {height} px; it must have pixels")
    if step < width * size or len(message.data) != step * height:
        raise InvalidInputError(
            f"the image of {width} x {height} px in {message.encoding} has {len(message.data)}"
            f" bytes in rows of {step}; it must have {height} rows of at least {width * size}"
        )
    return np.frombuffer(message.data, dtype=np.uint8).reshape(height, step)[:, : width * size]
