"""Where an image shows the arm: all of it, and little else."""

from dataclasses import replace

import numpy as np
import pytest

from sain_arm.robot.robot import read_robot, shipped
from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.shapes.body_file import parse_bodies
from sain_sim.camera.renderer import Renderer
from sain_vision.detection.arm_mask import ArmMask
from sain_vision.optics import CameraModel

CONFIG = replace(ImageCameraConfig(), width=640, height=480)
CAMERA = CameraModel(640, 480, CONFIG.matrix, np.zeros(5), *CONFIG.stated_pose)
BODIES = parse_bodies({"bodies": [{"shape": "t:flat", "radius": 0.09}]})


@pytest.mark.parametrize("name", shipped())
def test_the_mask_has_every_pixel_of_the_arm_and_few_others(name):
    robot, random = read_robot(name), np.random.default_rng(0)
    view, mask = Renderer(robot, BODIES.bodies, BODIES.radii, CONFIG), ArmMask(robot)
    scene = BODIES.scene(np.array([[0.5, -0.2, 0.3]]))
    for _ in range(5):
        joints = robot.home + random.uniform(-0.4, 0.4, len(robot.joints))
        shown = view.drawing(joints, scene, 640, 480).hides
        masked = mask.draw(joints, CAMERA)
        assert not (shown & ~masked).any()
        assert (masked & ~shown).mean() < 0.03
