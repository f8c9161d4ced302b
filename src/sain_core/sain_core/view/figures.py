"""Figures with one look, written as PNG files that are whole or absent."""

from io import BytesIO
from pathlib import Path
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sain_core.output import write_whole
from sain_core.view.palette import PALETTE

DOTS_PER_INCH: Final = 160
TEXT: Final = 9.5  # [pt]: 8 px on a phone of 390 px for a figure that is 6.5 inches wide


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of this size [inch]."""
    figure = Figure(figsize=(width, height), facecolor=PALETTE.paper, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def style_axes(axes: Axes, title: str = "", grid: str | None = "y", **labels: Any) -> None:
    """Give axes the common look, a title, ``xlabel`` and ``ylabel``; grid is x, y, both or None."""
    axes.set_title(title, fontsize=TEXT + 1, loc="left", color=PALETTE.ink)
    axes.set(**labels)
    for axis in (axes.xaxis, axes.yaxis):
        axis.label.set(fontsize=TEXT, color=PALETTE.ink)
    axes.tick_params(which="both", labelsize=TEXT - 0.5, colors=PALETTE.soft, length=2.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(PALETTE.other)
    if grid:
        axes.grid(axis=grid, alpha=0.25)  # type: ignore[arg-type]
        axes.set_axisbelow(True)


def write_png(figure: Figure, path: Path) -> Path:
    """Write a figure as a PNG and return its path. The same figure gives the same bytes."""
    return write_whole(path, png_of(figure))


def png_of(figure: Figure) -> bytes:
    """Return a figure as a PNG. The same figure gives the same bytes."""
    memory = BytesIO()
    figure.savefig(memory, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return memory.getvalue()
