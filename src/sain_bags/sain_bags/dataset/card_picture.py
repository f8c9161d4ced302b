"""The picture of a data set's card: how its quantities are spread."""

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from sain_bags.dataset.dataset_folder import CARD_FILE, PICTURE_FILE
from sain_core.storage import write_whole

COLUMNS: Final = 4
COLOUR: Final = "#3b6fb5"


def draw_card(folder: Path) -> Path:
    """Write the picture of a data set's card beside it, and return its path.

    Raises:
        OutputError: the folder cannot be written.
    """
    card = json.loads((folder / CARD_FILE).read_text(encoding="utf-8"))
    content = io.BytesIO()
    histograms(card["ranges"]).savefig(content, dpi=100, format="png")
    return write_whole(folder / PICTURE_FILE, content.getvalue())


def histograms(ranges: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Return a figure with one histogram for each quantity of a card's ``ranges``."""
    rows = -(-len(ranges) // COLUMNS)
    figure = Figure(figsize=(3 * COLUMNS, 2.2 * rows), layout="constrained")
    axes = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for one, (name, spread) in zip(axes, ranges.items(), strict=False):
        histogram = spread["histogram"]
        edges = np.linspace(histogram["from"], histogram["to"], len(histogram["counts"]) + 1)
        one.stairs(histogram["counts"], edges, fill=True, color=COLOUR)
        outside = f", {histogram['outside']} outside" if histogram["outside"] else ""
        one.set(title=name.replace("_", " "), xlabel=f"[{spread['unit']}]{outside}")
        one.spines[["top", "right"]].set_visible(False)
    for one in axes[len(ranges) :]:
        one.set_axis_off()
    return figure
