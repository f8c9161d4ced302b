"""A recording that is played, without a page."""

import pytest

from sain_live.player import Chapter, Recording, RecordingPlayer, Snapshot
from sain_live.state import Level, LiveState, LogLine


def chapter(title, *times, rests):
    moments = tuple(Snapshot(t, {"why": f"{title} {t}", "lines": round(t)}) for t in times)
    return Chapter(title, moments, rests)


RECORDING = Recording(
    "mine",
    (
        chapter("one", 0.0, 1.0, 2.0, 3.0, rests=(0.0, 1.0, 3.0)),
        chapter("two", 0.0, 0.5, rests=(0.0, 0.5)),
    ),
    tuple(LogLine(float(n), Level.NOTE, f"line {n}") for n in range(3)),
)


@pytest.fixture
def played():
    state = LiveState()
    player = RecordingPlayer(state, RECORDING)
    player.play(False)
    player.seek(0.0)
    yield state, player
    player.close()


def test_a_time_shows_what_was_known_then(played):
    state, player = played
    player.seek(2.5)
    assert (state.why, player.push) == ("one 2.0", 1)
    assert [line.text for line in state.log] == ["line 0", "line 1"]
    player.seek(99.0)
    assert (state.why, player.time) == ("one 3.0", 3.0)


def test_steps_go_from_push_to_push_and_on_into_the_next_chapter_and_back(played):
    state, player = played
    seen = []
    for _ in range(5):
        player.step(forward=True)
        seen.append(state.why)
    assert seen == ["one 1.0", "one 3.0", "two 0.0", "two 0.5", "one 0.0"]
    seen.clear()
    for _ in range(5):
        player.step(forward=False)
        seen.append(state.why)
    assert seen == ["two 0.5", "two 0.0", "one 3.0", "one 1.0", "one 0.0"]


def test_playing_goes_through_all_and_stops_at_the_end():
    state, shown = LiveState(), []
    player = RecordingPlayer(state, RECORDING, speed=20.0, loop=False)
    while player.playing:
        state.changed.wait(20.0)
        state.changed.clear()
        shown.append(state.why)
    assert (shown[-1], player.time, player.chapter.title) == ("two 0.5", 0.5, "two")
    player.play(True)
    assert (player.playing, player.chapter.title) == (True, "one")
    player.close()
