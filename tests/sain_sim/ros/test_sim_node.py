# ruff: noqa: E501 - a case is a line
"""The simulator's node: what it carries out, what it refuses, and that its clock goes on."""

from copy import deepcopy

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from visualization_msgs.msg import MarkerArray

from sain_bringup.ros.director import reset_request
from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.push import make_push
from sain_core.ros import codec
from sain_core.scene import make_scene
from sain_core.wire.bodies import decode_bodies
from sain_eval.scenes.scenarios import draw_scene
from sain_interfaces.msg import DiskState, Prediction
from sain_interfaces.srv import ResetScene
from sain_sim.ros.sim_node import SimNode
from sain_sim.world.start import draw_episode
from sain_sim.world.truth import TruthConfig
from tests.rviz import shown
from tests.sain_core.shapes.test_outlines import a_bar, objects

AHEAD = (0.0, 0.0, 0.1)
RESET = ("seed", "disks", "shapes", "roles", "friction")
MASS, RADII = np.full(4, 8.0), np.full(4, 0.06)


@pytest.fixture
def simulator(graph):
    node = graph.start(SimNode, idle_rate=20.0)
    graph.wait(lambda: graph.find("scene", settled=True), "a settled scene")
    return node


def latest(graph):
    return graph.find("scene", settled=True)[-1]


def seconds(stamp) -> float:
    return stamp.sec + 1e-9 * stamp.nanosec


def test_a_push_is_carried_out_and_everything_said_about_it_fits_together(graph, simulator):
    graph.listen("joint_states", JointState)
    graph.listen("markers", MarkerArray)
    scene = latest(graph)
    graph.push(scene, 7, AHEAD)
    result = graph.result(7)
    assert (result.error_code, result.error_message) == (ErrorCode.OK, "")
    assert (result.push.push_id, result.push.length, result.push.source) == (7, 0.1, "test")
    before, after = wire.decode_disks(result.before.disks), wire.decode_disks(result.after.disks)
    np.testing.assert_array_equal(before, wire.decode_disks(scene.disks))
    assert after[0, 0] - before[0, 0] > 0.05
    assert after[1, 0] - before[1, 0] > 0.05
    assert result.after.scene_id == result.before.scene_id + 1
    assert result.duration > 0.5
    prediction = result.prediction
    assert (prediction.error_code, prediction.model) == (ErrorCode.OK, "bullet_nominal")
    expected = wire.decode_disks(prediction.disks)
    assert 0.0 < np.abs(expected[:, :2] - after[:, :2]).max() < 0.03
    graph.wait(lambda: latest(graph).scene_id == result.after.scene_id, "the new scene")
    np.testing.assert_array_equal(wire.decode_disks(latest(graph).disks), after)
    moving = [m for m in graph.heard["scene"] if not m.settled]
    assert moving
    assert all(message.scene_id == scene.scene_id for message in moving)
    graph.wait(lambda: graph.heard["joint_states"] and graph.heard["markers"], "the arm")
    assert len(graph.heard["joint_states"][-1].position) == 7
    groups = shown(graph.heard["markers"]).count()
    assert groups == {"table": 1, "tool": 1, "bodies": 2, "labels": 2}


def test_viewers_show_the_bodies_of_this_episode_and_none_of_the_last(graph, simulator):
    graph.listen("markers", MarkerArray)

    def expect(bodies):
        groups = {"table": 1, "tool": 1, "bodies": bodies, "labels": bodies}
        graph.wait(lambda: shown(graph.heard["markers"]).count() == groups, f"{bodies} bodies")

    four = make_scene(np.array([(0.4, 0.0), (0.6, 0.0), (0.5, 0.3), (0.5, -0.3)]), MASS, RADII)
    expect(2)
    graph.reset(disks=codec.encode_disks(four))
    expect(4)
    assert len(graph.reset(seed=3).disks) == 2
    expect(2)


REFUSED = [
    ((np.nan, 0.0, 0.1), {}, ErrorCode.INVALID, "location of the push is nan; must be finite"),
    ((0.0, 0.0, np.inf), {}, ErrorCode.INVALID, "length of the push is inf; must be finite"),
    ((4.0, 0.0, 0.1), {}, ErrorCode.OUT_OF_RANGE, "push location is 4.0000 rad; allowed"),
    ((0.0, 1.0, 0.1), {}, ErrorCode.OUT_OF_RANGE, "push angle is 1.0000 rad; allowed"),
    ((0.0, 0.0, 0.2), {}, ErrorCode.OUT_OF_RANGE, "push length is 0.2000 m; allowed"),
    ((0.0, 0.0, -1e300), {}, ErrorCode.OUT_OF_RANGE, "push length is -1e+300 m; allowed"),
    (AHEAD, {"scene_id": 99}, ErrorCode.STALE_SCENE, "was planned from scene 99; it is scene"),
    (AHEAD, {"episode_id": 9}, ErrorCode.UNKNOWN_EPISODE, "is for episode 9; episode 1 is"),
    ((np.pi, 0.0, 0.1), {}, ErrorCode.BLOCKED, "another body"),
]


