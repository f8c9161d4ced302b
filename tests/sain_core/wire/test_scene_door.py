"""The scene that a robot may be moved by: the latest good one, and no bad one ever."""

from contextlib import suppress
from types import SimpleNamespace as Message
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sain_core import wire
from sain_core.errors import InvalidInputError, StaleSceneError
from sain_core.scene import STATE_NAMES
from sain_core.shapes.bodies import Bodies
from sain_core.wire.scene_door import ANEW, MOVED, OLD, SceneDoor

TWO = Bodies.named(["t:flat", "disk:flat"], ["pushable", "movable"])
GOOD = {"x": 0.5, "y": 0.0, "theta": 0.3, "mass": 1.0, "radius": 0.08}


def body(**values: Any) -> Message:
    return Message(**(dict.fromkeys(STATE_NAMES, 0.0) | GOOD | values))


def scene(
    *bodies: Message, stamp: float = 100.0, ids: tuple[int, int] = (1, 1), frame: str = "world",
    settled: bool = True,
) -> Message:  # fmt: skip
    sec, rest = divmod(round(stamp * 1e9), 10**9)
    header = Message(frame_id=frame, stamp=Message(sec=sec, nanosec=rest))
    disks = list(bodies) or [body(), body(x=0.7)]
    return Message(header=header, episode_id=ids[0], scene_id=ids[1], settled=settled, disks=disks)


def impossible() -> Message:
    message = scene()
    message.header.stamp.nanosec = 2 * 10**9
    return message


EMPTY = scene()
EMPTY.disks = []
BAD = {
    "empty": (EMPTY, "scene has 0 disks; it needs at least 1"),
    **{
        f"{name} {value}": (scene(body(), body(**{name: value})), f"{name} of (disk|body) 1 is")
        for name in STATE_NAMES
        for value in (np.nan, np.inf, -np.inf, 1e300)
    },
    "radius 0": (scene(body(), body(radius=0.0)), "radius of body 1 is 0 m; allowed: 0.001 to 0.5"),
    "mass 0": (scene(body(mass=0.0), body()), "mass of body 0 is 0 kg; allowed"),
    "heading in degrees": (scene(body(theta=90.0), body()), "theta of body 0 .* like degrees"),
    "too many": (scene(body(), body(), body()), "it has 3 bodies; episode 1 has 2"),
    "too few": (scene(body()), "it has 1 bodies; episode 1 has 2"),
    "frame": (scene(frame="camera"), "in frame 'camera'; it must be in 'world'"),
    "impossible stamp": (impossible(), "the stamp of the scene is 100 s and 2000000000 ns"),
    "older stamp": (scene(stamp=99.9), "its stamp is 0.100 s before that of the last scene"),
    "future stamp": (scene(stamp=105.0), "its stamp is 5.0 s in the future; is use_sim_time"),
    "older scene": (scene(ids=(1, 0)), "scene 0 of episode 1, and came after scene 1"),
    "older episode": (scene(ids=(0, 9)), "scene 9 of episode 0, and came after scene 1 of"),
}  # fmt: skip


@pytest.mark.parametrize(("message", "text"), BAD.values(), ids=BAD)
def test_a_bad_scene_is_refused_with_what_is_wrong_and_the_good_one_stays(message, text):
    door = SceneDoor()
    door.state_bodies(TWO, 1, 10.0)
    good = door.take(scene(), 10.0, 100.0)
    with pytest.raises(InvalidInputError, match=text):
        door.take(message, 10.0, 100.0)
    assert door.seen is good
    with pytest.raises(StaleSceneError, match=f"the latest scene was refused: .*{text}"):
        door.check_push(10.0, 100.0)
    with pytest.raises(StaleSceneError, match="the latest scene was refused"):
        door.check_stroke(good, 10.0, 100.0)
    door.take(scene(stamp=100.1), 10.1, 100.1)
    door.check_push(10.1, 100.1)


