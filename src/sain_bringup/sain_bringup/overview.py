"""One picture of a whole run: every episode from above, side by side."""

from collections.abc import Sequence
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sain_core.drawing.figures import TEXT, new_figure
from sain_core.drawing.palette import PALETTE
from sain_eval.plots.episode_record import EpisodeRecord
from sain_eval.plots.legend import draw_legend
from sain_eval.plots.pictures import describe_result, describe_task, result_colour
from sain_eval.plots.top_view import draw_top_view

COLUMNS: Final = 2
TILE: Final = (3.5, 3.5)  # [inch]
LEGEND: Final = 0.8  # [inch]


def draw_overview(records: Sequence[EpisodeRecord]) -> Figure:
    """Draw all episodes of a run into one figure."""
    columns = min(COLUMNS, len(records))
    rows = -(-len(records) // columns)
    figure = new_figure(columns * TILE[0], rows * TILE[1] + LEGEND)
    names: set[str] = set()
    for place, record in enumerate(records, start=1):
        axes = figure.add_subplot(rows, columns, place)
        names.update(draw_top_view(axes, record))
        axes.set_title(" \n ", fontsize=TEXT)  # space for the two lines below
        _write(
            axes,
            describe_task(record),
            17,
            fontsize=TEXT + 0.5,
            fontweight="bold",
            color=PALETTE.ink,
        )
        _write(axes, describe_result(record), 5, fontsize=TEXT, color=result_colour(record))
    draw_legend(figure, sorted(names), columns=columns + 1)
    return figure


def _write(axes: Axes, text: str, above: float, **style: Any) -> None:
    """Write a line so many points above axes, from the left edge of their labels on."""
    style |= {"xycoords": "axes fraction", "textcoords": "offset points"}
    axes.annotate(text, (0.0, 1.0), (-32, above), **style)
