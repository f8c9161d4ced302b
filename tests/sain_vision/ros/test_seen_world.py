"""The simulator with no scenes of its own: its images become the scene that a push starts from."""

import numpy as np
from vision_msgs.msg import Detection3DArray

from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.scene import POSITION
from sain_core.shapes.body_file import write_tagged_bodies
from sain_interfaces.srv import ResetScene
from sain_sim.ros.sim_node import SimNode
from sain_vision.ros.scene_node import SceneNode
from sain_vision.ros.tag_node import TagNode

SMALL = {"shadow": False, "images__detail": 0.25, "images__rate": 5.0}


def test_a_push_starts_from_a_scene_that_was_seen(graph, tmp_path):
    """Images are taken only while somebody subscribes."""
    simulator = graph.start(SimNode, scenes=False, cell__wait_aside=True, **SMALL)
    graph.spin(0.5)
    assert simulator.simulator._images is None
    for friction in (0.2, 0.3):  # its episodes are others than those of who makes the scenes
        simulator.episodes._reset(ResetScene.Request(seed=1, friction=friction))
    world = simulator.simulator.parameters
    start = simulator.simulator.world.observe()
    path = tmp_path / "bodies.yaml"
    write_tagged_bodies(path, start, world.bodies)
    clock = {"use_sim_time": True, "bodies": str(path), "max_age": 20.0}
    graph.start(TagNode, **clock)
    graph.start(SceneNode, noise="0.0005,0.005", **clock)
    graph.listen("detections", Detection3DArray)
    graph.wait(lambda: graph.find("scene", settled=True), "a scene")
    scene = graph.find("scene", settled=True)[-1]
    np.testing.assert_allclose(
        wire.decode_disks(scene.disks)[:, POSITION], start[:, POSITION], atol=0.001
    )
    session = simulator.driver.session
    graph.wait(lambda: session.scene_id == scene.scene_id, "the simulator has its ids")
    graph.push(scene, 1, (0.5, 0.0, 0.05))
    result = graph.result(1)
    assert result.error_code == ErrorCode.OK, result.error_message
    after = (scene.episode_id, scene.scene_id + 1)
    assert (result.after.episode_id, result.after.scene_id) == after
    graph.wait(lambda: graph.find("scene", settled=True, scene_id=after[1]), "the scene after it")
    seen = wire.decode_disks(graph.find("scene", settled=True, scene_id=after[1])[0].disks)
    truth = wire.decode_disks(result.after.disks)
    np.testing.assert_allclose(seen[:, POSITION], truth[:, POSITION], atol=0.001)
    assert np.abs(truth - start)[:, POSITION].max() > 0.01
    stated = [(one.episode_id, one.friction) for one in graph.heard["world_parameters"]]
    assert stated == [(scene.episode_id, 0.3)]
