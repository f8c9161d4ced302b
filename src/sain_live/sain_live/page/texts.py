"""Small texts of the page, as HTML."""

from collections.abc import Iterable
from html import escape
from math import degrees

import viser

from sain_core.view.palette import PALETTE
from sain_live.state import LiveState


def add_caption(gui: viser.GuiApi, text: str) -> None:
    """Describe the control above: a phone shows no text that comes when a pointer rests."""
    style = f"padding:0 12px 8px;font-size:11.5px;line-height:1.3;color:{PALETTE.soft}"
    gui.add_html(f'<div style="{style}">{escape(text)}</div>')


def fact_rows(facts: Iterable[tuple[str, str]]) -> str:
    """Return names and values, one row each, without empty values."""
    return "".join(
        f'<div style="display:flex"><span style="width:86px;flex:none;color:{PALETTE.soft}">{name}'
        f'</span><span style="overflow-wrap:anywhere">{escape(value)}</span></div>'
        for name, value in facts
        if value
    )


def distance_facts(state: LiveState, digits: int = 0) -> list[tuple[str, str]]:
    """Return how far the bodies are from the goal, and the tolerance; nothing without a goal."""
    judged = None if state.scene is None else state.judge(state.scene.disks)
    if judged is None:
        return []
    left = f"{1e3 * judged.distance:.{digits}f} mm"
    allowed = f"{1e3 * judged.goal.tolerance:g} mm"
    if judged.goal.has_heading:
        left += f", {degrees(judged.turn):.{digits}f}°"
        allowed += f", {degrees(judged.goal.heading_tolerance):.{digits}f}°"
    return [("distance left", left), ("tolerance", allowed)]
