"""The controls: start and stop, episodes, models, and how the loop is doing."""

from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

import viser

from sain_core.drawing.palette import PALETTE
from sain_core.errors import SainError
from sain_core.plugins import dynamics_names
from sain_core.shapes.registry import footprint_names
from sain_eval.scenes.scenarios import scenario_names
from sain_live.orders import AS_DRAWN, Orders, Reset
from sain_live.settings import PageConfig
from sain_live.state import Kind, LiveState, Phase
from sain_sim.episodes.start import WORLDS

START, ONCE, PAUSE = "Start", "One push", "Pause"
FIRST: Final = "push_t"
LARGEST_SEED: Final = 2**31 - 1
AS_STARTED: Final = "as the simulator was started"
CHECKPOINTS: Final = "*.safetensors"
MOST_CHECKPOINTS: Final = 40
COLOURS: Final = {
    Phase.PLANNING: PALETTE.predicted,
    Phase.PUSHING: PALETTE.mid,
    Phase.REACHED: PALETTE.success,
    Phase.ENDED: PALETTE.alarm,
}


class ControlsView:
    """The tab with buttons and choices."""

    def __init__(
        self, server: viser.ViserServer, known: LiveState, orders: Orders, config: PageConfig
    ) -> None:
        """Make the controls."""
        self._gui, self._known, self._orders = server.gui, known, orders
        self._status = ""
        self._text = self._gui.add_html("")
        self._add_buttons()
        with self._gui.add_folder("Episode"):
            self._add_episode(config)
        with self._gui.add_folder("Model", expand_by_default=False):
            self._add_model()

    def show(self, known: LiveState) -> None:
        """Show how the loop is doing."""
        text = status_text(known)
        if text != self._status:
            self._status = self._text.content = text

    def _add_buttons(self) -> None:
        orders = {
            START: self._orders.start,
            ONCE: self._orders.push_once,
            PAUSE: self._orders.pause,
        }
        buttons = self._gui.add_button_group("loop", tuple(orders))
        buttons.on_click(lambda event: orders[event.target.value]())

    def _add_episode(self, config: PageConfig) -> None:
        gui = self._gui
        self._scenario = gui.add_dropdown(
            "scenario", scenario_names(), initial_value=config.scenario or FIRST
        )
        self._seed: Any = gui.add_number("seed", config.seed, min=0, max=LARGEST_SEED, step=1)
        self._shape = gui.add_dropdown(
            "shape", (AS_DRAWN, *footprint_names()), hint="of the bodies, where it is free"
        )
        self._world = gui.add_dropdown(
            "world", (AS_STARTED, *WORLDS), hint="hidden truth about friction and contacts"
        )
        reset = gui.add_button("Reset", icon=viser.Icon.REFRESH, hint="start this episode")
        reset.on_click(self._guarded(self._reset))
        following = gui.add_button("Next seed", icon=viser.Icon.PLAYER_TRACK_NEXT)
        following.on_click(self._guarded(self._next))

    def _add_model(self) -> None:
        names = (*dynamics_names(), *checkpoints(Path("runs")))
        choice = self._gui.add_dropdown("known", names)
        path = self._gui.add_text(
            "or a path", "", hint="of a checkpoint, as the model's node has it"
        )
        button = self._gui.add_button("Load", icon=viser.Icon.DOWNLOAD)
        button.on_click(
            self._guarded(lambda: self._orders.load(path.value.strip() or choice.value))
        )

    def _reset(self) -> None:
        world = "" if self._world.value == AS_STARTED else self._world.value
        seed = int(self._seed.value)
        self._orders.reset(Reset(self._scenario.value, seed, self._shape.value, world))

    def _next(self) -> None:
        self._seed.value = min(int(self._seed.value) + 1, LARGEST_SEED)
        self._reset()

    def _guarded(self, work: Callable[[], None]) -> Callable[[Any], None]:
        """Return a callback that tells errors in the log."""

        def call(_: Any) -> None:
            try:
                work()
            except SainError as error:
                self._known.tell(Kind.REFUSAL, str(error))

        return call


def checkpoints(folder: Path) -> Sequence[str]:
    """Return the paths of checkpoints below a folder, the newest first."""
    found = sorted(folder.rglob(CHECKPOINTS), key=lambda path: -path.stat().st_mtime)
    return [str(path) for path in found[:MOST_CHECKPOINTS]]


def status_text(known: LiveState) -> str:
    """Return how the loop is doing, as HTML."""
    colour = COLOURS.get(known.phase, PALETTE.soft)
    facts = [("model", known.model or "-"), ("engine", known.engine or "-")]
    facts += [("world", known.world or "-")]
    if known.scene is not None:
        facts.insert(0, ("episode", f"{known.scene.episode_id}, {known.scene.time:.0f} s"))
    if known.aim is not None and known.scene is not None and known.bodies is not None:
        away = distance_text(known)
        if away:
            facts.insert(1, ("to the goal", away))
            facts.insert(2, ("pushes", str(known.pushes)))
    rows = "".join(
        f'<div style="display:flex"><span style="width:86px;color:{PALETTE.soft}">{name}</span>'
        f'<span style="overflow-wrap:anywhere">{escape(value)}</span></div>'
        for name, value in facts
    )
    why = f'<div style="color:{PALETTE.soft};margin:2px 0 4px">{escape(known.why)}</div>'
    return (
        f'<div style="padding:6px 14px;font-size:13px;line-height:1.5">'
        f'<div style="font-size:17px;font-weight:600;color:{colour}">{known.phase}</div>'
        f"{why if known.why else ''}{rows}</div>"
    )


def distance_text(known: LiveState) -> str:
    """Return how far the bodies are from the goal; "": the goal is of another scene."""
    assert known.aim is not None and known.scene is not None and known.bodies is not None
    count = min(len(known.scene.disks), len(known.bodies))
    if any(pose.body >= count for pose in known.aim.poses):
        return ""
    apart, turn = known.aim.errors(known.scene.disks, known.bodies)
    turns = any(pose.heading is not None for pose in known.aim.poses)
    return f"{1e3 * apart:.0f} mm" + (f", {57.29578 * turn:.0f}°" if turns else "")
