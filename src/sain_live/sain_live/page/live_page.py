"""The page: drawn by one thread, whenever something has changed, and not faster than it may be."""

import logging
import time
from threading import Event, Thread
from typing import Any, Final, Protocol

import numpy as np
import viser

from sain_live.page.arm import ArmView
from sain_live.page.charts import ChartsView
from sain_live.page.controls import ControlsView, PlannerForm
from sain_live.page.learning import LearningView
from sain_live.page.playing import PlayingView
from sain_live.page.scene import GoalsView, SceneView
from sain_live.page.serving import open_server
from sain_live.player import RecordingPlayer
from sain_live.requests import Send
from sain_live.settings import PageConfig
from sain_live.state import Level, LiveState

WAIT: Final = 0.5  # [s] between looks where nothing changes
BEHIND: Final = 0.1  # [s] that the pace may catch up

logger = logging.getLogger(__name__)


NOTHING: Final = (
    '<div style="padding:6px 14px;font-size:12px">No camera. With one, tag_node and outline_node'
    " show here what they see.</div>"
)


class PictureView:
    """The tab of the camera, beside the charts."""

    def __init__(self, gui: viser.GuiApi) -> None:
        self._gui = gui
        self._text = gui.add_html(NOTHING)
        self._image: Any = gui.add_image(np.full((2, 2, 3), 255, np.uint8), visible=False)
        self._shown: np.ndarray | None = None

    def show(self, state: LiveState) -> None:
        """Draw what has changed."""
        picture = state.picture
        if picture is self._shown:
            return
        self._shown = picture
        self._text.visible, self._image.visible = picture is None, picture is not None
        if picture is not None:
            self._image.image = picture


class PagePart(Protocol):
    """A part of the page."""

    def show(self, state: LiveState) -> None:
        """Draw what has changed."""


class LivePage:
    """Serves the state to any number of viewers, and sends on their requests."""

    def __init__(
        self,
        state: LiveState,
        send: Send | None,
        config: PageConfig,
        player: RecordingPlayer | None = None,
    ) -> None:
        """Listen and show the state.

        Args:
            state: of the graph, or at a moment of a recording.
            send: takes what viewers ask of a graph; None: it is a recording.
            config: where it is served.
            player: of the recording.

        Raises:
            BusyError: the port is in use.
            ConfigError: this computer has no such address.
        """
        self._state, self._period = state, 1.0 / config.rate
        self._end = Event()
        self.server = server = open_server(config)
        tabs = server.gui.add_tab_group()
        controls: list[PagePart] = []
        if player is not None:
            with tabs.add_tab("Recording", viser.Icon.PLAYER_PLAY):
                controls.append(PlayingView(server, player))
        if send is not None:
            with tabs.add_tab("Run", viser.Icon.PLAYER_PLAY):
                controls.append(ControlsView(server, state, send, config))
            with tabs.add_tab("Planner", viser.Icon.ADJUSTMENTS):
                controls.append(PlannerForm(server, state, send))
        self.goals = GoalsView(server, state, send)
        charts = ChartsView(server)
        with charts.panel.add_tab("Learning", viser.Icon.SCHOOL):
            learning = LearningView(server.gui)
        with charts.panel.add_tab("Camera", viser.Icon.CAMERA):
            picture = PictureView(server.gui)
        self._views: tuple[PagePart, ...] = (
            SceneView(server),
            self.goals,
            ArmView(server),
            charts,
            learning,
            picture,
            *controls,
        )
        self.updates = 0  # sent
        self._thread = Thread(target=self._run, name="page", daemon=True)
        self._thread.start()

    @property
    def viewers(self) -> int:
        """How many browsers show the page."""
        return len(self.server.get_clients())

    def close(self) -> None:
        """Serve the page no more."""
        self._end.set()
        self._state.changed.set()
        self._thread.join()
        self.server.stop()

    def draw(self) -> None:
        """Send what has changed to all viewers, as one."""
        self._state.changed.clear()
        with self.server.atomic():
            for view in self._views:
                try:
                    view.show(self._state)
                except Exception as error:
                    logger.exception("the page could not be drawn")
                    text = f"{type(view).__name__} cannot draw: {type(error).__name__}: {error}"
                    self._state.tell(Level.FAULT, text)
        self.updates += 1

    def _run(self) -> None:
        due = time.monotonic()
        while not self._end.is_set():
            if not self._state.changed.wait(WAIT):
                continue
            due = max(due + self._period, time.monotonic() - BEHIND)
            if (early := due - time.monotonic()) > 0.0:
                time.sleep(early)
            if not self._end.is_set():
                self.draw()
