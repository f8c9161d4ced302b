"""Pictures one after another as an animated GIF, with one palette for all: nothing flickers."""

from collections.abc import Sequence
from io import BytesIO
from typing import Final

import numpy as np
from PIL import Image

from sain_core.view.palette import rgba

SAMPLES: Final = 8  # pictures that the common palette is made from
SWATCH: Final = 40  # [px], rows that a rare colour gets in the sheet for the palette


def gif_of(
    frames: Sequence[Image.Image],
    rate: float,
    hold: float,
    colours: int = 256,
    rare: Sequence[str] = (),
) -> bytes:
    """Return an animated GIF. The same pictures give the same bytes.

    Args:
        frames: at least one, all of one size.
        rate: pictures a second [Hz].
        hold: how long the last one stands [s].
        colours: in the palette, at most 256.
        rare: colours ``#rrggbb`` that it has in any case: of too few pixels to count.
    """
    palette = _common_palette(frames, colours, rare)
    indexed = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    durations = [round(1000 / rate)] * len(indexed)
    durations[-1] += round(1000 * hold)
    memory = BytesIO()
    indexed[0].save(
        memory,
        format="GIF",
        save_all=True,
        append_images=indexed[1:],
        duration=durations,
        loop=0,
        optimize=True,
    )
    return memory.getvalue()


def _common_palette(
    frames: Sequence[Image.Image], colours: int, rare: Sequence[str]
) -> Image.Image:
    picked = [frames[i] for i in np.linspace(0, len(frames) - 1, SAMPLES).astype(int)]
    width, height = picked[0].size
    sheet = Image.new("RGB", (width, height * len(picked) + len(rare) * SWATCH))
    for place, frame in enumerate(picked):
        sheet.paste(frame, (0, place * height))
    for place, colour in enumerate(rare):
        top = height * len(picked) + place * SWATCH
        red, green, blue, _ = (round(255 * part) for part in rgba(colour))
        sheet.paste((red, green, blue), (0, top, width, top + SWATCH))
    return sheet.quantize(colours, method=Image.Quantize.MEDIANCUT)
