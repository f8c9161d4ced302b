import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sain_sim.camera.render import CameraConfig, Renderer
from sain_sim.camera.scenery import candidate_eyes, rank_eyes, segment_distances, visible
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.workcell import WorldConfig

CAMERA = CameraConfig(width=160, height=120, oversampling=1)
EYE, FOCUS = np.array(CAMERA.eye), np.array(CAMERA.focus)
POINTS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)


@given(POINTS, POINTS, POINTS, POINTS)
def test_segments_are_as_far_apart_as_their_nearest_points(eye, end, first, second):
    shares = np.linspace(0.0, 1.0, 60)[:, None]
    one, other = eye + shares * (end - eye), first + shares * (second - first)
    nearest = np.linalg.norm(one[:, None] - other[None], axis=-1).min()
    found = float(segment_distances(eye, end, first, second))
    assert found <= nearest + 1e-9
    assert found >= nearest - 0.06  # of the samples' spacing


def test_what_lies_behind_a_capsule_is_hidden():
    capsules = np.array([[[[0.5, 0.0, -1.0], [0.5, 0.0, 1.0]]]])
    places = np.array([[[1.0, 0.0, 0.0], [1.0, 0.3, 0.0], [0.2, 0.0, 0.0]]])
    seen = visible(np.zeros(3), capsules, np.array([0.1]), places)
    assert seen.tolist() == [[False, True, True]]


def test_the_default_eye_is_kept_when_nothing_is_in_the_way():
    eyes = candidate_eyes(EYE, FOCUS)
    assert np.allclose(eyes[0], EYE)
    assert np.allclose(np.linalg.norm(eyes - FOCUS, axis=1), np.linalg.norm(EYE - FOCUS))
    away = np.full((1, 1, 2, 3), 9.0)
    places = np.array([[[0.5, 0.0, 0.0]]])
    assert np.allclose(rank_eyes(eyes, away, np.array([0.1]), [places])[0], EYE)


@pytest.fixture(scope="module")
def renderer():
    scene = nominal_parameters().scene(np.array([[0.45, 0.0], [0.6, 0.0]]))
    with Renderer(scene, camera=CAMERA) as renderer:
        yield renderer


@pytest.mark.parametrize("target", [(0.45, 0.15), (0.45, -0.1), (0.49, 0.0), (0.4, 0.2)])
def test_target_and_goal_are_seen_in_every_picture(renderer, target):
    """The tool comes down all about the target, so that from anywhere the hand once stands before
    it or near it; the mask of the renderer tells what is seen.
    """
    target, goal, ring = np.array(target), np.array([0.5, -0.22]), 0.08
    kinematics = WorldConfig().kinematics
    moments = []
    for turn in np.linspace(-np.pi, np.pi, 9)[:-1]:
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


def test_without_a_goal_no_pixel_shows_one(renderer):
    scene = nominal_parameters().scene(np.array([[0.45, 0.0], [0.6, 0.0]]))
    joints = WorldConfig().kinematics.joints(np.array([0.35, 0.0, 0.09]))
    renderer.look_from(EYE)
    renderer.picture(joints, scene)
    assert renderer.pixels.target > 20 and renderer.pixels.goal == 0
    renderer.picture(joints, scene, np.array([0.6, 0.2]))
    assert renderer.pixels.goal > 5


def test_the_capsules_hold_the_stick_and_the_hand(renderer):
    joints = WorldConfig().kinematics.joints(np.array([0.5, 0.1, 0.03]))
    capsules = renderer._capsules(joints)
    assert np.allclose(capsules[-1, 1], [0.5, 0.1, 0.03], atol=2e-3)
    assert np.allclose(capsules[1:, 0], capsules[:-1, 1])
