"""A control for each setting of the planner, made from its dataclasses."""

from collections.abc import Mapping
from typing import Any, Final

import viser

from sain_core.config import describe_values, show_value
from sain_live.orders import Field, Orders, planner_settings
from sain_live.state import Level, LiveState

STEPS: Final = 100  # of a slider
WIDEST: Final = {float: 10.0, int: 200.0}  # range of a slider; beyond, a number is typed
OPEN: Final = "planner"


class PlannerForm:
    """The tab with the settings of the planner. A change counts from the next plan on."""

    def __init__(self, server: viser.ViserServer, known: LiveState, orders: Orders) -> None:
        """Make the controls, with the defaults."""
        self._known, self._orders = known, orders
        self._shown: Mapping[str, Any] = {}
        self._controls: dict[str, tuple[Any, Any]] = {}
        gui, folders = server.gui, {}
        for group, name, item, default in planner_settings():
            if group not in folders:
                folders[group] = gui.add_folder(group, expand_by_default=group == OPEN)
            with folders[group]:
                control = make_control(gui, item, default)
            self._controls[name] = (control, default)
            control.on_update(self._on_update(name))

    def show(self, known: LiveState) -> None:
        """Show the settings as the planner has them."""
        if known.planner is self._shown:
            return
        self._shown = known.planner
        for name, value in known.planner.items():
            if name in self._controls:
                control, default = self._controls[name]
                shown = show_value(tuple(value)) if isinstance(default, tuple) else value
                if control.value != shown:
                    control.value = shown

    def control(self, name: str) -> Any:
        """Return the control of a parameter."""
        return self._controls[name][0]

    def _on_update(self, name: str) -> Any:
        def take(event: viser.GuiEvent[Any]) -> None:
            if event.client is None:
                return  # it was set here
            value, default = event.target.value, self._controls[name][1]
            if isinstance(default, tuple):
                try:
                    value = read_numbers(value)
                except ValueError:
                    self._known.tell(
                        Level.REFUSAL, f"{name} is {value!r}; it must be numbers, as [1, 2]"
                    )
                    self._known.update(planner=dict(self._known.planner))
                    self._shown = {}
                    return
            elif isinstance(default, bool | int | float):
                value = type(default)(value)
            self._orders.set(name, value)

        return take


def make_control(gui: viser.GuiApi, item: Field, default: Any) -> Any:
    """Return a control for a setting: slider, number, choice, box to tick or text."""
    about = item.metadata
    unit, allowed = about.get("unit", ""), describe_values(about)
    label = item.name.replace("_", " ") + (f" [{unit}]" if unit else "")
    text = about.get("description", "")
    hint = f"{text}{f' ({allowed})' if allowed and not about.get('choices') else ''}"
    if choices := about.get("choices"):
        return gui.add_dropdown(
            label, tuple(map(str, choices)), initial_value=str(default), hint=hint
        )
    if isinstance(default, bool):
        return gui.add_checkbox(label, default, hint=hint)
    if isinstance(default, str | tuple):
        shown = show_value(default) if isinstance(default, tuple) else default
        return gui.add_text(label, shown, hint=hint)
    low, high, kind = about.get("minimum"), about.get("maximum"), type(default)
    if low is not None and high is not None and high - low <= WIDEST[kind]:
        step = kind(1) if kind is int else (high - low) / STEPS
        return gui.add_slider(label, kind(low), kind(high), step, default, hint=hint)
    limits = {
        name: kind(value) for name, value in (("min", low), ("max", high)) if value is not None
    }
    return gui.add_number(label, default, step=1 if kind is int else None, hint=hint, **limits)


def read_numbers(text: str) -> list[float]:
    """Return the numbers of a text such as ``[1, 2]``; raises `ValueError`."""
    return [float(word) for word in text.strip().strip("[]()").replace(",", " ").split()]
