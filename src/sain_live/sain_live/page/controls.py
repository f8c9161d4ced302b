"""The controls of a running graph: the loop, the episode, the model, and the planner's settings."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

import viser

from sain_core.config import describe_values, show_value
from sain_core.errors import ConfigError, SainError
from sain_core.model import MODELS
from sain_core.shapes.library import shape_names
from sain_core.view.palette import PALETTE
from sain_eval.scenes.scenarios import scenario_names
from sain_live.page.texts import add_caption, distance_facts, fact_rows
from sain_live.requests import (
    AS_DRAWN,
    Follow,
    Learn,
    LoadModel,
    Pause,
    Request,
    Reset,
    Send,
    SetParameter,
)
from sain_live.settings import PageConfig, planner_settings
from sain_live.state import Level, LiveState, Phase
from sain_sim.world.truth import TRUTHS

START, ONCE, PAUSE = "Start", "One push", "Pause"
FIRST: Final = "push_t"
LARGEST_SEED: Final = 2**31 - 1
AS_STARTED: Final = "as the simulator was started"
NONE_YET: Final = "none yet"
CHECKPOINTS: Final = "*.safetensors"
MOST_CHECKPOINTS: Final = 40
HINT: Final = (
    f'<div style="padding:2px 4px;font-size:12.5px;color:{PALETTE.ink}">'
    "Not started yet: press <b>Reset</b></div>"
)
COLOURS: Final = {
    Phase.PLANNING: PALETTE.predicted,
    Phase.PUSHING: PALETTE.mid,
    Phase.REACHED: PALETTE.success,
    Phase.ENDED: PALETTE.alarm,
}


class ControlsView:
    """The tab with buttons and choices."""

    def __init__(
        self, server: viser.ViserServer, state: LiveState, send: Send, config: PageConfig
    ) -> None:
        self._gui, self._state, self._send = server.gui, state, send
        self._status = ""
        self._text = self._gui.add_html("")
        self._add_buttons()
        with self._gui.add_folder("Episode"):
            self._add_episode(config)
        with self._gui.add_folder("Model"):
            self._add_model()

    def show(self, state: LiveState) -> None:
        """Show how the loop is doing, and the model that is served or on its way."""
        text = status_text(state)
        if text != self._status:
            self._status = self._text.content = text
        model = state.loading or state.model or NONE_YET
        if model not in self._model.options:
            self._model.options = (*self._models, model)
        if self._model.value != model:
            self._model.value = model
        self._learns.visible = state.learns is not None
        if state.learns is not None and self._learns.value != state.learns:
            self._learns.value = state.learns

    def _add_buttons(self) -> None:
        requests: dict[str, Request] = {START: Follow(), ONCE: Follow(most=1), PAUSE: Pause()}
        buttons = self._gui.add_button_group("loop", tuple(requests))
        buttons.on_click(lambda event: self._send(requests[event.target.value]))

    def _add_episode(self, config: PageConfig) -> None:
        gui = self._gui
        self._outlines, first = config.outlines_file, config.scenario or FIRST
        names = tuple(dict.fromkeys((*scenario_names(), first)))
        self._scenario = gui.add_dropdown("scenario", names, initial_value=first)
        self._seed: Any = gui.add_text("seed", str(config.seed))
        add_caption(gui, "number of the scene; the same one is the same scene")
        self._shape = gui.add_dropdown("shape", (AS_DRAWN, *shape_names()))
        add_caption(gui, "of the bodies, where it is free")
        self._world = gui.add_dropdown("world", (AS_STARTED, *TRUTHS))
        add_caption(gui, "true friction and contacts, hidden from the model")
        self._hint = gui.add_html("")
        reset = gui.add_button("Reset", icon=viser.Icon.REFRESH)
        reset.on_click(self._guarded(self._reset))
        following = gui.add_button("Next seed", icon=viser.Icon.PLAYER_TRACK_NEXT)
        following.on_click(self._guarded(self._next))
        for choice in (self._scenario, self._seed, self._shape, self._world):
            choice.on_update(self._on_choice)

    def _add_model(self) -> None:
        self._models = (*MODELS.names(), *checkpoints(Path("runs")))
        self._model: Any = self._gui.add_dropdown(
            "model", (*self._models, NONE_YET), initial_value=NONE_YET
        )
        text = "predicts pushes for the planner; one that cannot do so in this scene is refused"
        add_caption(self._gui, text)
        path = self._gui.add_text("or a file", "")
        add_caption(self._gui, "path of a checkpoint, where the model's node runs")
        button = self._gui.add_button("Load file", icon=viser.Icon.DOWNLOAD)
        button.on_click(self._guarded(lambda: self._load(path.value.strip())))
        self._model.on_update(self._on_model)
        self._learns: Any = self._gui.add_checkbox("learn from pushes", False, visible=False)
        self._learns.on_update(self._on_learns)

    def _on_learns(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            self._send(Learn(event.target.value))

    def _load(self, path: str) -> None:
        if not path:
            raise ConfigError("no file is named; type the path of a checkpoint")
        self._send(LoadModel(path))

    def _on_model(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None and event.target.value != NONE_YET:
            self._send(LoadModel(event.target.value))

    def _on_choice(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            self._hint.content = HINT

    def _reset(self) -> None:
        world = "" if self._world.value == AS_STARTED else self._world.value
        seed = read_seed(self._seed.value)
        name, shape = self._scenario.value, self._shape.value
        self._send(Reset.draw(name, seed, shape, world, self._outlines))
        self._hint.content = ""

    def _next(self) -> None:
        self._seed.value = str(min(read_seed(self._seed.value) + 1, LARGEST_SEED))
        self._reset()

    def _guarded(self, work: Callable[[], None]) -> Callable[[Any], None]:
        """Return a callback that tells errors in the log."""

        def call(_: Any) -> None:
            try:
                work()
            except SainError as error:
                self._state.tell(Level.REFUSAL, str(error))

        return call


def checkpoints(folder: Path) -> Sequence[str]:
    """Return the paths of checkpoints below a folder, the newest first."""
    found = sorted(folder.rglob(CHECKPOINTS), key=lambda path: -path.stat().st_mtime)
    return [str(path) for path in found[:MOST_CHECKPOINTS]]


def read_seed(text: str) -> int:
    """Return the seed that was typed. Raises `ConfigError`: it is none."""
    words = text.strip()
    if not (words.isascii() and words.isdigit()) or int(words[:20]) > LARGEST_SEED:
        raise ConfigError(f"seed is {text!r}; type a whole number from 0 to {LARGEST_SEED}")
    return int(words)


def status_text(state: LiveState) -> str:
    """Return how the loop is doing, as HTML."""
    colour = COLOURS.get(state.phase, PALETTE.soft)
    facts = [("model", state.model or "-"), ("engine", state.engine or "-")]
    facts += [("world", state.world or "-")]
    if state.scene is not None:
        facts.insert(0, ("episode", f"{state.scene.episode_id}, {state.time:.0f} s"))
    if distance := distance_facts(state):
        facts[1:1] = [*distance, ("pushes", str(state.pushes))]
    reason = state.starting or state.why
    why = f'<div style="color:{PALETTE.soft};margin:2px 0 4px">{escape(reason)}</div>'
    return (
        f'<div style="padding:6px 14px;font-size:13px;line-height:1.5">'
        f'<div style="font-size:17px;font-weight:600;color:{colour}">{state.phase}</div>'
        f"{why if reason else ''}{fact_rows(facts)}</div>"
    )


STEPS: Final = 100  # of a slider
WIDEST: Final = {float: 10.0, int: 200.0}  # range of a slider; beyond, a number is typed
OPEN: Final = "planner"
Field = dataclasses.Field[Any]


class PlannerForm:
    """The tab with the settings of the planner. A change counts from the next plan on."""

    def __init__(self, server: viser.ViserServer, state: LiveState, send: Send) -> None:
        self._state, self._send = state, send
        self._shown: Mapping[str, Any] = {}
        self._controls: dict[str, tuple[Any, Any]] = {}
        gui, folders = server.gui, {}
        for one in planner_settings():
            group = one.name.split(".")[-2]
            if group not in folders:
                folders[group] = gui.add_folder(group, expand_by_default=group == OPEN)
            with folders[group]:
                control = make_control(gui, one.item, one.value)
            self._controls[one.name] = (control, one.value)
            control.on_update(self._on_update(one.name))

    def show(self, state: LiveState) -> None:
        """Show the settings as the planner has them."""
        if state.planner is self._shown:
            return
        self._shown = state.planner
        for name, value in state.planner.items():
            if name in self._controls:
                control, default = self._controls[name]
                shown = show_value(tuple(value)) if isinstance(default, tuple) else value
                if control.value != shown:
                    control.value = shown

    def _on_update(self, name: str) -> Any:
        def take(event: viser.GuiEvent[Any]) -> None:
            if event.client is None:
                return  # it was set here
            value, default = event.target.value, self._controls[name][1]
            if isinstance(default, tuple):
                try:
                    value = read_numbers(value)
                except ValueError:
                    text = f"{name} is {value!r}; it must be numbers, as [1, 2]"
                    self._state.tell(Level.REFUSAL, text)
                    self._state.update(planner=dict(self._state.planner))  # the text goes back
                    self._shown = {}
                    return
            elif isinstance(default, bool | int | float):
                value = type(default)(value)
            self._send(SetParameter(name, value))

        return take


def make_control(gui: viser.GuiApi, item: Field, default: Any) -> Any:
    """Return a control for a setting, with its description below it."""
    unit = item.metadata.get("unit", "")
    label = item.name.replace("_", " ") + (f" [{unit}]" if unit else "")
    control = _bare_control(gui, label, item.metadata, default)
    add_caption(gui, description(item))
    return control


def description(item: Field) -> str:
    """Return what a setting means, and what is allowed."""
    about, allowed = item.metadata, describe_values(item.metadata)
    text = about.get("description", "")
    return f"{text} ({allowed})" if allowed and not about.get("choices") else text


def _bare_control(gui: viser.GuiApi, label: str, about: Mapping[str, Any], default: Any) -> Any:
    """Return slider, number, choice, box to tick or text."""
    if choices := about.get("choices"):
        return gui.add_dropdown(label, tuple(map(str, choices)), initial_value=str(default))
    if isinstance(default, bool):
        return gui.add_checkbox(label, default)
    if isinstance(default, str | tuple):
        return gui.add_text(label, show_value(default) if isinstance(default, tuple) else default)
    low, high, kind = about.get("minimum"), about.get("maximum"), type(default)
    if low is not None and high is not None and high - low <= WIDEST[kind]:
        step = kind(1) if kind is int else (high - low) / STEPS
        return gui.add_slider(label, kind(low), kind(high), step, default)
    limits = {"min": low, "max": high}
    given = {name: kind(value) for name, value in limits.items() if value is not None}
    return gui.add_number(label, default, step=1 if kind is int else None, **given)


def read_numbers(text: str) -> list[float]:
    """Return the numbers of a text such as ``[1, 2]``; raises `ValueError`."""
    return [float(word) for word in text.strip().strip("[]()").replace(",", " ").split()]
