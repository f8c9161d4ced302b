"""A simulator that goes on where another process was left."""

import json

import numpy as np
import pytest

from sain_core import wire
from sain_core.errors import DatasetError, ErrorCode
from sain_core.guarding.ros.state_file import StateFile, text_of
from sain_core.scene import POSE
from sain_sim.ros.episodes import LeftEpisode
from sain_sim.ros.sim_node import SimNode

PUSH = (0.0, 0.0, 0.08)
TIMELESS = '{"episode_id": 1, "scene_id": 1, "push": "", "unsent": "", "time": 1e300}'


def latest(graph):
    return graph.find("scene", settled=True)[-1]


def hear_anew(graph):
    for heard in graph.heard.values():
        heard.clear()


@pytest.fixture
def left(graph, tmp_path):
    """The state of a simulator after a reset and two pushes, and what was heard of it."""
    path = tmp_path / "sim.json"
    node = graph.start(SimNode, idle_rate=20.0, state_file=str(path))
    graph.wait(lambda: graph.find("scene", settled=True), "a settled scene")
    scene = graph.reset(seed=5, world="rough", friction=0.5)
    for push_id in (1, 2):
        graph.push(scene, push_id, PUSH)
        scene = graph.result(push_id).after
    graph.wait(lambda: json.loads(path.read_text())["subscribers"] == 1, "the subscriber")
    graph.wait(lambda: latest(graph).scene_id == scene.scene_id, "the last scene")
    graph.stop(node)
    graph.spin(0.4)  # what is still on its way
    return path


def test_episode_scene_world_and_time_go_on(graph, left):
    scene = latest(graph)
    world = graph.heard["world_parameters"][-1]
    hear_anew(graph)
    graph.start(SimNode, idle_rate=20.0, state_file=str(left), seed=99)
    graph.wait(lambda: graph.find("scene", settled=True), "the scene of before")
    now = latest(graph)
    assert (now.episode_id, now.scene_id) == (scene.episode_id, scene.scene_id)
    before, after = wire.decode_disks(scene.disks), wire.decode_disks(now.disks)
    np.testing.assert_allclose(after[:, POSE], before[:, POSE], rtol=0, atol=1e-15)  # of turns
    assert now.header.stamp.sec > scene.header.stamp.sec
    graph.wait(lambda: graph.heard["world_parameters"], "the world")
    again = graph.heard["world_parameters"][-1]
    for name in ("seed", "world", "shapes", "roles", "friction", "rim_friction", "tool_friction"):
        assert getattr(again, name) == getattr(world, name)
    graph.push(now, 3, PUSH)
    result = graph.result(3)
    assert (result.error_code, result.after.scene_id) == (ErrorCode.OK, scene.scene_id + 1)


def test_the_push_that_was_under_way_is_refused_and_never_executed(graph, left):
    lost = graph.find("push_result", push_id=2)[0].push
    lost.push_id, lost.scene_id = 7, latest(graph).scene_id
    left.write_text(json.dumps({**json.loads(left.read_text()), "push": text_of(lost)}))
    hear_anew(graph)
    graph.start(SimNode, idle_rate=20.0, state_file=str(left))
    result = graph.result(7)
    assert result.error_code == ErrorCode.CANCELLED
    assert result.error_message == "push 7 ended when the simulator crashed; it moved nothing"
    assert result.before == result.after
    graph.push(result.after, 7, PUSH)
    graph.wait(lambda: len(graph.find("push_result", push_id=7)) == 2, "another answer")
    assert graph.find("push_result", push_id=7)[1].error_code == ErrorCode.DUPLICATE_PUSH


def test_a_result_is_told_though_its_simulator_died_before_it_could(graph, left, monkeypatch):
    hear_anew(graph)
    node = graph.start(SimNode, idle_rate=20.0, state_file=str(left))
    graph.wait(lambda: graph.find("scene", settled=True), "the scene of before")
    scene, moment = latest(graph), {}

    def die(result):
        moment["state"] = left.read_text()
        raise SystemExit

    monkeypatch.setattr(node.episodes, "_publish", die)
    graph.push(scene, 9, PUSH)
    with pytest.raises(SystemExit):
        graph.wait(lambda: moment, "the death")
    graph.stop(node)
    left.write_text(moment["state"])
    hear_anew(graph)
    graph.start(SimNode, idle_rate=20.0, state_file=str(left))
    result = graph.result(9)
    assert (result.error_code, result.after.scene_id) == (ErrorCode.OK, scene.scene_id + 1)
    graph.wait(lambda: graph.find("scene", settled=True), "the scene after")
    assert latest(graph).scene_id == scene.scene_id + 1
    assert not json.loads(left.read_text())["unsent"], "it is told once"
    graph.push(latest(graph), 9, PUSH)
    graph.wait(lambda: len(graph.find("push_result", push_id=9)) == 2, "another answer")
    assert graph.find("push_result", push_id=9)[1].error_code == ErrorCode.DUPLICATE_PUSH


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}]",
        '{"episode_id": 1e400}',
        TIMELESS,
        '{"reset": 1}',
        '{"reset": "AAAA", "episode_id": 1}',
        "[" * 10**6,
    ],
)
def test_a_damaged_file_is_refused(graph, tmp_path, text):
    path = tmp_path / "sim.json"
    path.write_text(text)
    with pytest.raises(DatasetError, match=r"is not the state of a node|is damaged"):
        LeftEpisode.read(StateFile(graph.bystander, str(path)))
