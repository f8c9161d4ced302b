# ruff: noqa: E501 - a case is a line
"""The driver of an arm over DDS, against the trajectory server: its side of the contract."""

from copy import deepcopy
from functools import cached_property, partial
from pathlib import Path
from threading import Event
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest
import yaml
from control_msgs.action import FollowJointTrajectory
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from visualization_msgs.msg import MarkerArray

from sain_arm.planning.timing import Trajectory
from sain_arm.robot.robot import SHIPPED
from sain_arm.ros import pushing_node
from sain_arm.ros.arm_node import ArmNode
from sain_arm.ros.enabling import Enabled, cancel_all
from sain_arm.ros.trajectory_client import encode
from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.feasibility import Reach, ReachTable
from sain_core.ros.codec import fill_plan
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_core.scene import wrap_angle
from sain_interfaces.msg import Plan, Scene
from sain_mppi.agent.goal_tracker import LOOK_AGAIN
from sain_mppi.ros.mppi_node import MppiNode
from sain_sim.ros.trajectory_server import TrajectoryServer
from sain_vision.ros.scene_node import SceneNode
from tests.sain_arm.conftest import reach_of

BODIES = str(Path(__file__).with_name("bodies.yaml"))
PLACE = (0.5, 0.0, 0.0, 0.5, 0.13, 0.0)


class Table:
    """The nodes of a robot, without planner and model, and an enable signal."""

    def __init__(self, graph: Any, arm: dict[str, Any], server: dict[str, Any]) -> None:
        self.graph = graph
        for topic, kind in (
            ("/joint_states", JointState),
            ("/diagnostics", DiagnosticArray),
            ("poses", PoseArray),
        ):
            graph.listen(topic, kind)
        for topic, kind in (("reach_table", OccupancyGrid), ("ghost", MarkerArray)):
            graph.bystander.create_subscription(kind, topic, graph.heard[topic].append, LATCHED)
        self.enabled = False
        self.signals = graph.bystander.create_publisher(Bool, "enable", RELIABLE)
        graph.bystander.create_timer(0.05, self._beat)
        server = {"cell.robot": "ur5", "engine": "mujoco", "pace": 2.0, "place": PLACE} | server
        self.server = graph.start(TrajectoryServer, bodies=BODIES, **server)
        patient = {"enable_timeout": 10.0, "joints_timeout": 2.0, "patience": 15.0}
        patient["scene_timeout"] = 5.0  # one thread does all
        arm = {"robot": "ur5"} | patient | arm
        self.arm = graph.start(ArmNode, **arm)
        self.converter = graph.start(SceneNode, bodies=BODIES, max_speed=1.5)
        graph.wait(lambda: graph.find("scene", settled=True), "a settled scene")
        self.ids = iter(range(1, 1000))

    def _beat(self) -> None:
        if self.enabled:
            self.signals.publish(Bool(data=True))

    @cached_property
    def scenes(self) -> Any:
        """A second source of scenes; where there is one, the node of scenes settles none."""
        return self.graph.bystander.create_publisher(Scene, "scene", RELIABLE)

    @property
    def scene(self) -> Any:
        return self.graph.find("scene", settled=True)[-1]

    def push(self, push: Any = (0.0, 0.0, 0.06), **ids: int) -> Any:
        push_id = next(self.ids)
        self.graph.push(self.scene, push_id, push, **ids)
        return push_id

    def execute(self, push: Any = (0.0, 0.0, 0.06)) -> Any:
        """Push as a planner does: anew while the refusal says so."""
        while (result := self.graph.result(self.push(push))).error_code in LOOK_AGAIN:
            seen = len(self.graph.heard["scene"])
            self.graph.wait(lambda n=seen: len(self.graph.heard["scene"]) > n + 3, "other scenes")
        return result

    def approach(self, push: Any = (0.0, 0.0, 0.06)) -> int:
        """Push as a planner does, and return as soon as the arm approaches."""
        while True:
            push_id, find = self.push(push), self.graph.find
            answered = partial(find, "push_result", push_id=push_id)
            begun = lambda: self.arm.phase == "approaches"  # noqa: E731
            self.graph.wait(lambda: begun() or answered(), "the approach")  # noqa: B023
            if not answered():
                return int(push_id)

    def settle(self, scene_id: int) -> None:
        self.graph.wait(lambda: self.scene.scene_id >= scene_id, f"scene {scene_id}")

    def report(self) -> str:
        """What the driver says on /diagnostics now."""
        statuses = [one.status[0] for one in self.graph.heard["/diagnostics"]]
        mine = [one for one in statuses if one.name.startswith("/sain/arm_node")]
        return mine[-1].message if mine else ""

    def joints(self) -> np.ndarray:
        return np.array(self.graph.heard["/joint_states"][-1].position)


