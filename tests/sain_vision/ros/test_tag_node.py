"""From images on topics to a scene; and what is wrong with a camera is said, and nothing sent."""

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Image, RegionOfInterest

from sain_core import wire
from sain_core.errors import ConfigError
from sain_core.ros.node_main import executor_of, ros_context, steady_timer
from sain_mppi.ros.mppi_node import MppiNode
from sain_vision.ros.camera_input import CameraInput
from sain_vision.ros.images import decode_grey
from sain_vision.ros.scene_node import SceneNode
from sain_vision.ros.tag_node import TagNode
from tests.sain_vision.pictures import CAMERA, take, tilted
from tests.sain_vision.ros.conftest import FRAME

POSES = np.array([(0.40, 0.1, 0.3), (0.5, -0.1, 2.0)])
BODIES = """
bodies:
  - {name: mug, shape: disk, radius: 0.06, mass: 2.0, tags: 0}
  - {shape: t, radius: 0.1, mass: 1.0, tags: [{id: 1, size: 0.04}]}
"""


@pytest.fixture(scope="module")
def picture():
    return take(CAMERA, enumerate(POSES), np.random.default_rng(0))


@pytest.fixture
def bodies(tmp_path):
    path = tmp_path / "bodies.yaml"
    path.write_text(BODIES)
    return str(path)


def test_images_become_a_settled_scene(graph, camera_topics, bodies, picture):
    patient = {"bodies": bodies, "max_age": 20.0}  # also on a machine that is busy
    graph.start(TagNode, **patient)
    graph.start(SceneNode, noise="0.0005,0.005", **patient)
    graph.listen("camera/overlay", Image)
    camera_topics.place()
    camera_topics.show_until(picture, lambda: graph.find("scene", settled=True), "a scene")
    scene = wire.decode_disks(graph.find("scene", settled=True)[0].disks)
    assert np.abs(scene[:, :2] - POSES[:, :2]).max() < 0.0015
    assert scene[1, 2] == pytest.approx(POSES[1, 2], abs=0.01)
    message = graph.heard["detections"][-1]
    assert [one.id for one in message.detections] == ["mug", "t"]
    covariance = np.array(message.detections[0].results[0].pose.covariance).reshape(6, 6)
    assert 0.0 < covariance[0, 0] < 0.002**2 and 0.0 < covariance[5, 5] < 0.02**2
    overlay = graph.heard["camera/overlay"][-1]
    assert (overlay.encoding, overlay.width, overlay.height) == ("bgr8", 1280, 720)


def test_a_body_that_tips_over_is_named_and_the_planner_says_why_it_waits(
    graph, camera_topics, bodies, picture
):
    graph.start(TagNode, bodies=bodies, max_age=20.0)
    graph.start(SceneNode, noise="0.0005,0.005", bodies=bodies)
    planner = graph.start(MppiNode, dynamics="in_process", model="planar", planner__samples=64)
    camera_topics.place()
    camera_topics.show_until(picture, lambda: graph.find("scene", settled=True), "a scene")
    lean = Rotation.from_euler("y", 35.0, degrees=True).as_matrix()
    tipped = tilted(CAMERA, 0, np.array([0.43, 0.1, 0.05]), lean)
    tipped[:, 640:] = picture[:, 640:]  # the other body stands
    text = "body 0 (mug) is tilted by 35 degrees: it has tipped over; stand it up again"
    camera_topics.show_until(tipped, lambda: not graph.heard["scene"][-1].settled, "an end of rest")
    graph.spin(0.5)  # until the planner has heard of it, too, before the goal comes
    graph.heard["scene"].clear()
    graph.aim((0.5, 0.0), 1)
    waits = f"waits for a scene at rest: the pose of {text}"
    camera_topics.show_until(tipped, lambda: camera_topics.says(waits), "the planner's reason")
    assert camera_topics.says(text) and planner.agent.pushes == 0
    assert not graph.find("scene", settled=True)
    camera_topics.show_until(picture, lambda: graph.find("plan", goal_id=1), "a plan")


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"encoding": "bayer_rggb8"}, "encoding 'bayer_rggb8'; allowed: mono8"),
        ({"late": -3.0}, "the image is stamped 3.0 s in the future; is the camera's clock set"),
        ({"late": 3.0}, "the image is 3.0 s old; at most 0.5 s is allowed"),
        ({"calibrated": False}, "there is no calibration on /sain/camera/color/camera_info"),
        ({"placed": "elsewhere"}, "frame 'camera_color_optical_frame' was never seen on /tf"),
        ({"changes": {"k": np.zeros(9)}}, "K is all zeros: calibrate first"),
        ({"changes": {"binning_x": 2, "binning_y": 2}}, "states a binning of 2 x 2; only 1 x 1"),
        (
            {"changes": {"roi": RegionOfInterest(x_offset=8, width=640, height=480)}},
            "a region of interest of 640 x 480 px at (8, 0); only the whole of 1280 x 720",
        ),
        (
            {"changes": {"width": 1200}},
            "the image is 1280 x 720 px and its calibration is for 1200 x 720 px",
        ),
        ({"pose": (np.eye(3), CAMERA.place)}, "shows no point of the table (x in [0.16, 1.16] m"),
        ({"frame": ""}, "the image has no frame_id; the driver must state the camera's"),
        ({"late": 4e9}, "its stamp is 0: the driver must stamp images"),
    ],
)
def test_what_is_wrong_is_said_and_nothing_is_sent(
    graph, camera_topics, bodies, picture, settings, text
):
    graph.start(TagNode, bodies=bodies)
    if "pose" in settings:
        rotation, place = settings.pop("pose")
        camera_topics.camera = CAMERA.moved(rotation, np.array(place))
    camera_topics.place(settings.pop("placed", FRAME))
    vars(camera_topics).update(settings)
    camera_topics.show_until(picture, lambda: camera_topics.says(text), "the diagnostic")
    assert not graph.heard["detections"]


