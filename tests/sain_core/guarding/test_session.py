"""The ids of episodes, scenes and pushes."""

import pytest

from sain_core.errors import (
    BusyError,
    DuplicatePushError,
    InvalidInputError,
    StaleSceneError,
    UnknownEpisodeError,
)
from sain_core.guarding import session as module
from sain_core.guarding.session import Session


@pytest.fixture
def session():
    session = Session()
    session.begin_episode()
    return session


def ids(session: Session) -> tuple[int, int]:
    return session.episode_id, session.scene_id


@pytest.mark.parametrize(
    ("push", "error", "text"),
    [
        ((0, 1, 1), InvalidInputError, "push_id is 0"),
        ((2, 7, 1), UnknownEpisodeError, "push 2 is for episode 7; episode 1 is running"),
        ((2, 1, 7), StaleSceneError, "push 2 was planned from scene 7; it is scene 1 now"),
    ],
)
def test_a_push_that_names_the_wrong_thing_is_refused(session, push, error, text):
    with pytest.raises(error, match=text):
        session.admit(*push)
    assert not session.busy


def test_an_id_works_once_also_when_it_was_refused_or_episodes_ago(session):
    assert ids(session) == (1, 1)
    session.admit(1, 1, 1)
    session.finish(executed=True)
    assert ids(session) == (1, 2)
    with pytest.raises(StaleSceneError):
        session.admit(2, 1, 1)
    session.begin_episode()
    assert ids(session) == (2, 3)
    for push_id in (1, 2):
        with pytest.raises(DuplicatePushError, match=f"push {push_id} came before"):
            session.admit(push_id, *ids(session))


def test_one_push_at_a_time(session):
    session.admit(1, 1, 1)
    with pytest.raises(BusyError, match="push 1 is under way; send push 2 anew later"):
        session.admit(2, 1, 1)
    with pytest.raises(BusyError, match="push 1 is under way; reset when it has ended"):
        session.begin_episode()
    session.finish(executed=True)
    assert not session.busy


def test_memory_is_bounded_and_what_is_forgotten_is_stale_anyway(session, monkeypatch):
    monkeypatch.setattr(module, "REMEMBERED_PUSHES", 3)
    for push_id in range(1, 6):
        session.admit(push_id, *ids(session))
        session.finish(executed=True)
    with pytest.raises(StaleSceneError):
        session.admit(1, 1, 1)
    assert len(session._seen) <= 3