@pytest.fixture
def make(graph, monkeypatch):
    reach = reach_of("ur5")  # takes seconds: before the clocks of nodes run
    monkeypatch.setattr(pushing_node, "reach_of", lambda planner: reach)

    def make(arm: dict[str, Any] | None = None, **server: Any) -> Table:
        table = Table(graph, arm or {}, server)
        graph.wait(lambda: graph.heard["reach_table"], "the table of reach")
        return table

    return make


def moved(result: Any) -> np.ndarray:
    before, _, after = wire.decode_result(result)
    return np.hypot(*(after - before)[:, :2].T)


def test_pushes_are_made_and_answered(graph, make):
    table = make()
    table.enabled = True
    first = table.scene.scene_id
    for number, push in enumerate([(0.0, 0.0, 0.06), (-2.0, 0.3, 0.05)]):
        result = table.execute(push)
        assert result.error_code == ErrorCode.OK, result.error_message
        assert (result.before.scene_id, result.after.scene_id) == (
            first + number,
            first + number + 1,
        )
        assert 0.02 < moved(result)[0] < 0.08
        assert moved(result)[1] < 0.002
        table.settle(first + number + 1)
    report = table.server.bench.report
    assert (report.limits, report.contacts) == ({}, {})
    assert report.tool > 0


def test_the_arm_goes_on_to_where_a_plan_expects_the_next_push(graph, make):
    """And the next push finds it there, with nothing touched on the way."""
    table = make()
    table.enabled = True
    plans = graph.bystander.create_publisher(Plan, "plan", RELIABLE)
    push_id = table.approach()
    plan = Plan(push_id=push_id, status=Plan.PUSH)
    pushes = np.array([(0.0, 0.0, 0.0, 0.06, 0.2), (0.0, 3.0, 0.0, 0.06, 0.2)])
    fill_plan(plan, pushes, np.repeat(wire.decode_scene(table.scene)[None], 2, axis=0))
    plans.publish(plan)
    graph.wait(lambda: table.arm.phase == "travels", "the arm on its way")
    after = wire.decode_result(graph.result(push_id))[2][0]
    graph.wait(lambda: table.arm.phase == "rests", "the arm beside the next push")
    tip = table.arm._planner.arm.tip(table.joints())[:2]
    behind = after[:2] - tip
    assert abs(wrap_angle(np.arctan2(behind[1], behind[0]) - 3.0)) < 0.1
    assert 0.07 < np.linalg.norm(behind) < 0.12
    assert table.execute((3.0, 0.0, 0.05)).error_code == ErrorCode.OK
    report = table.server.bench.report
    assert (report.limits, report.contacts) == ({}, {})


def test_a_push_is_refused_with_the_code_of_its_reason(graph, make):
    table = make()
    table.enabled = True
    for push, ids, code, text in (
        ((0.0, 0.0, 0.9), {}, ErrorCode.OUT_OF_RANGE, "push length is 0.9"),
        ((0.0, 0.0, 0.1), {"scene_id": 99}, ErrorCode.STALE_SCENE, "planned from scene 99"),
        ((0.0, 0.0, 0.1), {"episode_id": 99}, ErrorCode.UNKNOWN_EPISODE, "for episode 99"),
        ((-1.5708, 0.0, 0.05), {}, ErrorCode.BLOCKED, "pass another body"),
    ):
        result = graph.result(table.push(push, **ids))
        assert result.error_code == code, result.error_message
        assert text in result.error_message
        assert result.before == result.after
    table.approach()
    assert graph.result(table.push()).error_code == ErrorCode.BUSY


def test_a_push_waits_for_the_table_of_reach(graph, monkeypatch):
    reach, found = reach_of("ur5"), Event()
    monkeypatch.setattr(pushing_node, "reach_of", lambda planner: found.wait(60.0) and reach)
    table = Table(graph, {}, {})
    table.enabled = True
    push_id = table.push()
    graph.wait(lambda: table.arm.phase == "waits", "the push")
    found.set()
    assert graph.result(push_id).error_code == ErrorCode.OK


