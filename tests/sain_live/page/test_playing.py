"""The controls of a recording, without a browser."""

import pytest

from sain_live.page.live_page import LivePage
from sain_live.player import RecordingPlayer
from sain_live.settings import PageConfig
from sain_live.state import LiveState
from tests.sain_live.straw import free_port
from tests.sain_live.test_player import RECORDING
from tests.sain_live.viewer import Viewer

TRIES = 40


@pytest.fixture
def played():
    known = LiveState()
    player = RecordingPlayer(known, RECORDING)
    player.play(False)
    page = LivePage(known, None, PageConfig(port=free_port(), rate=30.0), player)
    viewer = Viewer(page.server.get_port())
    viewer.wait(lambda: "pushes" in viewer.texts, "the page")
    yield known, player, viewer
    viewer.close()
    page.close()
    player.close()


def test_no_move_of_the_slider_is_lost_while_the_page_draws(played):
    known, player, viewer = played
    for number in [2, 0] * TRIES:
        known.changed.set()
        viewer.turn("push", number)
        viewer.wait(lambda number=number: player.push == number, f"push {number}", timeout=5.0)
