"""What the marks in an episode's picture mean."""

from typing import Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sain_eval.episodes import EpisodeRecord
from sain_eval.palette import PALETTE


def draw_legend(figure: Figure, record: EpisodeRecord) -> None:
    """Draw one line of marks and their meaning along the bottom of a figure."""
    hollow = {"markerfacecolor": "none"}
    marks = [
        _mark("o", PALETTE.mid, "mid disk (pushed)", alpha=0.75),
        _mark("o", PALETTE.target, "target", alpha=0.75),
        _mark("o", PALETTE.faint, "start", **hollow),
        _mark("+", PALETTE.goal, "goal and tolerance", markersize=10, markeredgewidth=2),
        _mark("$\\rightarrow$", PALETTE.ink, "push of the tool, in order", markersize=14),
        _mark("D", PALETTE.predicted, "predicted target", markersize=6, **hollow),
    ]
    if any(push.physics is not None for push in record.pushes):
        marks.append(_mark("s", PALETTE.faint, "physics alone", markersize=8, alpha=0.6))
    figure.legend(
        handles=marks,
        loc="lower center",
        ncols=len(marks),
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
