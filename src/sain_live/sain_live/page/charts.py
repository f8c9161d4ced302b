"""Charts of the episode, the log, and a legend."""

from html import escape
from typing import Any, Final

import numpy as np
import viser
from viser import uplot

from sain_core.drawing.palette import PALETTE
from sain_live.state import Kind, LiveCurves, LiveState, LogLine

FONT: Final = "11px sans-serif"
WHOLE: Final = (1, 2, 5, 10, 20, 50, 100, 200)  # between two ticks: pushes are counted
LINES: Final = 14  # of the log that are shown
HEIGHT: Final = 96  # pixels of a chart
WIDTH: Final = 330  # pixels of the panel
EMPTY: Final = (np.array([0.0]), np.array([np.nan]))
COLOURS: Final = {Kind.NOTE: PALETTE.soft, Kind.REFUSAL: PALETTE.alarm, Kind.FAULT: PALETTE.alarm}
LEGEND: Final = (
    (PALETTE.goal, "goal, to be dragged by its handle"),
    ("#268c55", "tried sequences: cheap"),
    ("#e2b0a8", "tried sequences: dear"),
    (PALETTE.ink, "chosen sequence; result of the last push"),
    (PALETTE.predicted, "prediction of the planner's model"),
    (PALETTE.physics, "prediction of nominal physics"),
    ("#dea820", "region that should hold a body"),
)


class ChartsView:
    """Draws three charts and the log, in a panel of their own."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Make the panel."""
        self._drawn: LiveCurves | None = None
        self._lines = -1
        panel = server.gui.add_panel()
        gui = server.gui
        with panel.add_tab("Charts", viser.Icon.CHART_LINE):
            self._distance = self._chart(gui, "distance to the goal [mm]", ("distance",))
            self._errors = self._chart(gui, "prediction error [mm]", ("SAIN", "physics"))
            self._planning = self._chart(gui, "planning time [ms]", ("time",))
            self._log = gui.add_html("")
        with panel.add_tab("Legend", viser.Icon.LIST):
            gui.add_html(legend())
        panel.dock_left()
        panel.set_width(WIDTH)

    @staticmethod
    def _chart(gui: viser.GuiApi, title: str, names: tuple[str, ...]) -> Any:
        strokes = (PALETTE.predicted, PALETTE.physics)
        series = [uplot.Series(label="push")]
        series += [
            uplot.Series(label=name, stroke=stroke, width=2, points={"show": True, "size": 5})
            for name, stroke in zip(names, strokes, strict=False)
        ]
        return gui.add_uplot(
            (EMPTY[0], *[EMPTY[1]] * len(names)),
            tuple(series),
            title=title,
            height=HEIGHT,
            scales={"x": {"time": False}},
            legend={"show": False},
            axes=(
                {"size": 26, "font": FONT, "incrs": WHOLE},
                {"size": 46, "font": FONT},
            ),
            cursor={"show": False},
        )

    def show(self, known: LiveState) -> None:
        """Draw what has changed."""
        if known.curves is not self._drawn:
            self._drawn = curves = known.curves
            self._distance.data = columns(curves.distance)
            self._errors.data = columns(curves.planned, curves.physics)
            self._planning.data = columns(curves.planning)
        if known.lines != self._lines:
            self._lines = known.lines
            self._log.content = log_text(list(known.log)[-LINES:])


def columns(*curves: tuple[float, ...]) -> tuple[np.ndarray, ...]:
    """Return the numbers of pushes from 1, and the curves at each."""
    count = max(map(len, curves))
    if not count:
        return (EMPTY[0], *[EMPTY[1]] * len(curves))
    filled = [np.array([*curve, *[np.nan] * (count - len(curve))]) for curve in curves]
    return (np.arange(1.0, count + 1.0), *filled)


def log_text(lines: list[LogLine]) -> str:
    """Return lines of the log as HTML, the newest first. Texts come from anywhere: all escaped."""
    rows = "".join(
        f'<div style="margin:2px 0;color:{COLOURS[line.kind]}">'
        f'<span style="opacity:.6">{line.time:.1f} s</span> '
        f"{'' if line.kind is Kind.NOTE else f'<b>{line.kind}</b> '}{escape(line.text)}</div>"
        for line in reversed(lines)
    )
    return f'<div style="padding:6px 14px;font-size:12px;line-height:1.35">{rows or "-"}</div>'


def legend() -> str:
    """Return what the colours mean, as HTML."""
    rows = "".join(
        f'<div style="margin:5px 0"><span style="display:inline-block;width:22px;height:4px;'
        f'border-radius:2px;margin-right:8px;vertical-align:middle;background:{colour}"></span>'
        f"{escape(text)}</div>"
        for colour, text in LEGEND
    )
    return f'<div style="padding:8px 14px;font-size:12.5px">{rows}</div>'
