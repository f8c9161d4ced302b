"""The picture of a data set's card: a histogram of each quantity."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from sain_bags.dataset.dataset_folder import CARD_FILE, PICTURE_FILE
from sain_core.drawing.figures import TEXT, new_figure, style_axes, write_png
from sain_core.drawing.palette import PALETTE
from sain_core.untrusted import read_json

COLUMNS: Final = 3


def draw_card(folder: Path) -> Path:
    """Write the picture of a data set's card beside it, and return its path.

    Raises:
        OutputError: the folder cannot be written.
    """
    card = read_json(folder / CARD_FILE)
    return write_png(histograms(card["ranges"]), folder / PICTURE_FILE)


def histograms(ranges: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Return a figure with one histogram for each quantity of a card's ``ranges``."""
    rows = -(-len(ranges) // COLUMNS)
    figure = new_figure(2.2 * COLUMNS, 1.9 * rows)
    axes = figure.subplots(rows, COLUMNS, squeeze=False)
    for one, (name, spread) in zip(axes.ravel(), ranges.items(), strict=False):
        histogram = spread["histogram"]
        edges = np.linspace(histogram["from"], histogram["to"], len(histogram["counts"]) + 1)
        one.stairs(histogram["counts"], edges, fill=True, color=PALETTE.mid)
        outside = f", {histogram['outside']} outside" if histogram["outside"] else ""
        style_axes(one, name.replace("_", " "), xlabel=f"[{spread['unit']}]{outside}")
    for one in axes[:, 0]:
        one.set_ylabel("transitions", fontsize=TEXT)
    for one in axes.ravel()[len(ranges) :]:
        one.remove()
    return figure
