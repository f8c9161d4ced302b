"""Charts of the episode, the log, and a legend."""

import math
from html import escape
from typing import Any, Final

import numpy as np
import viser
from viser import uplot

from sain_core.view.palette import PALETTE, cost_colour
from sain_live.state import Level, LiveCurves, LiveState, LogLine

FONT: Final = "11px sans-serif"
WHOLE: Final = (1, 2, 5, 10, 20, 50, 100, 200)  # between two ticks: pushes are counted
LINES: Final = 14  # of the log that are shown
HEIGHT: Final = 110  # pixels of a chart
WIDTH: Final = 330  # pixels of the panel
NUMBERS: Final = 58  # pixels, for the numbers beside a chart: 200,000 fits
HEADROOM: Final = 1.08  # top of a chart over its largest value
COLOURS: Final = {
    Level.NOTE: PALETTE.soft,
    Level.REFUSAL: PALETTE.alarm,
    Level.FAULT: PALETTE.alarm,
}
LOG: Final = "padding:6px 14px;font-size:12px;line-height:1.35;overflow-wrap:anywhere"
LEGEND: Final = (
    (PALETTE.predicted, "what the model predicted"),
    (PALETTE.physics, "what physics without learning predicted"),
    (PALETTE.ink, "next push"),
    (cost_colour(0.5), "other pushes that were tried: green is cheap"),
    (PALETTE.region, "where a body should be after the push"),
    (PALETTE.goal, "goal"),
)


class ChartsView:
    """Draws three charts and the log, in a panel of their own."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._drawn: LiveCurves | None = None
        self._lines = -1
        panel = server.gui.add_panel()
        gui = server.gui
        with panel.add_tab("Charts", viser.Icon.CHART_LINE):
            self._distance = push_chart(gui, "distance to the goal after each push [mm]", 1)
            self._errors = push_chart(gui, "error of the predicted push [mm]", 2)
            self._planning = push_chart(gui, "planning time of each push [ms]", 1)
            gui.add_html(legend())
            self._log = gui.add_html("")
        self.panel = panel
        panel.dock_left()
        panel.set_width(WIDTH)

    def show(self, state: LiveState) -> None:
        """Draw what has changed."""
        if state.curves is not self._drawn:
            self._drawn = curves = state.curves
            draw(self._distance, curves.distance)
            draw(self._errors, curves.planned, curves.physics)
            draw(self._planning, curves.planning)
        if state.lines != self._lines:
            self._lines = state.lines
            self._log.content = log_text(list(state.log)[-LINES:])


def push_chart(gui: viser.GuiApi, title: str, curves: int) -> Any:
    """Return an empty chart of curves against the number of pushes in an episode."""
    series = [
        uplot.Series(stroke=stroke, width=2, points={"show": True, "size": 5})
        for stroke in (PALETTE.predicted, PALETTE.physics)[:curves]
    ]
    return add_chart(gui, title, HEIGHT, columns(*[()] * curves), series, WHOLE)


def add_chart(
    gui: viser.GuiApi,
    title: str,
    height: int,
    data: tuple[np.ndarray, ...],
    series: list[uplot.Series],
    step: tuple[int, ...] | None = None,
) -> Any:
    """Return a chart of series against pushes, of a height [px]; steps of its ticks."""
    return gui.add_uplot(
        data,
        (uplot.Series(label="push"), *series),
        title=title,
        height=height,
        scales=scales(),
        legend={"show": False},
        axes=(
            {"size": 26, "font": FONT, **({"incrs": step} if step else {})},
            {"size": NUMBERS, "font": FONT, "space": 16},
        ),
        cursor={"show": False},
    )


def draw(chart: Any, *curves: tuple[float, ...]) -> None:
    """Show curves in a chart."""
    chart.data = columns(*curves)
    if chart.scales != scales(*curves):
        chart.scales = scales(*curves)


def scales(*curves: tuple[float, ...]) -> dict[str, uplot.Scale]:
    """Return scales from 0 that hold all of some curves: by itself uPlot fails at a NaN."""
    values = [value for curve in curves for value in curve if math.isfinite(value)]
    top = HEADROOM * (max(values, default=0.0) or 1.0)
    return {"x": {"time": False}, "y": {"range": (0.0, top)}}


def columns(*curves: tuple[float, ...]) -> tuple[np.ndarray, ...]:
    """Return numbers of pushes, from 0 and at least to 1, and the curves at each."""
    count = max(2, *map(len, curves))
    filled = [np.array([*curve, *[np.nan] * (count - len(curve))]) for curve in curves]
    return (np.arange(float(count)), *filled)


def log_text(lines: list[LogLine]) -> str:
    """Return lines of the log as HTML, the newest first. Texts come from anywhere: all escaped."""
    rows = "".join(
        f'<div style="margin:2px 0;color:{COLOURS[line.kind]}">'
        f'<span style="opacity:.6">{line.time:.1f} s</span> '
        f"{'' if line.kind is Level.NOTE else f'<b>{line.kind}</b> '}{escape(line.text)}</div>"
        for line in reversed(lines)
    )
    return f'<div style="{LOG}">{rows or "-"}</div>'


def legend() -> str:
    """Return what the colours mean, as HTML."""
    rows = "".join(
        f'<div style="margin:2px 0"><span style="display:inline-block;width:22px;height:4px;'
        f'border-radius:2px;margin-right:8px;vertical-align:middle;background:{colour}"></span>'
        f"{escape(text)}</div>"
        for colour, text in LEGEND
    )
    return f'<div style="padding:8px 14px;font-size:12px">{rows}</div>'
