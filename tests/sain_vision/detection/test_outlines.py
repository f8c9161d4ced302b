"""Bodies without tags in depth images: exact, also where the arm hides a part, and held apart."""

import re
from dataclasses import replace

import numpy as np
import pytest

from sain_arm.robot.robot import read_robot
from sain_core.camera.image_camera import ImageCamera, ImageCameraConfig
from sain_core.scene import DISK_HEIGHT, POSE, make_scene, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_sim.camera.renderer import image_camera
from sain_vision.detection.outlines import OutlineConfig, OutlineFinder
from sain_vision.optics import CameraModel
from tests.sain_vision.pictures import file_of

SHAPES = ("disk", "t:flat")
RADII = (0.07, 0.1)
FILE = replace(file_of((), ()), bodies=Bodies.named(SHAPES), radii=RADII)
START = make_scene(np.array([(0.45, -0.14), (0.5, 0.14)]), np.full(2, 8.0), np.array(RADII))
AWAY = np.array([0.0, -0.9, 0.0, -2.6, 0.0, 1.8, 0.78])
CONFIG = replace(
    ImageCameraConfig(), width=640, height=480, detail=1.0, tag_size=0.0, field_of_view=50.0,
    eye=(1.0, 0.1, 0.8), focus=(0.5, 0.0, 0.0),
)  # fmt: skip
CAMERA = CameraModel(640, 480, CONFIG.matrix, np.zeros(5), *CONFIG.stated_pose)


def camera_of(config: ImageCameraConfig) -> ImageCamera:
    return image_camera(config, read_robot("paper_panda"), FILE.bodies, FILE.radii)


@pytest.fixture(scope="module")
def camera():
    return camera_of(CONFIG)


def look(camera: ImageCamera, scene: np.ndarray, seed: int = 0) -> np.ndarray:
    depth = camera.take(AWAY, scene, np.random.default_rng(seed)).depth * 1e-3
    return np.where(depth > 0.0, depth, np.nan)


def errors(sightings, scene: np.ndarray) -> np.ndarray:
    found = {one.body: one.pose for one in sightings}
    off = np.stack([found[body] - scene[body, POSE] for body in range(len(scene))])
    off[:, 2] = wrap_angle(off[:, 2])
    return off


@pytest.mark.parametrize("seed", range(3))
def test_bodies_are_found_anywhere(camera, seed):
    random, scene = np.random.default_rng(seed), START.copy()
    scene[:, :2] += random.uniform(-0.05, 0.05, (2, 2))
    scene[:, 2] = random.uniform(-3.0, 3.0, 2)
    finder = OutlineFinder(FILE, OutlineConfig())
    sightings, problems = finder.find(look(camera, scene, seed), CAMERA, {})
    assert not problems
    off = errors(sightings, scene)
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.0025
    assert abs(off[1, 2]) < np.radians(1.5)
    assert sightings[0].covariance[2, 2] > 1.0  # a disk's heading is not seen


def test_a_body_half_under_the_arm_is_held_and_not_moved(camera):
    depth = look(camera, START)
    left = CAMERA.project(np.array([[*START[1, :2], DISK_HEIGHT]]))[0]
    depth[:, int(left[0]) :] -= 0.3  # something high above the right half of the T and all beyond
    known = {1: [START[1, POSE] + (0.004, -0.003, 0.05)]}
    finder = OutlineFinder(FILE, OutlineConfig(least_share=0.3))
    sightings, _ = finder.find(depth, CAMERA, known, everywhere=False)
    (seen,) = (one for one in sightings if one.body == 1)
    assert np.hypot(*(seen.pose - START[1, POSE])[:2]) < 0.004
    assert seen.score < 0.9


def test_what_is_not_there_is_not_found(camera):
    bare = START.copy()
    bare[1, :2] = (0.5, 5.0)
    finder = OutlineFinder(FILE, OutlineConfig())
    sightings, problems = finder.find(look(camera, bare), CAMERA, {1: [START[1, POSE]]})
    assert [one.body for one in sightings] == [0]
    assert problems == ["body 1 (body_1) is not seen"]


@pytest.mark.parametrize("height", [0.02, 0.1])
def test_a_body_that_lies_on_its_side_is_named(height):
    lies = Bodies.named(("disk", "box_2x1"), heights=(DISK_HEIGHT, height))
    camera = image_camera(CONFIG, read_robot("paper_panda"), lies, RADII)
    aside, arm = START.copy(), np.zeros((480, 640), dtype=bool)
    aside[1, :2] += (0.03, 0.02)
    depth = look(camera, aside)
    known = {body: [START[body, POSE]] for body in (0, 1)}
    sightings, (problem,) = OutlineFinder(FILE, OutlineConfig()).find(depth, CAMERA, known, arm=arm)
    assert [one.body for one in sightings] == [0]
    words = (
        r"body 1 \(body_1\) is not seen; what stands where it was is (\d+) mm high, and its top 40"
    )
    assert float(re.match(words, problem)[1]) == pytest.approx(1e3 * height, abs=3.0)
    assert "it may have tipped over; stand it up again" in problem


def test_one_straight_edge_is_no_body():
    above = replace(CAMERA, rotation=np.diag([1.0, -1.0, -1.0]), place=np.array([0.5, 0.0, 1.0]))
    depth = np.full((480, 640), np.nan)
    depth[:, 300:340] = 1.0
    depth[:240, 300:340] -= DISK_HEIGHT  # of a board no other edge is seen
    x, y = above.on_plane(np.array([[320.0, 239.5]]), DISK_HEIGHT)[0]
    square = replace(file_of(()), bodies=Bodies.named(("square",)), radii=(0.1,))
    finder = OutlineFinder(square, OutlineConfig(least_share=0.1))
    sightings, problems = finder.find(depth, above, {0: [np.array([x, y + 0.0707, 0.0])]})
    assert (sightings, len(problems)) == ([], 1)


def test_an_image_full_of_edges_is_searched_in_time_and_says_so(camera):
    """Bodies lie among small blocks of their height; a search of all blocks takes minutes."""
    depth, rows, columns = look(camera, START), *np.mgrid[:480, :640]
    grid = np.stack(np.meshgrid(np.arange(640), np.arange(480)), axis=-1).reshape(-1, 2)
    rays = CAMERA.rays(grid.astype(float)).reshape(480, 640, 3)
    blocks = (rows % 26 < 12) & (columns % 26 < 12) & (columns < 160)
    depth[blocks] = ((DISK_HEIGHT - CAMERA.place[2]) / rays[..., 2])[blocks]
    three = replace(
        file_of((), (), ()), bodies=Bodies.named((*SHAPES, "square")), radii=(*RADII, 0.2)
    )
    sightings, problems = OutlineFinder(three, OutlineConfig()).find(depth, CAMERA, {})
    assert np.hypot(*errors(sightings, START)[:, :2].T).max() < 0.0025
    assert problems[0] == "body 2 (body_2) is not seen"
    assert "candidate outlines, more than can be tried in time: only the 16 largest" in problems[1]