def test_a_refused_push_moves_nothing_and_says_why(graph, simulator):
    scene = latest(graph)
    for push_id, (push, ids, code, text) in enumerate(REFUSED, start=11):
        graph.push(scene, push_id, push, **ids)
        result = graph.result(push_id)
        assert ErrorCode(result.error_code) is code
        assert text in result.error_message
        assert result.before == result.after == scene
        assert result.prediction == Prediction()
    count = len(graph.heard["scene"])
    graph.wait(lambda: len(graph.heard["scene"]) > count + 2, "further scenes")
    assert latest(graph) == scene


NO_BODIES = [
    ({"x": np.nan}, "scene of the push: x of disk 0 is nan; must be finite"),
    ({"x": 1e300}, "scene of the push: x of body 0 is 1e+300 m; allowed: -10 to 10 m"),
    ({"theta": 1e300}, "scene of the push: theta of body 0 is 1e+300 rad; allowed"),
    ({"vx": -1e300}, "scene of the push: vx of body 0 is -1e+300 m/s; allowed"),
    ({"mass": 1e300}, "scene of the push: mass of body 0 is 1e+300 kg; allowed"),
    (None, "the push was planned for 1 bodies; this world has 2"),
]


def test_a_push_for_bodies_that_cannot_be_is_refused(graph, simulator):
    scene = latest(graph)
    for push_id, (values, text) in enumerate(NO_BODIES, start=12):
        disks = deepcopy(scene.disks)[: None if values else 1]
        for name, value in (values or {}).items():
            setattr(disks[0], name, value)
        push = codec.encode_push(
            make_push(*AHEAD),
            stamp=scene.header.stamp,
            push_id=push_id,
            source="test",
            episode_id=1,
            scene_id=1,
        )
        push.disks = disks
        graph.pushing.publish(push)
        result = graph.result(push_id)
        assert ErrorCode(result.error_code) is ErrorCode.INVALID
        assert text in result.error_message
        assert result.before == result.after == scene


def test_a_push_without_length_is_executed_and_moves_nothing(graph, simulator):
    scene = latest(graph)
    graph.push(scene, 3, (0.0, 0.0, 0.0))
    result = graph.result(3)
    assert (result.error_code, result.after.scene_id) == (ErrorCode.OK, scene.scene_id + 1)
    assert result.before.disks == result.after.disks == scene.disks


def test_a_push_id_works_once(graph, simulator):
    graph.push(latest(graph), 5, AHEAD)
    graph.result(5)
    graph.wait(lambda: latest(graph).scene_id == 2, "the new scene")
    scene = latest(graph)
    graph.push(scene, 5, AHEAD)
    graph.wait(lambda: len(graph.find("push_result", push_id=5)) == 2, "the second answer")
    again = graph.find("push_result", push_id=5)[1]
    assert ErrorCode(again.error_code) is ErrorCode.DUPLICATE_PUSH
    assert again.before == again.after == scene


def test_while_one_push_is_under_way_another_and_a_reset_are_refused_as_busy(graph):
    graph.start(SimNode, real_time_factor=1.0)
    graph.wait(lambda: graph.find("scene", settled=True), "a settled scene")
    scene = latest(graph)
    graph.push(scene, 1, AHEAD)
    graph.wait(lambda: graph.find("scene", settled=False), "the push to begin")
    graph.push(scene, 2, AHEAD)
    assert ErrorCode(graph.result(2).error_code) is ErrorCode.BUSY
    assert not graph.find("push_result", push_id=1)
    response = graph.call(ResetScene, "reset_scene", ResetScene.Request(seed=1))
    assert ErrorCode(response.error_code) is ErrorCode.BUSY
    assert "push 1 is under way" in response.error_message
    assert graph.result(1).error_code == ErrorCode.OK


def test_a_reset_starts_a_new_episode_that_its_seed_decides(graph, simulator):
    first = graph.reset(seed=3)
    other = graph.reset(seed=4)
    again = graph.reset(seed=3)
    assert [m.episode_id for m in (first, other, again)] == [2, 3, 4]
    assert [m.scene_id for m in (first, other, again)] == [2, 3, 4]
    assert first.disks == again.disks
    assert first.disks != other.disks


def test_each_episode_tells_what_its_world_is_made_of(graph, simulator):
    scene = graph.reset(seed=3, world="randomised", shapes=["disk", "cube"])
    given = graph.reset(seed=4, friction=0.3)

    def told(scene):
        return graph.find("world_parameters", episode_id=scene.episode_id)

    graph.wait(lambda: told(given), "the second world")
    drawn, _ = draw_episode(3, TruthConfig("randomised"), shapes=("disk", "cube"))
    (first,), (second,) = told(scene), told(given)
    assert (first.seed, first.world, first.shapes) == (3, "randomised", ["disk", "cube"])
    assert [first.friction, first.rim_friction, first.tool_friction] == [
        drawn.friction,
        drawn.rim_friction,
        drawn.tool_friction,
    ]
    assert (second.world, second.friction) == (simulator.simulator.config.world, 0.3)


