import numpy as np
import pytest

from sain_sim.camera.render import CameraConfig, Renderer
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.workcell import WorldConfig

CAMERA = CameraConfig(width=160, height=120, oversampling=1)
EYE, FOCUS = np.array(CAMERA.eye), np.array(CAMERA.focus)


@pytest.fixture(scope="module")
def renderer():
    scene = nominal_parameters().scene(np.array([[0.45, 0.0], [0.6, 0.0]]))
    with Renderer(scene, camera=CAMERA) as renderer:
        yield renderer


@pytest.mark.parametrize("target", [(0.45, 0.15), (0.49, 0.0)])
def test_target_and_goal_are_seen_in_every_picture(renderer, target):
    """The tool comes down all about the target, so that from anywhere the hand once stands before
    it or near it; the mask of the renderer tells what is seen.
    """
    target, goal, ring = np.array(target), np.array([0.5, -0.22]), 0.08
    kinematics = WorldConfig().kinematics
    moments = []
    for turn in np.linspace(-np.pi, np.pi, 5)[:-1]:
        way = np.array([np.cos(turn), np.sin(turn)])
        scene = nominal_parameters().scene(np.stack([target + 0.15 * way, target]))
        moments.append((kinematics.joints(np.array([*(target + 0.24 * way), 0.02])), scene))

    def shares(eye):
        renderer.look_from(eye)
        found = []
        for joints, scene in moments:
            renderer.picture(joints, scene, goal, ring)
            found.append(tuple(renderer.pixels))
        return np.array(found)

    chosen = shares(renderer.eyes(moments, goal, ring)[0])
    assert (chosen > 0).all()
    assert chosen[:, 0].min() >= shares(EYE)[:, 0].min()
