"""Pictures of a world: what is where, in any robot's cell; tests/sain_core/camera has images."""

import numpy as np
import pytest

from sain_arm.robot.robot import read_robot, shipped
from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.errors import ConfigError
from sain_core.scene import POSITION, THETA, Table
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import get_shape
from sain_sim.camera.renderer import Renderer
from sain_sim.camera.window import Window
from sain_sim.world.parameters import nominal_parameters

CAMERA = ImageCameraConfig(width=160, height=90)
BODIES = Bodies.named(("t", "disk"))
SCENE = nominal_parameters().scene(np.array([[0.45, 0.0], [0.6, 0.1]]))
RADII = SCENE[:, -1].tolist()


@pytest.fixture(scope="module", params=shipped())
def renderer(request):
    robot = read_robot(request.param)
    return Renderer(robot, BODIES, RADII, CAMERA), robot.home


def orange(picture: np.ndarray) -> np.ndarray:
    return (picture[..., 0] > 180) & (picture[..., 2] < 90)


def differ(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.abs(first.astype(int) - second).max(axis=-1) > 20


def test_a_picture_shows_the_bodies_as_they_are(renderer):
    view, home = renderer
    first, moved, turned = view.picture(home, SCENE), SCENE.copy(), SCENE.copy()
    assert (first.shape, first.dtype) == ((90, 160, 3), np.uint8)
    assert np.array_equal(view.picture(home, SCENE), first)
    moved[1, POSITION] = (0.75, 0.25)
    there = orange(view.picture(home, moved))
    assert orange(first).sum() > 20 and there.sum() > 20 and not (there & orange(first)).all()
    for body in (0, 1):  # of the disk a mark turns
        turned[:, THETA] = SCENE[:, THETA]
        turned[body, THETA] += 2.0
        assert differ(view.picture(home, turned), first).sum() > 5


def test_the_goal_is_drawn_only_when_there_is_one(renderer):
    view, home = renderer
    bare, there = view.picture(home, SCENE), SCENE[0].copy()
    there[POSITION] = (0.8, -0.2)
    marked = view.picture(home, SCENE, [get_shape("t").placed(there)])
    assert 5 < differ(marked, bare).sum() < 400
    assert np.array_equal(view.picture(home, SCENE), bare)


def test_the_arm_is_seen_where_its_joints_are(renderer):
    view, home = renderer
    seen = [view.drawing(home + turn, SCENE, 320, 180).hides for turn in (0.0, 0.2)]
    assert seen[0].sum() > 100 and (seen[0] != seen[1]).sum() > 50


def test_nothing_is_seen_through_the_table(renderer):
    view, home = renderer
    pixels = np.stack([*np.meshgrid(np.arange(160), np.arange(90)), np.ones((90, 160))], axis=-1)
    rays = pixels @ np.linalg.inv(CAMERA.matrix).T @ CAMERA.rotation.T
    along = -CAMERA.eye[2] / rays[..., 2]
    top = Table().contains((CAMERA.eye + along[..., None] * rays)[..., :2])
    depth = view.drawing(home, SCENE, 160, 90).depth
    assert top.sum() > 1000 and (depth[top] < along[top] + 0.001).all()


def test_a_window_without_a_screen_is_refused_in_words(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(ConfigError, match="DISPLAY is not"):
        Window(Renderer(read_robot("ur5"), BODIES, RADII, CAMERA))