WRONG_RESETS = [
    ({"world": "mars"}, ErrorCode.INVALID, "world is 'mars'; allowed: randomised, rough, measured, nominal"),
    ({"friction": -1.0}, ErrorCode.OUT_OF_RANGE, "friction is -1.0"),
    ({"friction": float("nan")}, ErrorCode.OUT_OF_RANGE, "friction is nan"),
    ({"shapes": ["disk"]}, ErrorCode.INVALID, "1 shapes are given for 2 disks"),
    (
        {"disks": [DiskState(x=0.4, theta=90.0, mass=8.0, radius=0.08)]},
        ErrorCode.INVALID,
        "scene of the reset: theta of body 0 is 90 rad; allowed: -6.28319 to 6.28319 rad; it"
        " looks like degrees",
    ),
    (
        {"shapes": ["disk", "cone"]},
        ErrorCode.INVALID,
        "shape of body 1 is 'cone' (did you mean 'corner'?); allowed:",
    ),
]  # fmt: skip


def test_a_wrong_reset_changes_nothing(graph, simulator):
    scene = latest(graph)
    for request_fields, code, text in WRONG_RESETS:
        response = graph.call(ResetScene, "reset_scene", ResetScene.Request(**request_fields))
        assert ErrorCode(response.error_code) is code
        assert text in response.error_message
        assert response.scene == scene
    graph.push(scene, 31, AHEAD)
    assert graph.result(31).error_code == ErrorCode.OK


def test_bodies_of_a_file_have_its_heights_and_centres_of_mass(graph, tmp_path):
    centre = {"com_uniform_density_minus_centroid_m": [0.004, 0.0]}
    file = objects(tmp_path, a_bar(**centre), a_bar(name="Can", height_m=0.06))
    case = draw_scene("anything:letter_i+can", 0, file)
    node = graph.start(SimNode, engine="mujoco", outlines=str(file), shadow=False)
    graph.reset(**{name: getattr(reset_request(case), name) for name in RESET})
    drawn, given = node.simulator.parameters, case.parameters()
    assert (drawn.heights, drawn.mass_offsets) == (given.heights, given.mass_offsets)
    graph.wait(lambda: graph.find("shapes", episode_id=2), "its shapes")
    assert decode_bodies(graph.find("shapes", episode_id=2)[0]).tops == (0.05, 0.06)


def test_the_clock_never_goes_back_also_over_a_reset(graph, simulator):
    graph.listen("/clock", Clock)
    graph.push(latest(graph), 41, AHEAD)
    graph.result(41)
    graph.reset(seed=2)
    graph.push(graph.reset(seed=5), 42, AHEAD)
    graph.result(42)
    count = len(graph.heard["/clock"])
    graph.wait(lambda: len(graph.heard["/clock"]) > count + 2, "the clock")
    times = [seconds(message.clock) for message in graph.heard["/clock"]]
    assert times == sorted(times)
    assert times[-1] > times[0]
    stamps = [seconds(message.header.stamp) for message in graph.heard["scene"]]
    assert stamps == sorted(stamps)


def test_its_own_clock_does_not_freeze_it(graph):
    """Its time stands still between pushes, so no timer may wait for it."""
    graph.start(SimNode, idle_rate=20.0, use_sim_time=True)
    graph.wait(lambda: len(graph.find("scene", settled=True)) > 5, "scenes at rest")
    graph.push(graph.reset(seed=9), 3, AHEAD)
    assert graph.result(3).error_code == ErrorCode.OK


def test_scenes_at_rest_have_the_time_at_which_they_were_observed(graph):
    graph.start(SimNode, idle_rate=20.0, real_time_factor=1.0)

    def stamps():
        return [seconds(one.header.stamp) for one in graph.find("scene", settled=True)]

    graph.wait(lambda: len(stamps()) > 10, "scenes at rest")
    assert np.all(np.diff(stamps())[1:] > 0.0)
    assert np.mean(np.diff(stamps())) > 0.03  # on a busy machine they come later


def test_a_node_in_mujoco_says_so_and_pushes(graph):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    node = graph.start(SimNode, idle_rate=20.0, engine="mujoco", shadow=False)
    graph.listen("/diagnostics", DiagnosticArray)
    graph.wait(lambda: graph.find("world_parameters"), "the world's parameters")
    assert graph.find("world_parameters")[-1].world == "randomised in mujoco"
    assert node.ready == "a randomised world in mujoco with 2 disks"
    graph.wait(lambda: graph.heard["/diagnostics"], "diagnostics")
    figures = {v.key: v.value for v in graph.heard["/diagnostics"][-1].status[0].values}
    assert figures["engine"] == "mujoco"
    graph.push(graph.reset(seed=9), 7, AHEAD)
    after = wire.decode_disks(graph.result(7).after.disks)
    assert after[0, 0] > 0.4
