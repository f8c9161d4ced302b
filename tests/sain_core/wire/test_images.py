"""Images of cameras as colours, whatever order their bytes have."""

from types import SimpleNamespace

import numpy as np
import pytest

from sain_core.errors import InvalidInputError
from sain_core.wire.images import CHANNELS, camera_key, decode_colour

RGB = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)


def message(pixels, encoding, spare=0):
    rows = np.pad(pixels.reshape(len(pixels), -1), ((0, 0), (0, spare)))
    size = {"height": pixels.shape[0], "width": pixels.shape[1], "step": rows.shape[1]}
    return SimpleNamespace(encoding=encoding, data=rows.tobytes(), **size)


@pytest.mark.parametrize("encoding", CHANNELS)
def test_colours_are_those_of_the_encoding_and_padding_is_left_out(encoding):
    channels, size = CHANNELS[encoding]
    pixels = np.zeros((2, 3, size), np.uint8)
    for colour, place in enumerate(np.arange(size)[channels if size > 1 else [0, 0, 0]]):
        pixels[..., place] = RGB[..., colour]
    wanted = RGB if size > 1 else np.repeat(RGB[..., 2:], 3, axis=2)
    np.testing.assert_array_equal(decode_colour(message(pixels, encoding, spare=5)), wanted)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"encoding": "bayer_rggb8"}, "the encoding 'bayer_rggb8'; allowed: rgb8"),
        ({"height": 0}, "is 3 x 0 px"),
        ({"step": 8}, "3 x 2 px in rgb8 has 18 bytes in rows of 8; it must have 2 rows of at le"),
    ],
)
def test_what_is_no_image_is_named(change, text):
    broken = SimpleNamespace(**vars(message(RGB, "rgb8")) | change)
    with pytest.raises(InvalidInputError, match=text):
        decode_colour(broken)


def test_a_camera_has_the_name_of_its_topic_without_the_graph_and_the_end():
    names = "/sain/camera/color/image_raw", "/wrist/image_raw", "/image_raw"
    keys = [camera_key(name, "/sain").removeprefix("observation.images.") for name in names]
    assert keys == ["camera_color", "wrist", "camera"]
