"""Images of a world: what is where, what hides what, and the errors that the settings ask for."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from sain_arm.robot.robot import read_robot
from sain_core.camera.image_camera import ImageCamera, ImageCameraConfig, Shot
from sain_core.errors import ConfigError
from sain_core.scene import DISK_HEIGHT, POSE, make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.body_file import Tag
from sain_sim.camera.renderer import image_camera
from sain_vision.detection.tags import TagConfig, TagFinder, TagLocator
from sain_vision.optics import CameraModel
from tests.sain_vision.pictures import file_of

BODIES = Bodies.named(("disk", "t"))
RADII = (0.08, 0.1)
SCENE = make_scene(
    np.array([(0.45, 0.0), (0.6, 0.2)]), np.full(2, 8.0), np.array(RADII), np.array([0.3, 2])
)
CLEAN = {"noise": 0.0, "depth_noise": 0.0, "blur": 0.0}


class World(NamedTuple):
    """A robot, with joints away from the table's middle, and over the first body."""

    robot: str
    away: tuple[float, ...]
    reaching: tuple[float, ...]

    def camera(self, config: ImageCameraConfig, tops: tuple[float, ...] = ()) -> ImageCamera:
        return image_camera(config, read_robot(self.robot), replace(BODIES, heights=tops), RADII)


WORLDS = {
    "paper_panda": World(
        "paper_panda", (0.0, -0.9, 0.0, -2.6, 0.0, 1.8, 0.78), (0, 0.75, 0, -1.2, 0, 1.9, 0)
    ),
    "ur5": World("ur5", (1.6, -1.57, 1.57, -1.57, -1.57, 0), (-0.2, -0.9, 1.3, -1.97, -1.57, 0)),
}


@pytest.fixture(scope="module", params=WORLDS)
def world(request):
    return WORLDS[request.param]


@pytest.fixture(scope="module")
def shot(world):
    return shoot(world)


def shoot(
    world: World, joints: tuple[float, ...] = (), tops: tuple[float, ...] = (), **config: object
) -> Shot:
    camera = world.camera(ImageCameraConfig(**(CLEAN | config)), tops)
    return camera.take(np.array(joints or world.away), SCENE, np.random.default_rng(0))


def model_of(config: ImageCameraConfig) -> CameraModel:
    rotation, place = config.stated_pose
    lens = np.array(config.distortion)
    return CameraModel(config.width, config.height, config.matrix, lens, rotation, place)


def seen(
    shot: Shot, config: ImageCameraConfig, tops: tuple[float, ...] = ()
) -> dict[int, np.ndarray]:
    grey = shot.colour.mean(axis=2).round().astype(np.uint8)
    file, settings = file_of((Tag(0),), (Tag(1),)), TagConfig()
    file = replace(file, bodies=replace(file.bodies, heights=tops))
    found, _ = TagLocator(file, settings).locate(TagFinder(settings).find(grey), model_of(config))
    return {one.body: one.pose for one in found}


@pytest.mark.parametrize("lens", [(0.0,) * 5, (-0.1, 0.03, 0.001, -0.001, 0.0)])
def test_tags_are_where_the_bodies_are(world, lens):
    poses = seen(shoot(world, distortion=lens), ImageCameraConfig(distortion=lens))
    assert set(poses) == {0, 1}
    for body, pose in poses.items():
        np.testing.assert_allclose(pose, SCENE[body, POSE], atol=0.0005)


def test_a_tag_lies_on_the_top_of_its_body(world):
    tops = (DISK_HEIGHT, 0.12)
    poses = seen(shoot(world, tops=tops), ImageCameraConfig(), tops)
    for body in (0, 1):
        np.testing.assert_allclose(poses[body], SCENE[body, POSE], atol=0.0005)


def test_depth_is_the_distance_along_the_optical_axis(shot):
    model = model_of(ImageCameraConfig())
    places = np.array([(0.45, 0.05, DISK_HEIGHT), (0.8, -0.3, 0.0)])
    for pixel, place in zip(model.project(places).round().astype(int), places, strict=True):
        along = (place - model.place) @ model.rotation[:, 2]
        assert shot.depth[pixel[1], pixel[0]] == pytest.approx(1000 * along, abs=4)


def test_a_calibration_that_is_wrong_on_purpose_moves_all_poses_alike(shot):
    wrong = ImageCameraConfig(misplaced=(0.01, 0.0, 0.0))
    for body, pose in seen(shot, wrong).items():
        np.testing.assert_allclose(pose[:2] - SCENE[body, :2], (0.01, 0.0), atol=0.0005)


def test_the_arm_hides_what_is_behind_it(world):
    assert 0 not in seen(shoot(world, world.reaching), ImageCameraConfig())


def test_noise_exposure_and_blur_are_as_set(world, shot):
    noisy, dark = shoot(world, noise=5.0, depth_noise=0.002), shoot(world, exposure=0.5)
    flat = np.s_[560:640, 400:800]  # of the table
    spread = noisy.colour[flat].astype(float) - shot.colour[flat]
    assert np.std(spread) == pytest.approx(5.0, rel=0.1)
    spread = noisy.depth[flat].astype(float) - shot.depth[flat]
    assert np.std(spread) == pytest.approx(2.0, rel=0.1)
    ratio = dark.colour.astype(float).mean() / shot.colour.astype(float).mean()
    assert ratio == pytest.approx(0.5, abs=0.01)
    edges = [
        np.abs(np.diff(s.colour[..., 0].astype(float))).max()
        for s in (shot, shoot(world, blur=2.0))
    ]
    assert edges[1] < edges[0] / 2


@pytest.mark.parametrize("eye", [(0.5, 0.0, 1.0), (0.5, 0.0, 0.0)])
def test_a_camera_whose_image_has_no_upright_is_refused(eye):
    with pytest.raises(ConfigError, match=r"looks straight up or down at .* no upright; move eye"):
        ImageCameraConfig(eye=eye, focus=(0.5, 0.0, 0.0))
