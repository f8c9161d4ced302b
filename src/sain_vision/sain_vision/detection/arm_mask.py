"""Where an image shows the robot's arm: its own geometry, at its own joints."""

from functools import partial
from typing import Final

from jaxtyping import Bool
from numpy import ndarray

from sain_arm.robot.arm_model import ArmModel
from sain_arm.robot.robot import Robot, Vector
from sain_arm.robot.silhouette import Silhouettes
from sain_vision.optics import CameraModel

MARGIN: Final = 3  # [px] about the arm, for errors of the calibration and of its joints


class ArmMask:
    """The convex hulls of an arm's links and tool, as a camera sees them."""

    def __init__(self, robot: Robot) -> None:
        self._arm = ArmModel(robot)
        model = self._arm.model
        links = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] > 0]
        self._silhouettes = Silhouettes(model, links)

    def draw(self, joints: Vector, camera: CameraModel) -> Bool[ndarray, "height width"]:
        """Return which pixels of a camera may show the arm with joints (J,)."""
        self._arm.set_joints(joints)
        size = camera.width, camera.height
        project = partial(camera.project, rim=True)
        return self._silhouettes.draw(self._arm.data, project, *size, MARGIN)
