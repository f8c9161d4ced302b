import numpy as np
import pytest

from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.errors import ConfigError
from sain_core.shapes.library import get_shape
from sain_core.shapes.solids import DISK
from sain_sim.camera.render import Renderer
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.workcell import WorldConfig

CAMERA = ImageCameraConfig(width=160, height=90)
T = "t"
JOINTS = WorldConfig().kinematics.joints(np.array([0.35, 0.0, 0.09]))


@pytest.fixture(scope="module")
def renderer():
    scene = nominal_parameters().scene(np.array([[0.45, 0.0], [0.6, 0.0]]))
    with Renderer(scene, (DISK, "cube"), CAMERA) as renderer:
        yield renderer


def test_a_picture_shows_disks_where_they_are(renderer):
    here = nominal_parameters().scene(np.array([[0.45, 0.0], [0.6, 0.0]]))
    there = nominal_parameters().scene(np.array([[0.45, 0.0], [0.75, 0.25]]))
    first = renderer.picture(JOINTS, here)
    assert first.shape == (90, 160, 3) and first.dtype == np.uint8
    assert np.array_equal(renderer.picture(JOINTS, here), first)
    orange = [
        (p[..., 0] > 180) & (p[..., 2] < 90) for p in (first, renderer.picture(JOINTS, there))
    ]
    assert orange[0].sum() > 20 and orange[1].sum() > 20
    assert not (orange[0] & orange[1]).all(where=orange[0])


def test_the_goal_is_drawn_only_when_there_is_one(renderer):
    scene = nominal_parameters().scene(np.array([[0.45, 0.0], [0.6, 0.0]]))
    bare = renderer.picture(JOINTS, scene)
    with_goal = renderer.picture(JOINTS, scene, np.array([0.8, 0.1]))
    changed = np.abs(with_goal.astype(int) - bare).max(axis=-1) > 20
    assert 5 < changed.sum() < 400
    assert np.array_equal(renderer.picture(JOINTS, scene), bare)


def test_a_goal_with_a_heading_is_shown_as_the_outline_of_the_body():
    scene = nominal_parameters().scene(np.array([[0.45, 0.0], [0.6, 0.0]]))
    goal = np.array([0.7, 0.2])
    with Renderer(scene, (T, "cube"), CAMERA) as renderer:
        bare = renderer.picture(JOINTS, scene)
        ringed = renderer.picture(JOINTS, scene, goal)
        there = scene[0].copy()
        there[:2] = goal
        renderer.mark_goal(get_shape(T).placed(there))
        marked = renderer.picture(JOINTS, scene, goal)
    changed = [np.abs(p.astype(int) - bare).max(axis=-1) > 20 for p in (ringed, marked)]
    assert changed[0].any() and changed[1].any() and (changed[0] != changed[1]).any()


def test_a_window_without_a_screen_is_refused_in_words(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    scene = nominal_parameters().scene(np.array([[0.45, 0.0], [0.6, 0.0]]))
    with pytest.raises(ConfigError, match="DISPLAY is not"):
        Renderer(scene, gui=True)
