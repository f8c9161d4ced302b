"""What the camera sees, with what was found in it."""

from typing import Any, Final

import numpy as np
import viser

from sain_live.state import LiveState

NOTHING: Final = (
    '<div style="padding:6px 14px;font-size:12px">No camera. With one, tag_node and outline_node'
    " show here what they see.</div>"
)


class PictureView:
    """The tab of the camera, beside the charts."""

    def __init__(self, gui: viser.GuiApi) -> None:
        """Make the tab's contents, in the tab that is open."""
        self._gui = gui
        self._text = gui.add_html(NOTHING)
        self._image: Any = gui.add_image(np.full((2, 2, 3), 255, np.uint8), visible=False)
        self._shown: np.ndarray | None = None

    def show(self, known: LiveState) -> None:
        """Draw what has changed."""
        picture = known.picture
        if picture is self._shown:
            return
        self._shown = picture
        self._text.visible, self._image.visible = picture is None, picture is not None
        if picture is not None:
            self._image.image = picture
