"""Pictures on disk: whole or not at all."""

import io
from pathlib import Path

from matplotlib.figure import Figure

from sain_core.storage import write_whole


def write_png(path: Path, figure: Figure, dots_per_inch: int = 130) -> None:
    """Write a figure as a PNG.

    Raises:
        OutputError: the folder cannot be written.
    """
    content = io.BytesIO()
    figure.savefig(content, dpi=dots_per_inch, format="png")
    write_whole(path, content.getvalue())