def test_a_scene_that_is_old_or_not_settled_moves_nothing():
    door = SceneDoor()
    with pytest.raises(StaleSceneError, match="no scene came yet"):
        door.check_push(10.0, 100.0)
    good = door.take(scene(), 10.0, 100.0)
    door.check_push(10.0 + OLD, 100.0 + OLD)
    for now, clock in ((10.6, 100.0), (10.0, 100.6)):  # none came; what came is old
        with pytest.raises(StaleSceneError, match=r"is old: 0\.6 s since the last one"):
            door.check_push(now, clock)
        with pytest.raises(StaleSceneError, match="is old"):
            door.check_stroke(good, now, clock)
    door.take(scene(stamp=100.4, settled=False), 10.4, 100.4)
    door.check_push(10.4, 100.4)  # as every push unsettles its scene, before it comes here or after
    door.take(scene(stamp=100.6, settled=False), 10.6, 100.6)
    with pytest.raises(StaleSceneError, match=r"not settled: 0\.6 s since the last settled one"):
        door.check_push(10.6, 100.6)
    door.check_stroke(good, 10.6, 100.6)


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (scene(body(x=0.5 + 2 * MOVED), body(x=0.7)), "body 0 was moved by 10 mm"),
        (scene(ids=(2, 2)), "episode 2 has begun; the push was planned in episode 1"),
        (scene(body(), ids=(2, 2)), "episode 2 has begun"),
    ],
)
def test_a_stroke_needs_the_bodies_that_it_was_planned_for(message, text):
    door = SceneDoor()
    planned = door.take(scene(), 10.0, 100.0)
    door.take(message, 10.0, 100.0)
    with pytest.raises(StaleSceneError, match=text):
        door.check_stroke(planned, 10.0, 100.0)


def test_bodies_that_come_after_their_scene_show_that_it_was_bad():
    door = SceneDoor()
    door.take(scene(body()), 10.0, 100.0)
    door.state_bodies(TWO, 1, 10.0)
    assert (door.seen, door.trouble) == (None, "it has 1 bodies; episode 1 has 2")


@pytest.mark.parametrize("others", [["disk"], ["disk", "t"]])
def test_bodies_stay_what_they_are_while_scenes_of_their_episode_come(others):
    door, changed = SceneDoor(), Bodies.named(others)
    door.state_bodies(TWO, 1, 10.0)
    door.take(scene(), 10.0, 100.0)
    with pytest.raises(InvalidInputError, match=r"within its episode|and has 1 now"):
        door.state_bodies(changed, 1, 10.5)
    assert (door.bodies, door.trouble) == (TWO, "")
    door.state_bodies(changed, 1, 10.1 + ANEW)  # whoever made the scenes began anew
    assert door.bodies is changed


def test_a_converter_that_starts_anew_is_believed_after_a_pause():
    door = SceneDoor()
    door.take(scene(stamp=100.0, ids=(7, 9)), 10.0, 100.0)
    first = scene(body(), stamp=0.5, ids=(1, 1))
    with pytest.raises(InvalidInputError, match="came after scene 9 of episode 7"):
        door.take(first, 10.5, 0.5)
    assert door.take(first, 10.1 + ANEW, 0.5).ids == (1, 1)


STEPS = st.one_of(
    st.tuples(st.just("good"), st.floats(0.0, 0.4)),
    st.tuples(st.sampled_from(sorted(BAD)), st.floats(0.0, 0.4)),
    st.tuples(st.just("shapes"), st.floats(0.0, 0.4)),
    st.tuples(st.just("nothing"), st.floats(0.0, 2.0)),
)


@given(st.lists(STEPS, max_size=30))
def test_whatever_comes_what_is_held_is_good_and_a_push_needs_that_it_is_the_latest(steps):
    door, time, latest = SceneDoor(), 0.0, ""
    good_at = -np.inf
    for step, pause in steps:
        time += pause
        if step == "shapes":
            door.state_bodies(TWO, 1, time)
        elif step != "nothing":
            shift = time if step == "good" else 0.0
            message = scene(stamp=100.0 + shift) if step == "good" else BAD[step][0]
            try:
                door.take(message, time, 100.0 + time)
                latest, good_at = "good", time
            except InvalidInputError:
                latest = "bad"
        if door.seen is not None:
            wire.check_bodies(wire.check_disks(door.seen.disks))
        with suppress(StaleSceneError):
            door.check_push(time, 100.0 + time)
            assert latest == "good" and time - good_at <= OLD