def test_bodies_without_tags_are_refused(graph, tmp_path):
    path = tmp_path / "bodies.yaml"
    path.write_text("bodies: [{shape: disk, radius: 0.06}]")
    with pytest.raises(ConfigError, match=r"no body in .* has tags; give 'tags' to one of them"):
        graph.start(TagNode, bodies=str(path))


@pytest.mark.parametrize("encoding", ["mono8", "rgb8", "bgr8", "rgba8", "bgra8"])
def test_encodings_of_one_grey_are_one_image(encoding):
    grey = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20
    channels = 1 if encoding == "mono8" else len(encoding) - 1
    pixels = np.full((3, 4, channels), 255, np.uint8)
    pixels[..., : min(channels, 3)] = grey[..., None]
    padded = np.pad(pixels.reshape(3, -1), ((0, 0), (0, 5)))
    message = Image(height=3, width=4, encoding=encoding, step=padded.shape[1])
    message.data = padded.ravel().tolist()
    np.testing.assert_array_equal(decode_grey(message), grey)


def test_rectified_images_are_refused(graph, camera_topics, bodies, picture):
    remapped = ["--ros-args", "-r", "camera/color/image_raw:=camera/color/image_rect"]
    given = [Parameter("bodies", value=bodies)]
    graph.add(TagNode(context=graph.context, cli_args=remapped, parameter_overrides=given))
    camera_topics.place()
    text = "image_rect are rectified, and raw ones are needed: K and D are used, not P and R"
    camera_topics.show_until(picture, lambda: camera_topics.says(text), "the diagnostic")


@pytest.mark.system
def test_a_node_that_is_late_with_images_still_gives_signs_of_life(ros_domain, bodies, monkeypatch):
    """Images come twice as fast as it looks at them: no timer stays in line behind them."""
    monkeypatch.setattr(CameraInput, "_on_frame", lambda *_: time.sleep(0.1))
    beats, end = list[float](), time.monotonic() + 8.0
    with ros_context():
        node = TagNode(parameter_overrides=[Parameter("bodies", value=bodies)])
        camera, executor = Node("camera", namespace="sain"), executor_of(TagNode)
        steady_timer(node, 0.25, lambda: beats.append(time.monotonic()))
        executor.add_node(node)
        images = camera.create_publisher(Image, "camera/color/image_raw", 1)
        message = Image(width=1, height=1, step=1, encoding="mono8", data=[0])

        def film() -> None:
            while time.monotonic() < end:
                images.publish(message)
                time.sleep(0.05)

        with ThreadPoolExecutor(1) as pool:
            pool.submit(film)
            while time.monotonic() < end:
                executor.spin_once(timeout_sec=0.1)
        node.destroy_node()
        camera.destroy_node()
        executor.shutdown()
    assert len(beats) > 10 and max(np.diff(beats)) < 1.0