def test_a_reach_that_the_robot_s_file_states_is_what_a_planner_plans_in(graph, tmp_path):
    path = tmp_path / "mine.yaml"
    content = yaml.safe_load((SHIPPED / "ur5.yaml").read_text())
    reach = {"inner": 0.3, "outer": 0.6, "bearing": 1.0}
    path.write_text(yaml.safe_dump(content | {"reach": reach}))
    graph.start(ArmNode, robot=str(path))
    planner = graph.start(MppiNode)
    stated = lambda: planner.agent.config.feasibility.reach  # noqa: E731
    graph.wait(lambda: isinstance(stated(), ReachTable), "the reach")
    ring, places = Reach(0.3, 0.6, 1.0), np.random.default_rng(0).uniform(-1.0, 1.0, (500, 2))
    clear = np.abs(ring.room(places)) > 0.02
    np.testing.assert_array_equal(stated().contains(places)[clear], ring.contains(places)[clear])


@pytest.mark.parametrize(
    ("values", "text"),
    [
        (None, "scene has 0 disks; it needs at least 1"),
        ({"x": np.nan}, "x of disk 0 is nan; must be finite"),
        ({"radius": -0.1}, "radius of body 0 is -0.1 m; allowed: 0.001 to 0.5 m"),
    ],
)
def test_a_bad_scene_is_named_once_and_moves_nothing(graph, make, capfd, values, text):
    table = make()
    table.enabled = True
    graph.wait(lambda: table.arm.driver.scene is not None, "a good scene")
    bad = deepcopy(table.scene)
    for disk in bad.disks:
        for name, value in (values or {}).items():
            setattr(disk, name, value)
    bad.disks = bad.disks if values else []
    for _ in range(10):
        table.scenes.publish(bad)
        graph.spin(0.05)
    graph.wait(lambda: text in table.report(), "the report")
    assert table.arm.driver.scene.shape == (2, 8)
    lines = [one for one in capfd.readouterr().err.splitlines() if "[WARN]" in one]
    ignored = [one for one in lines if "arm_node]: a message on scene is ignored: " in one]
    assert len(ignored) == 1 and text in ignored[0]
    push_id = table.approach()
    graph.stop(table.converter)  # from here on no good one comes
    bad.header.stamp = graph.bystander.get_clock().now().to_msg()
    table.scenes.publish(bad)
    before = table.server.bench.observe()
    result = graph.result(push_id)
    assert result.error_code == ErrorCode.STALE_SCENE, result.error_message
    assert "the latest scene was refused: " in result.error_message
    assert text in result.error_message
    np.testing.assert_allclose(table.server.bench.observe(), before, atol=1e-4)


def test_two_that_disagree_about_the_enable_signal_are_named_and_nothing_moves(graph, make):
    table = make()
    table.enabled = True
    graph.wait(lambda: table.arm.enable.state(monotonic()) is Enabled.YES, "the enable signal")
    pendant = graph.add(Node("pendant", namespace="sain", context=graph.context))
    publisher = pendant.create_publisher(Bool, "enable", RELIABLE)
    publisher.publish(Bool(data=False))
    graph.wait(lambda: table.arm.enable.state(monotonic()) is not Enabled.YES, "false to count")
    pendant.create_timer(0.5, lambda: publisher.publish(Bool(data=False)))
    before = table.joints()
    result = graph.result(table.push())
    assert result.error_code == ErrorCode.BUSY
    text = "not enabled: /sain/bystander and /sain/pendant disagree on /sain/enable"
    assert text in result.error_message
    assert text in table.report()
    np.testing.assert_allclose(table.joints(), before, atol=1e-3)


def test_false_counts_before_a_goal_is_sent_also_where_it_waits_behind_other_messages(graph, make):
    table = make()
    table.enabled = True
    graph.wait(lambda: table.arm.enable.state(monotonic()) is Enabled.YES, "the enable signal")
    for enabled in [True] * 8 + [False]:
        table.signals.publish(Bool(data=enabled))
    sleep(0.3)  # they are on their way, and nothing is called back
    assert table.arm.enable.state(monotonic()) is Enabled.YES
    state = table.arm.arm_state()  # of which nothing is sent: see test_push_execution.py
    assert "the arm is not enabled: false is published" in state.stopped


class Frozen:
    """A publisher of joints' states whose positions stay as they were."""

    def __init__(self, publisher: Any, positions: list[float]) -> None:
        self.publisher, self.positions = publisher, positions

    def publish(self, message: JointState) -> None:
        message.position = self.positions
        self.publisher.publish(message)


