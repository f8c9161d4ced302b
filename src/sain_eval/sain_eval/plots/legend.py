"""What the marks in an episode's picture mean."""

from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sain_eval.plots.palette import PALETTE


def draw_legend(figure: Figure, physics: bool = False, columns: int | None = None) -> None:
    """Draw the marks and their meaning along the bottom of a figure.

    Args:
        figure: the figure, with room left below.
        physics: whether it shows what physics alone predicted.
        columns: marks in a row; all in one if not given.
    """
    hollow = {"markerfacecolor": "none"}
    marks = [
        _mark("o", PALETTE.mid, "mid disk (pushed)", alpha=0.75),
        _mark("o", PALETTE.target, "target", alpha=0.75),
        _mark("o", PALETTE.faint, "start", **hollow),
        _mark("+", PALETTE.goal, "goal and tolerance", markersize=10, markeredgewidth=2),
        _mark("$\\rightarrow$", PALETTE.ink, "push of the tool, in order", markersize=14),
        _mark("D", PALETTE.predicted, "predicted target", markersize=6, **hollow),
    ]
    if physics:
        marks.append(_mark("s", PALETTE.faint, "physics alone", markersize=8, alpha=0.6))
    figure.legend(
        handles=marks,
        loc="lower center",
        ncols=columns or len(marks),
        frameon=False,
        fontsize=9,
        bbox_to_anchor=(0.5, 0.005),
        columnspacing=1.8,
        handletextpad=0.5,
    )


def _mark(marker: str, colour: str, label: str, **style: Any) -> Line2D:
    return Line2D(
        [],
        [],
        linestyle="none",
        marker=marker,
        color=colour,
        label=label,
        **{"markersize": 9, **style},
    )
