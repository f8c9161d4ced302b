"""One picture of a whole run: every episode from above, side by side."""

from collections.abc import Sequence

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sain_eval.plots.episode_record import EpisodeRecord
from sain_eval.plots.legend import draw_legend
from sain_eval.plots.pictures import describe_result
from sain_eval.plots.top_view import PALETTE, draw_top_view

COLUMNS = 2
TILE = (6.2, 5.4)  # [inch]
LEGEND = 0.45  # [inch]


def draw_overview(records: Sequence[EpisodeRecord]) -> Figure:
    """Draw all episodes of a run into one figure."""
    columns = min(COLUMNS, len(records))
    rows = -(-len(records) // columns)
    figure = Figure(figsize=(columns * TILE[0], rows * TILE[1]), facecolor=PALETTE.paper)
    FigureCanvasAgg(figure)
    for place, record in enumerate(records, start=1):
        axes = figure.add_subplot(rows, columns, place)
        draw_top_view(axes, record)
        axes.set_title(
            f"{record.title}: {describe_result(record)}", fontsize=10, color=PALETTE.ink, pad=8
        )
    draw_legend(figure, columns=3 * columns)
    figure.tight_layout(rect=(0.0, LEGEND / figure.get_figheight(), 1.0, 1.0))
    return figure
