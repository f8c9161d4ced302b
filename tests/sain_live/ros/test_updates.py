"""What the page hears: messages that cannot be, or are of another episode, change nothing."""

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, TransformStamped
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from sain_core.errors import InvalidInputError
from sain_core.ros import codec
from sain_core.ros.node_main import OK, WARN
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.wire.scene_door import SeenScene
from sain_live.ros.updates import StateUpdater
from sain_live.state import Level, LiveState

SCENE = make_scene(np.array([(0.4, 0.0), (0.6, 0.2)]), np.full(2, 8.0), np.full(2, 0.06))
TEE, BOX = Bodies.named(["t", "disk"]), Bodies.named(["box_3x2", "disk"])


@pytest.fixture
def state():
    return LiveState()


@pytest.fixture
def updater(state) -> StateUpdater:
    return StateUpdater(state, lambda: True)


def scene(episode_id, scene_id=1):
    ids = {"episode_id": episode_id, "scene_id": scene_id}
    return codec.encode_scene(SCENE, stamp=Time(), settled=True, **ids)


def shapes(bodies, episode_id):
    return codec.encode_bodies(bodies, [0.06, 0.06], stamp=Time(), episode_id=episode_id)


def test_shapes_of_another_episode_wait_for_its_scenes(state, updater):
    updater._on_scene(scene(1))
    assert state.scene is None  # its shapes are on their way
    updater._on_bodies(shapes(BOX, 7))
    updater._on_bodies(shapes(TEE, 1))
    assert (state.scene.episode_id, state.bodies) == (1, TEE)
    for episode in range(100, 200):
        updater._on_bodies(shapes(BOX, episode))
    updater._on_scene(scene(1, 2))
    assert (state.scene.scene_id, state.bodies) == (2, TEE)
    updater._on_scene(scene(199))
    assert (state.scene.episode_id, state.bodies) == (199, BOX)


def test_joints_of_unequal_lengths_are_refused(state, updater):
    updater._on_joints(JointState(name=["a"], position=[0.5]))
    wrong = JointState(name=["a", "b", "c"], position=[0.1, 0.2])
    with pytest.raises(InvalidInputError, match="3 names and 2 positions; allowed: as many"):
        updater._on_joints(wrong)
    assert state.joints == {"a": 0.5}


def fixed(child, x):
    frame = TransformStamped(child_frame_id=child)
    frame.header.frame_id = "world"
    frame.transform.translation.x = x
    return frame


def test_the_arm_stands_on_its_root_and_not_on_the_camera(state, updater):
    hear = {topic: take for topic, (_, take) in updater.handlers.items()}
    hear["/tf_static"](TFMessage(transforms=[fixed("camera_link", 1.5)]))
    hear["/robot_description"](String(data="<robot/>"))
    hear["/tf_static"](TFMessage(transforms=[fixed("base", 0.3)]))
    places = {name: place[0] for name, (place, _) in state.arm.frames.items()}
    assert places == {"camera_link": 1.5, "base": 0.3}


def test_a_way_becomes_lines_and_the_next_one_replaces_it(state, updater):
    def way(*xs):
        points = [Point(x=float(x)) for x in xs]
        strip = Marker(type=Marker.LINE_STRIP, points=points)
        strip.scale.x, strip.color.r = 0.004, 1.0
        return MarkerArray(markers=[Marker(action=Marker.DELETEALL), strip])

    updater._on_ghost(way(0, 1, 2))
    (line,) = state.ghost
    assert (line.points[:, 0].tolist(), line.width, line.colour) == ([0, 1, 2], 0.004, (255, 0, 0))
    with pytest.raises(InvalidInputError, match="NaN or Inf"):
        updater._on_ghost(way(0, np.nan))
    updater._on_ghost(way(5, 6))
    assert state.ghost[0].points[:, 0].tolist() == [5, 6]


def test_a_picture_is_made_small_and_has_its_colours(state, updater):
    pixels = np.zeros((20, 1280, 3), np.uint8)
    pixels[..., 0] = 200  # blue
    about = {"encoding": "bgr8", "step": 3 * 1280}
    picture = Image(height=20, width=1280, data=pixels.tobytes(), **about)
    updater.on_picture(picture)
    assert state.picture.shape == (10, 640, 3) and state.picture[0, 0].tolist() == [0, 0, 200]
    picture.height = 30
    with pytest.raises(InvalidInputError, match="1280 x 30 px"):
        updater.on_picture(picture)


def test_the_time_of_a_robot_begins_with_the_page(state, updater):
    for seconds in (1_795_716_544, 1_795_716_554):
        message = scene(1, seconds % 100)
        message.header.stamp = Time(sec=seconds)
        updater._early = None
        updater._see(seen_scene(message))
    assert state.time == 10.0


def seen_scene(message):
    return SeenScene(SCENE, 1, message.scene_id, True, codec.decode_time(message.header.stamp))


def test_later_trouble_of_a_node_is_a_fault_until_it_is_well(state, updater):
    report = updater.handlers["/diagnostics"][1]
    for level, text in (
        (OK, "ready"), (WARN, "the model failed"), (WARN, "the model failed"), (OK, "pushing")
    ):  # fmt: skip
        status = DiagnosticStatus(level=level, name="/sain/mppi_node: planning", message=text)
        report(DiagnosticArray(status=[status]))
    assert [(line.kind, line.text) for line in state.log] == [
        (Level.FAULT, "planner: the model failed"),
        (Level.NOTE, "planner: pushing"),
    ]
