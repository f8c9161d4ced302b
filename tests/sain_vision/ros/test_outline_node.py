"""From depth images on topics to poses of bodies without tags."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image
from tf2_msgs.msg import TFMessage
from vision_msgs.msg import Detection3DArray

from sain_core.errors import InvalidInputError
from sain_core.randomness import generator
from sain_core.ros import codec
from sain_core.ros.camera_topics import CameraTopics
from sain_core.ros.qos import LATCHED
from sain_core.scene import POSE
from sain_vision.ros.images import decode_depth
from sain_vision.ros.outline_node import OutlineNode
from tests.sain_vision.detection.test_outlines import AWAY, CONFIG, START, camera_of

BODIES = """
bodies:
  - {name: puck, shape: disk, radius: 0.07}
  - {name: tee, shape: "t:flat", radius: 0.1}
"""


def test_depth_images_become_poses(graph, tmp_path):
    path = tmp_path / "bodies.yaml"
    path.write_text(BODIES)
    shot = camera_of(CONFIG).take(AWAY, START, generator(0, "test"))
    graph.start(OutlineNode, bodies=str(path), max_age=5.0, robot="ur5")
    graph.listen("/diagnostics", DiagnosticArray)
    graph.listen("detections", Detection3DArray)
    graph.listen("camera/outlines", Image)
    node = graph.bystander
    topics = CameraTopics(node, CONFIG, "")
    static = node.create_publisher(TFMessage, "/tf_static", LATCHED)
    static.publish(TFMessage(transforms=[topics.transform(codec.encode_time(0))]))

    def found() -> bool:
        topics.publish(shot, node.get_clock().now().to_msg())
        graph.spin(0.4)
        return any(len(m.detections) == 2 for m in graph.heard["detections"])

    graph.wait(found, "both bodies")
    message = next(m for m in graph.heard["detections"] if len(m.detections) == 2)
    for one in message.detections:
        place = one.results[0].pose.pose.position
        truth = START[["puck", "tee"].index(one.id), POSE]
        assert np.hypot(place.x - truth[0], place.y - truth[1]) < 0.0025
    graph.wait(lambda: found() and graph.heard["camera/outlines"], "the overlay")
    said = [one.message for m in graph.heard["/diagnostics"] for one in m.status]
    assert any("masked by its height alone: no /joint_states" in text for text in said)


@pytest.mark.parametrize("encoding", ["16UC1", "32FC1"])
def test_depths_of_both_encodings_are_metres(encoding):
    depth = np.array([[0.5, 0.0], [1.25, 2.0]])
    pixels = {"16UC1": (1000 * depth).astype("<u2"), "32FC1": depth.astype("<f4")}[encoding]
    message = codec.encode_image(pixels, encoding, codec.header(codec.encode_time(0)))
    np.testing.assert_allclose(decode_depth(message), [[0.5, np.nan], [1.25, 2.0]])


def floats(value):
    """Make the image one of floats [m]."""
    return {"encoding": "32FC1", "step": 8, "data": np.full(4, value, "<f4").tobytes()}


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"encoding": "8UC1"}, "depth image has the encoding '8UC1'.*; allowed: 16UC1"),
        ({"height": 0}, "the image is 2 x 0 px; it must have pixels"),
        ({"height": 3}, "it must have 3 rows of at least 4"),
        ({"step": 2}, "in rows of 2; it must have 2 rows of at least 4"),
        ({"data": bytes(8)}, "no distance of 0.05 to 10 m, all are unknown: 16 bits must be"),
        (
            {"encoding": "32FC1", "step": 8, "data": np.full(4, 1000.0, "<f4").tobytes()},
            "floats in m",
        ),
        (floats(np.nan), "all are unknown"),
        (floats(np.inf), "their median is inf m"),
        ({"data": 4 * b"\x03\xe8"}, "their median is 59.4 m: 16 bits must be in mm"),
    ],
)
def test_a_depth_image_that_is_not_one_is_refused(change, text):
    pixels = np.ones((2, 2), dtype="<u2")
    message = codec.encode_image(pixels, "16UC1", codec.header(codec.encode_time(0)))
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(InvalidInputError, match=text):
        decode_depth(message)
