"""What the marks in pictures mean, in one order: that of the report page."""

from collections.abc import Sequence
from typing import Any, Final

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sain_core.drawing.figures import TEXT
from sain_core.drawing.palette import PALETTE
from sain_eval.plots.body_marks import BODY_COLOURS

HOLLOW: Final = {"markerfacecolor": "none"}
EDGE: Final = {"markeredgecolor": PALETTE.reach_edge}
MARKS: Final[dict[str, tuple[str, str, dict[str, Any]]]] = {  # marker, colour, style
    "table": ("s", PALETTE.table, {"markeredgecolor": PALETTE.table_edge}),
    "reachable area": ("s", PALETTE.reach, EDGE),
    **{f"body {body}": ("s", colour, {"alpha": 0.75}) for body, colour in enumerate(BODY_COLOURS)},
    "other body": ("s", PALETTE.other, {"alpha": 0.75}),
    "start": ("o", PALETTE.soft, HOLLOW),
    "goal and tolerance": ("+", PALETTE.goal, {"markersize": 10, "markeredgewidth": 2}),
    "push": ("$\\rightarrow$", PALETTE.ink, {"markersize": 14}),
    "predicted by physics": ("s", PALETTE.physics, {}),
    "predicted by the planner": ("D", PALETTE.predicted, {"markersize": 6} | HOLLOW),
    "90 % region": ("o", PALETTE.predicted, HOLLOW),
    "other sequence, cheapest": ("_", PALETTE.goal, {"markersize": 14}),
    "other sequence, dearest": ("_", PALETTE.alarm, {"markersize": 14}),
}


def draw_legend(figure: Figure, names: Sequence[str], columns: int) -> None:
    """Draw those of `MARKS` along the bottom of a figure with constrained layout, in columns."""
    handles = []
    for name, (marker, colour, style) in MARKS.items():
        if name in names:
            look: dict[str, Any] = {"linestyle": "none", "markersize": 9} | style
            handles.append(Line2D([], [], marker=marker, color=colour, label=name, **look))
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=columns,
        frameon=False,
        fontsize=TEXT,
        columnspacing=1.8,
        handletextpad=0.5,
    )
