"""A robot's side of the contract, whatever comes and in whatever order. No middleware runs."""

from collections import Counter
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sain_core import wire
from sain_core.errors import BusyError, CancelledError, ErrorCode, StaleSceneError
from sain_core.feasibility import Feasibility
from sain_core.push import make_push
from sain_core.ros import codec, push_driver
from sain_core.ros.push_driver import AFTER, LONGEST, PushDriver
from sain_core.scene import VX, X, make_scene
from sain_core.shapes.bodies import Bodies

BODIES = Bodies.named(["disk:flat", "disk:flat"], ["pushable", "movable"])
PLACES, TWO = np.array([(0.45, 0.0), (0.65, 0.1)]), np.full(2, 0.08)


class Robot:
    """A driver on a node without middleware, and what a robot and its surroundings do with it."""

    def __init__(self) -> None:
        self.time, self.episode, self.scene = 100.0, 1, 1
        self.results, self.heard = list[Any](), dict[str, Any]()
        self.sent, self.begun, self.finished = list[int](), list[int](), set[int]()
        self.willing, self.pushed = True, 0.0
        node: Any = SimpleNamespace(
            create_publisher=lambda *_: SimpleNamespace(publish=self.results.append),
            create_subscription=self.subscribe,
            get_clock=lambda: SimpleNamespace(now=self.now),
            get_logger=MagicMock,
            context=SimpleNamespace(ok=lambda: True),
        )
        self.driver = PushDriver(node, self.begin, Feasibility())
        self.state_bodies()

    def now(self) -> Any:
        return SimpleNamespace(nanoseconds=round(1e9 * self.time))

    def subscribe(self, _: type, topic: str, callback: Any, __: Any) -> Any:
        self.heard[topic] = callback
        return SimpleNamespace(qos_profile=SimpleNamespace(depth=0))

    @property
    def stamp(self) -> Any:
        return codec.encode_time(round(1e9 * self.time))

    def state_bodies(self) -> None:
        radii = tuple(TWO.tolist())
        ids = {"stamp": self.stamp, "episode_id": self.episode}
        self.heard["shapes"](codec.encode_bodies(BODIES, radii, **ids))

    def begin(self, push: Any, stroke: Any) -> None:
        assert len(self.begun) == len(self.finished), "one push at a time"
        if not self.willing:
            raise BusyError("the arm still moves")
        self.begun.append(self.sent[-1])

    @property
    def under_way(self) -> int:
        """The push that is begun and not finished; 0: none."""
        return 0 if len(self.begun) == len(self.finished) else self.begun[-1]

    # --- what may happen ------------------------------------------------------------------------

    def passes(self, time: float) -> None:
        self.time += time

    def comes(self, kind: str) -> None:
        """A scene comes."""
        self.time += 0.03
        disks = make_scene(PLACES, TWO, TWO)[: 1 if kind == "count" else 2]
        disks[0, X] += self.pushed
        disks[0, X] = {"nan": np.nan, "huge": 1e300}.get(kind, disks[0, X])
        disks[0, VX] = 0.1 if kind == "moves" else 0.0
        ids = {"episode_id": self.episode, "scene_id": self.scene}
        ids |= {"scene_id": 0} if kind == "late" else {}
        settled = kind == "rests"
        message = codec.encode_scene(disks, stamp=self.stamp, settled=settled, **ids)
        self.heard["scene"](message)

    def begins_anew(self) -> None:
        self.episode, self.scene = self.episode + 1, self.scene + 1
        self.state_bodies()

    def pushes(self, kind: str) -> None:
        again = kind == "again" and self.sent
        self.sent.append(self.sent[-1] if again else max(self.sent, default=0) + 1)
        self.willing = kind != "unwilling"
        push = make_push(0.0, 0.0, np.nan if kind == "nan" else 0.05)
        ids = {"push_id": self.sent[-1], "episode_id": self.episode, "scene_id": self.scene}
        ids |= {"scene_id": 99} if kind == "stale" else {}
        self.heard["push"](codec.encode_push(push, stamp=self.stamp, source="test", **ids))

    def strokes(self, kind: str) -> None:
        """The robot strokes, if it may."""
        if not (push_id := self.under_way):
            return
        try:
            self.driver.check_stroke()
        except StaleSceneError as error:
            self.finished.add(push_id)
            self.driver.refuse(error)
            return
        self.pushed += 0.03 if kind == "moves" else 0.0
        self.finished.add(push_id)
        doubt = None if kind == "sure" else CancelledError("the controller's goal was aborted")
        self.driver.finish(self.time, doubt)
        self.time += AFTER

    def gives_up(self) -> None:
        if push_id := self.under_way:
            self.finished.add(push_id)
            self.driver.refuse(CancelledError("given up"))

    def follow(self) -> None:
        """Count an executed push, as a converter does."""
        executed = sum(one.error_code == ErrorCode.OK for one in self.results)
        self.scene += executed - getattr(self, "counted", 0)
        self.counted = executed