def test_a_push_is_made_where_its_body_was_moved_though_the_joints_states_are_frozen(graph, make):
    table = make()
    table.enabled = True
    push_id = table.push((0.0, 0.0, 0.1))
    graph.wait(lambda: table.arm.phase == "pushes", "the stroke")
    table.server._states = Frozen(table.server._states, table.joints().tolist())
    result = graph.result(push_id)
    assert result.error_code == ErrorCode.OK, result.error_message
    assert moved(result)[0] > 0.02
    table.settle(result.after.scene_id)
    again = graph.result(table.push())  # the arm is not where its joints are said to be
    assert again.error_code == ErrorCode.BUSY
    assert "/joint_states did not follow the arm's last goal" in again.error_message


def test_states_of_joints_that_cannot_be_stop_the_arm(graph, make):
    table = make()
    table.enabled = True
    push_id = table.approach((0.0, 0.0, 0.1))
    table.server._states = Frozen(table.server._states, np.degrees(table.joints()).tolist())
    result = graph.result(push_id)
    assert result.error_code == ErrorCode.CANCELLED
    assert "it looks like degrees" in result.error_message
    graph.wait(lambda: "looks like degrees" in table.report(), "the report")
    assert moved(result).max() < 1e-3
    assert not table.server.bench.controller.busy


def test_a_trajectory_that_cannot_be_is_rejected_with_the_reason(graph, make):
    table = make()
    server, robot = table.server, table.server.bench.robot
    home = server.bench.joints
    good = encode(Trajectory(np.array([0.0, 1.0]), np.stack([home] * 2), np.zeros((2, 6))), robot)
    assert server._problem(FollowJointTrajectory.Goal(trajectory=good)) == ""
    for change, text in (
        (lambda m: m.points[1].positions.__setitem__(2, np.nan), "position of joint elbow_joint in point 1 is nan rad; allowed"),
        (lambda m: m.points[0].positions.__setitem__(0, 1e300), "position of joint shoulder_pan_joint in point 0 is 1e+300 rad"),
        (lambda m: m.points[1].velocities.__setitem__(0, np.inf), "velocity of joint shoulder_pan_joint in point 1 is inf rad/s"),
        (lambda m: setattr(m.points[1], "positions", [0.0]), "point 1 has 1 positions; 6 are needed"),
        (lambda m: setattr(m.points[0], "velocities", []), "point 0 has 0 velocities; 6 are needed"),
        (lambda m: setattr(m.points[0].time_from_start, "sec", -1), "its times do not increase from 0 s on"),
        (lambda m: setattr(m, "points", m.points[:1]), "it has 1 points; at least 2"),
        (lambda m: setattr(m, "joint_names", ["elbow"]), "its joints are elbow; allowed: shoulder_pan_joint"),
    ):  # fmt: skip
        message = deepcopy(good)
        change(message)
        problem = server._problem(FollowJointTrajectory.Goal(trajectory=message))
        assert text in problem, problem


def test_without_the_enable_signal_nothing_moves(graph, make):
    table = make()
    before = table.joints()
    result = graph.result(table.push())
    assert result.error_code == ErrorCode.BUSY
    assert "nobody publishes true on /sain/enable" in result.error_message
    np.testing.assert_allclose(table.joints(), before, atol=1e-3)


def lose_signal(graph: Any, make: Any) -> Table:
    """In a stroke, which stops and counts."""
    table = make({"enable_timeout": 1.0}, pace=1.0)
    table.enabled = True
    push_id = table.push((0.0, 0.0, 0.12))
    graph.wait(
        lambda: table.arm.phase == "pushes" and table.server.bench.report.tool > 2, "contact"
    )
    table.enabled = False
    graph.wait(
        lambda: (
            table.arm.enable.state(monotonic()) is not Enabled.YES
            and not table.server.bench.controller.busy
        ),
        "the stop",
    )
    stopped = table.server.bench.tip
    result = graph.result(push_id)
    assert result.error_code == ErrorCode.OK
    assert moved(result)[0] > 0.001
    graph.wait(lambda: table.arm.phase == "rests", "the end")
    np.testing.assert_allclose(table.server.bench.tip, stopped, atol=0.02)  # it brakes
    return table


def test_a_stroke_whose_enable_signal_is_lost_stops_and_counts(graph, make):
    lose_signal(graph, make)


