"""What a laboratory learns: errors and parameters against the number of pushes, and events."""

from html import escape
from typing import Final

import numpy as np
import viser
from viser import uplot

from sain_core.view.palette import PALETTE
from sain_core.wire.learning import Learned, LearnedCurve
from sain_live.page.charts import add_chart, columns, scales
from sain_live.state import LiveState

HEIGHT: Final = 170  # pixels of a chart
EVENTS: Final = 8  # that are shown
COLOURS: Final = (PALETTE.soft, PALETTE.physics, PALETTE.predicted)  # planar, physics, in service
THIN: Final = 0.7
Data = tuple[np.ndarray, ...]


class LearningView:
    """The tab of a laboratory, beside the charts."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._shown: Learned | None = None
        self._text = gui.add_html(learning_text(None))
        series = [
            uplot.Series(stroke=colour, width=width)
            for colour in COLOURS
            for width in (2, THIN, THIN)  # of a mean, and of the ends of its interval [px]
        ]
        empty = columns(*[()] * len(series))
        title = "mean error of 50 pushes, 95 % interval [mm]"
        self._errors = add_chart(gui, title, HEIGHT, empty, series)
        self._table = gui.add_html("")

    def show(self, state: LiveState) -> None:
        """Draw what has changed."""
        learned = state.learned
        if learned is None or learned is self._shown:
            return
        self._shown = learned
        self._text.content = learning_text(learned)
        self._table.content = parameter_table(learned)
        data = error_data(learned)
        # All means fit: an interval of few pushes may leave the chart.
        self._errors.data, self._errors.scales = data, scales(*map(tuple, data[1::3]))


def error_data(learned: Learned) -> Data:
    """Return numbers of pushes, and mean, low and high [mm] of each predictor there."""
    at = np.unique(np.concatenate([[0, 1], *(curve.pushes for curve in learned.errors)]))
    columns = []
    for curve in learned.errors[: len(COLOURS)]:
        rows = np.full((len(at), 3), np.nan)
        rows[np.searchsorted(at, curve.pushes)] = 1e3 * curve.values
        columns += list(rows.T)
    missing = 3 * len(COLOURS) - len(columns)
    return (at.astype(np.float64), *columns, *[np.full(len(at), np.nan)] * missing)


def learning_text(learned: Learned | None) -> str:
    """Return what the laboratory is, and its latest events, as HTML."""
    if learned is None:
        text = "No learner. Start one: <code>live --learn my_table</code>"
        return f'<div style="padding:8px 14px;font-size:12px">{text}</div>'
    events = "".join(
        f'<div style="margin:2px 0"><b>{pushes}</b> {escape(kind)}: {escape(text)}</div>'
        for pushes, kind, text in reversed(learned.events[-EVENTS:])
    )
    names = "".join(
        f'<span style="color:{colour};margin-right:10px">{escape(curve.name)}</span>'
        for colour, curve in zip(COLOURS, learned.errors, strict=False)
    )
    return (
        f'<div style="padding:8px 14px;font-size:12px;line-height:1.4"><b>'
        f"{escape(learned.laboratory)}</b>: {learned.pushes} pushes; in service:"
        f" {escape(learned.service)}<div>{names}</div>{events}</div>"
    )


def parameter_table(learned: Learned) -> str:
    """Return the parameters: now, and a bar for each interval over the first one, as HTML."""
    rows = "".join(_parameter(curve) for curve in learned.parameters if len(curve.pushes))
    return f'<table style="font-size:12px;width:100%;padding:0 14px">{rows}</table>'


def _parameter(curve: LearnedCurve) -> str:
    widths = curve.values[:, 2] - curve.values[:, 1]
    share = float(np.clip(widths[-1] / widths[0], 0.0, 1.0)) if widths[0] > 0.0 else 0.0
    value, low, high = curve.values[-1]
    bar = (
        f'<div style="height:6px;border-radius:3px;background:{PALETTE.physics};'
        f'width:{max(100 * share, 1):.0f}%"></div>'
    )
    return (
        f"<tr><td>{escape(curve.name)}</td>"
        f'<td title="{low:.3g} to {high:.3g} {escape(curve.unit)}">{value:.3g}'
        f'</td><td style="width:45%">{bar}</td></tr>'
    )
