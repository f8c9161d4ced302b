"""An episode as an animation, in gym-pusht's own pictures."""

from collections.abc import Sequence
from io import BytesIO
from typing import Final

from numpy import ndarray
from PIL import Image

RATE: Final = 10  # [1/s], as fast as it happens
HOLD: Final = 1.5  # [s], of the last picture
COLOURS: Final = 48


def gif_of(frames: Sequence[ndarray]) -> bytes:
    """Return pictures (height, width, 3) as a GIF."""
    pictures = [Image.fromarray(frame) for frame in frames]
    palette = _both(pictures[0], pictures[-1]).quantize(COLOURS)
    indexed = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    times = [round(1000 / RATE)] * len(indexed)
    times[-1] += round(1000 * HOLD)
    memory = BytesIO()
    indexed[0].save(
        memory, format="GIF", save_all=True, append_images=indexed[1:], duration=times, loop=0
    )
    return memory.getvalue()


def _both(first: Image.Image, last: Image.Image) -> Image.Image:
    """Return two pictures side by side: one of them shows the goal, which the block may cover."""
    sheet = Image.new("RGB", (first.width + last.width, first.height))
    sheet.paste(first, (0, 0))
    sheet.paste(last, (first.width, 0))
    return sheet
