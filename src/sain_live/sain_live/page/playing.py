"""The controls of a recording: episode, timeline, push, speed, and what is shown."""

import time
from html import escape
from typing import Any, Final

import viser

from sain_live.page.texts import distance_facts, fact_rows
from sain_live.player import Chapter, RecordingPlayer
from sain_live.state import LiveState

PREVIOUS, PLAY, PAUSE, NEXT = "◀ push", "Play", "Pause", "push ▶"
SPEEDS: Final = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
OFTEN: Final = 0.1  # [s], between two moves of the sliders
STEP: Final = 0.01  # [s], of the timeline


class PlayingView:
    """The tab of a recording, in place of the controls of a graph."""

    def __init__(self, server: viser.ViserServer, player: RecordingPlayer) -> None:
        self._player, gui = player, server.gui
        self._viser = server.get_event_loop()
        self._status, self._moved = "", 0.0
        self._chapter: Chapter | None = None
        self._places = [0.0, 0.0]  # where the sliders stand, of time and push, as far as is read
        self._text = gui.add_html("")
        titles = tuple(chapter.title for chapter in player.recording.chapters)
        self._title: Any = gui.add_dropdown("episode", titles)
        self._buttons = gui.add_button_group("steps", (PREVIOUS, NEXT))
        self._play = gui.add_button(PAUSE, icon=viser.Icon.PLAYER_PAUSE)
        self._time: Any = gui.add_slider("time [s]", 0.0, 1.0, STEP, 0.0)
        self._push: Any = gui.add_slider("push", 0, 1, 1, 0)
        speeds = sorted({*SPEEDS, player.speed})
        names = {f"{speed:g}": speed for speed in speeds}
        self._speed = gui.add_dropdown("speed", tuple(names), initial_value=f"{player.speed:g}")
        self._title.on_update(self._asked(player.open))
        self._time.on_update(self._slid(0, lambda value: player.seek(float(value))))
        self._push.on_update(self._slid(1, lambda value: player.seek_push(int(value))))
        self._speed.on_update(self._asked(lambda value: player.set_speed(names[value])))
        self._buttons.on_click(self._asked(lambda value: player.step(value == NEXT)))
        self._play.on_click(lambda _: player.play(not player.playing))

    def _slid(self, number: int, act: Any) -> Any:
        # Sliders are read and moved in one thread, viser's. One that is not where it was left has
        # a viewer's move that is not read yet: `_move_sliders` does not undo it.
        async def take(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                self._places[number] = event.target.value
                act(event.target.value)

        return take

    @staticmethod
    def _asked(act: Any) -> Any:
        async def take(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:  # else it was set here
                act(event.target.value)

        return take

    def show(self, state: LiveState) -> None:
        """Show what is played, and where."""
        player = self._player
        text = playing_text(player, state)
        if text != self._status:
            self._status = self._text.content = text
        label = PAUSE if player.playing else PLAY
        if self._play.label != label:
            self._play.label = label
            self._play.icon = viser.Icon.PLAYER_PAUSE if player.playing else viser.Icon.PLAYER_PLAY
        if player.chapter is not self._chapter:
            self._open(player.chapter)
        if player.playing and time.monotonic() < self._moved + OFTEN:
            return
        self._moved = time.monotonic()
        self._viser.call_soon_threadsafe(self._move_sliders)

    def _move_sliders(self) -> None:
        moment = round(self._player.time, 2), self._player.push
        for number, slider in enumerate((self._time, self._push)):
            if slider.value == self._places[number] != moment[number]:
                self._places[number] = slider.value = moment[number]

    def _open(self, chapter: Chapter) -> None:
        self._chapter, self._title.value = chapter, chapter.title
        self._time.value, self._push.value = 0.0, 0
        self._places = [0.0, 0.0]
        self._time.max = max(round(chapter.duration, 2), STEP)
        self._push.max, self._push.visible = max(chapter.pushes, 1), chapter.pushes > 0


def playing_text(player: RecordingPlayer, state: LiveState) -> str:
    """Return what is shown, as HTML."""
    chapter = player.chapter
    facts = [("recording", player.recording.name)]
    facts += [("time", f"{player.time:.1f} of {chapter.duration:.1f} s")]
    facts += [("pushes", f"{player.push} of {chapter.pushes}")]
    facts += distance_facts(state, digits=1)
    facts += [("loop", f"{state.phase}{f': {state.why}' if state.why else ''}")]
    facts += [("model", state.model), ("engine", state.engine), ("world", state.world)]
    return (
        f'<div style="padding:6px 14px;font-size:13px;line-height:1.5">'
        f'<div style="font-size:17px;font-weight:600">{escape(chapter.title)}</div>'
        f"{fact_rows(facts)}</div>"
    )
