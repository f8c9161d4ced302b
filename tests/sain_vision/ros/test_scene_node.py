"""The converter of poses: frames on /tf and arrays become scenes, or a diagnostic says why not."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
from rclpy.parameter import Parameter
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from sain_core import wire
from sain_core.errors import ConfigError
from sain_core.ros.camera_topics import make_transform
from sain_core.ros.qos import LATCHED_QUEUE
from sain_core.scene import POSE, VELOCITY
from sain_vision.ros.scene_node import SceneNode
from tests.sain_vision.ros.conftest import Source

ARRAY = "bodies: [{shape: disk, radius: 0.08, mass: 2.0}, {shape: t, radius: 0.1, mass: 1.0}]"
FRAMES = """
bodies:
  - {name: mug, shape: disk, radius: 0.08, mass: 2.0, frame: tag_7}
  - {shape: t, radius: 0.1, mass: 1.0, frame: tag_9}
"""
PLACES = ((0.4, 0.0), (0.6, 0.1))


class Camera(Source):
    """Publishes where two bodies are, for a while."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph, "world")
        self.array = graph.bystander.create_publisher(PoseArray, "poses", 10)
        self.tf = graph.bystander.create_publisher(TFMessage, "/tf", 10)
        self.places = PLACES

    def poses(self) -> None:
        half = {"z": float(np.sin(0.5)), "w": float(np.cos(0.5))}
        poses = [
            Pose(position=Point(x=x, y=y), orientation=Quaternion(**half)) for x, y in self.places
        ]
        self.array.publish(PoseArray(header=self.header(), poses=poses))

    def frames(self) -> None:
        turn = np.array([0.0, 0.0, 0.0, 1.0])
        transforms = [
            make_transform(self.header(), name, np.array([*place, 0.0]), turn)
            for name, place in zip(("tag_7", "tag_9"), self.places, strict=True)
        ]
        self.tf.publish(TFMessage(transforms=transforms))


@pytest.fixture
def camera(graph):
    return Camera(graph)


def start(graph: Any, folder: Path, text: str, **parameters: Any) -> SceneNode:
    path = folder / "bodies.yaml"
    path.write_text(text)
    return graph.start(SceneNode, bodies=str(path), **parameters)


@pytest.mark.parametrize("source", ["poses", "frames"])
def test_poses_become_a_settled_scene_that_viewers_see(graph, camera, tmp_path, source):
    graph.listen("markers", MarkerArray)
    start(graph, tmp_path, ARRAY if source == "poses" else FRAMES)
    camera.until(getattr(camera, source), lambda: graph.find("scene", settled=True), "a scene")
    message = graph.find("scene", settled=True)[0]
    assert (message.episode_id, message.scene_id, message.header.frame_id) == (1, 1, "world")
    scene = wire.decode_disks(message.disks)
    np.testing.assert_allclose(scene[:, :2], PLACES)
    np.testing.assert_allclose(scene[:, POSE][1, 2], 1.0 if source == "poses" else 0.0, atol=1e-9)
    np.testing.assert_array_equal(scene[:, VELOCITY], 0.0)
    np.testing.assert_array_equal(scene[:, 6:], [(2.0, 0.08), (1.0, 0.1)])
    graph.wait(lambda: graph.heard["shapes"], "shapes")
    assert [body.name for body in graph.heard["shapes"][0].bodies] == ["disk", "t"]
    camera.until(getattr(camera, source), lambda: graph.heard["markers"], "markers")
    shown = {(one.ns, one.id): one for one in graph.heard["markers"][-1].markers}
    assert set(shown) - {("", 0)} == {
        ("table", 0), ("bodies", 0), ("bodies", 1), ("labels", 0), ("labels", 1)
    }  # fmt: skip
    places = [
        (shown["bodies", n].pose.position.x, shown["bodies", n].pose.position.y) for n in (0, 1)
    ]
    np.testing.assert_allclose(places, PLACES)
    assert shown["bodies", 0].type == Marker.CYLINDER
    assert shown["bodies", 1].type == Marker.TRIANGLE_LIST and shown["bodies", 1].points


def test_old_frames_are_named(graph, camera, tmp_path):
    start(graph, tmp_path, FRAMES)
    camera.late = 3.0
    text = "body 0 (mug), frame 'tag_7', was last seen 3.0 s ago"
    camera.until(camera.frames, lambda: camera.says(text), "the diagnostic")
    assert not graph.heard["scene"]


def test_frames_that_are_not_connected_are_named(graph, camera, tmp_path):
    """Not even one frame of another may come on /tf: a static camera is all that there is."""
    start(graph, tmp_path, FRAMES)
    text = "frame 'tag_7' was never seen on /tf; it must be connected with 'world'"
    camera.until(lambda: None, lambda: camera.says(text), "the diagnostic")
    camera.frame = "kinect"
    camera.tf = graph.bystander.create_publisher(TFMessage, "/tf_static", LATCHED_QUEUE)
    text = "frame 'tag_7' ends at 'kinect' on /tf; it must be connected with 'world'"
    camera.until(camera.frames, lambda: camera.says(text), "the diagnostic")
    assert not graph.heard["scene"]


def test_a_second_source_of_scenes_is_named_and_no_scene_is_settled(graph, camera, tmp_path):
    node = start(graph, tmp_path, ARRAY)
    camera.until(camera.poses, lambda: graph.find("scene", settled=True), "a scene")
    nodes = [node, start(graph, tmp_path, ARRAY)]
    expected = "/sain/scene_node and /sain/scene_node publish /sain/scene; there must be one"
    graph.wait(lambda: all(one.conflict.startswith(expected) for one in nodes), "the conflict")
    graph.heard["scene"].clear()
    for _ in range(20):
        camera.poses()
        graph.spin(0.02)
    assert not graph.find("scene", settled=True)


def test_ids_go_on_after_a_crash(graph, camera, tmp_path):
    state = str(tmp_path / "state.json")
    node = start(graph, tmp_path, ARRAY, state_file=state)
    camera.until(camera.poses, lambda: graph.find("scene", settled=True), "a scene")
    graph.stop(node)
    start(graph, tmp_path, ARRAY, state_file=state)
    camera.until(camera.poses, lambda: graph.find("scene", episode_id=2, settled=True), "a scene")
    assert graph.find("scene", episode_id=2)[-1].scene_id == 2


def test_without_a_file_of_bodies_it_does_not_start(graph):
    with pytest.raises(ConfigError, match="parameter 'bodies' is empty; give the YAML file"):
        graph.start(SceneNode)


def test_other_bodies_begin_another_episode(graph, camera, tmp_path):
    node = start(graph, tmp_path, ARRAY)
    camera.until(camera.poses, lambda: graph.find("scene", settled=True), "a scene")
    other = tmp_path / "other.yaml"
    other.write_text("bodies: [{shape: disk, radius: 0.05}]")
    assert node.set_parameters([Parameter("bodies", value=str(other))])[0].successful
    camera.places = PLACES[:1]
    camera.until(camera.poses, lambda: graph.find("scene", episode_id=2, settled=True), "a scene")
    assert len(graph.find("scene", episode_id=2)[-1].disks) == 1
    graph.wait(lambda: graph.find("shapes", episode_id=2), "its shapes")
    assert len(graph.find("shapes", episode_id=2)[-1].bodies) == 1