EVENTS = st.one_of(
    st.tuples(st.just(Robot.passes), st.sampled_from([0.1, 0.6, 1.5])),
    st.tuples(st.just(Robot.comes), st.sampled_from(
        ["rests"] * 6 + ["moves", "nan", "huge", "count", "late"])),
    st.tuples(st.just(Robot.pushes), st.sampled_from(
        ["good"] * 4 + ["again", "nan", "stale", "unwilling"])),
    st.tuples(st.just(Robot.strokes), st.sampled_from(["sure", "moves", "still"])),
    st.tuples(st.sampled_from([Robot.gives_up, Robot.begins_anew])),
)  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def alone():
    """No middleware: neither a lock of the namespace, nor timers."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(push_driver, "lock_namespace", lambda *_: lambda: None)
        patch.setattr(push_driver, "find_second_publisher", lambda *_: "")
        patch.setattr(push_driver, "steady_timer", lambda *_: None)
        yield patch


@settings(deadline=None)
@given(st.lists(EVENTS, max_size=40))
def test_whatever_comes_each_push_gets_one_answer_and_only_good_scenes_are_held(alone, events):
    robot = Robot()
    alone.setattr(push_driver, "monotonic", lambda: robot.time)
    robot.comes("rests")
    for event, *given_ in events:
        event(robot, *given_)
        robot.follow()
        held = robot.driver.scene
        assert held is None or len(wire.check_bodies(wire.check_disks(held))) == 2
    robot.gives_up()
    robot.time += LONGEST + 1.0
    robot.driver._look()  # bodies have had their time to come to rest
    assert not robot.driver.busy
    assert Counter(one.push_id for one in robot.results) == Counter(robot.sent)
    for one in robot.results:
        moved = one.before.disks != one.after.disks
        assert one.push_id in robot.finished or one.error_code != ErrorCode.OK
        assert one.error_code == ErrorCode.OK or not moved


def test_the_events_can_lead_to_each_kind_of_answer(alone):
    robot = Robot()
    alone.setattr(push_driver, "monotonic", lambda: robot.time)
    for kind, stroke, code in (
        ("good", "sure", ErrorCode.OK),
        ("good", "moves", ErrorCode.OK),  # a doubt, but a body has moved
        ("good", "still", ErrorCode.CANCELLED),
        ("nan", "sure", ErrorCode.INVALID),
        ("again", "sure", ErrorCode.DUPLICATE_PUSH),
        ("stale", "sure", ErrorCode.STALE_SCENE),
        ("unwilling", "sure", ErrorCode.BUSY),
    ):
        robot.comes("rests")
        robot.pushes(kind)
        robot.strokes(stroke)
        robot.comes("rests")
        robot.follow()
        assert ErrorCode(robot.results[-1].error_code) is code, robot.results[-1].error_message


def test_no_result_is_taken_from_scenes_while_two_nodes_publish_them(alone):
    robot = Robot()
    alone.setattr(push_driver, "monotonic", lambda: robot.time)
    robot.comes("rests")
    robot.pushes("good")
    robot.strokes("moves")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(push_driver, "find_second_publisher", lambda _, topics: "scene" in topics)
        robot.pushed += 0.1
        robot.comes("rests")
    assert not robot.results
    robot.pushed -= 0.1
    robot.comes("rests")
    (result,) = robot.results
    moved = wire.decode_disks(result.after.disks) - wire.decode_disks(result.before.disks)
    np.testing.assert_allclose(moved[0, X], 0.03)