def test_after_a_stopped_stroke_it_lifts_off_first(graph, make):
    table = lose_signal(graph, make)
    table.arm.enable._timeout = 10.0  # one thread does all: its heartbeat may come late
    table.enabled = True
    again = table.execute((3.0, 0.0, 0.05))
    assert again.error_code == ErrorCode.OK, again.error_message


@pytest.mark.parametrize(
    ("every", "at", "code"), [(2, 0.35, ErrorCode.OK), (1, 0.2, ErrorCode.CANCELLED)]
)
def test_a_controller_that_aborts(graph, make, every, at, code):
    """In a stroke: the tool retreats, and the push counts. In an approach: nothing was pushed."""
    table = make(faults=f"abort={at},every={every}")
    table.enabled = True
    result = graph.result(table.push((0.0, 0.0, 0.12)))
    assert result.error_code == code, result.error_message
    if code == ErrorCode.OK:
        assert table.server.bench.tip[2] > 0.05
        assert 0.0 < moved(result)[0] < 0.1
    else:
        assert "protective stop" in result.error_message
        assert moved(result).max() < 1e-3


def test_states_from_before_an_abort_do_not_tell_that_nothing_moved(graph, make):
    table = make(faults="abort=0.5,every=2")
    table.enabled = True
    push_id = table.push((0.0, 0.0, 0.12))
    graph.wait(lambda: table.arm.phase == "pushes", "the stroke")
    table.arm.destroy_subscription(table.arm._inputs.pop(0))  # states are late from here on
    result = graph.result(push_id)
    assert result.error_code == ErrorCode.OK, result.error_message
    assert moved(result)[0] > 0.003


def test_a_controller_that_answers_twice_is_not_believed(graph, make):
    """Its first answers come before the arm has moved."""
    table = make(faults="twice")
    table.enabled = True
    result = table.execute()
    for answer in graph.heard["push_result"]:
        before, _, after = wire.decode_result(answer)
        pushed = np.abs(after - before)[:, :2].max() > 1e-3
        assert pushed == (answer.error_code == ErrorCode.OK), answer.error_message
    assert len(graph.find("push_result", push_id=result.push_id)) == 1


def test_a_dry_run_shows_the_way_and_moves_nothing(graph, make):
    table = make({"dry_run": True})
    before = table.joints()
    result = graph.result(table.push())
    assert result.error_code == ErrorCode.CANCELLED
    assert "the way is possible; nothing was moved" in result.error_message
    graph.wait(lambda: graph.heard["ghost"], "the ghost")
    tip = next(m for m in graph.heard["ghost"][-1].markers if m.ns == "tip" and m.id == 1)
    assert min(point.z for point in tip.points) == pytest.approx(0.01, abs=1e-3)
    np.testing.assert_allclose(table.joints(), before, atol=1e-3)


def test_a_controller_that_is_not_there_is_named(graph, make, tmp_path):
    from sain_arm.robot.robot import SHIPPED

    file = tmp_path / "other.yaml"
    text = (SHIPPED / "ur5.yaml").read_text()
    file.write_text(text.replace("scaled_joint_trajectory_controller", "other_controller"))
    table = make({"robot": str(file)})
    table.enabled = True
    result = graph.result(table.push())
    assert result.error_code == ErrorCode.BUSY
    text = "no controller serves /other_controller/follow_joint_trajectory; is it active?"
    assert text in result.error_message


def test_who_releases_the_arm_stops_the_controller_itself(graph, make):
    """As if `arm_node` were dead: it still has its signal."""
    table = make()
    table.enabled = True
    push_id = table.push((0.0, 0.0, 0.12))
    graph.wait(
        lambda: table.arm.phase == "pushes" and table.server.bench.report.tool > 2, "contact"
    )
    answer = cancel_all(graph.bystander, table.server.bench.robot.controller)
    graph.wait(answer.done, "the answer of the controller")
    assert len(answer.result().goals_canceling) == 1
    assert graph.result(push_id).error_code == ErrorCode.OK


def test_the_arm_goes_home_where_it_may_hide_a_body(graph, make):
    table = make()
    table.enabled = True
    push_id = table.push()
    graph.wait(lambda: table.arm.phase == "pushes", "the stroke")
    poses, table.server._poses = table.server._poses, None
    home = table.arm.robot.home
    graph.wait(lambda: np.abs(table.joints() - home).max() < 0.02, "the arm at home")
    table.server._poses = poses
    assert graph.result(push_id).error_code == ErrorCode.OK
    report = table.server.bench.report
    assert (report.limits, report.contacts) == ({}, {})
