"""Where the arm is in images, by ``/joint_states``."""

from typing import TYPE_CHECKING

from jaxtyping import Bool
from numpy import ndarray
from sensor_msgs.msg import JointState

from sain_core.errors import BusyError
from sain_vision.optics import CameraModel

if TYPE_CHECKING:
    pass


class ArmWatch:
    """Masks a robot's arm."""

    def __init__(self, robot: str, max_age: float) -> None:
        """Take joints that are at most so old [s].

        Raises:
            ConfigError: the robot's file cannot be used.
        """
        # MuJoCo, which these need, is not there without a robot arm.
        from sain_arm.robot.robot import read_robot
        from sain_arm.ros.joint_listener import JointListener
        from sain_vision.detection.arm_mask import ArmMask

        read = read_robot(robot)
        self._joints: JointListener = JointListener(read, max_age)
        self._mask: ArmMask = ArmMask(read)

    def listen(self, message: JointState) -> None:
        """Take where the joints are."""
        self._joints.listen(message)

    def mask(self, camera: CameraModel) -> tuple[Bool[ndarray, "height width"] | None, str]:
        """Return which pixels may show the arm; None where that is not known, and why."""
        try:
            return self._mask.draw(self._joints.current, camera), ""
        except BusyError as error:
            return None, f"the arm is masked by its height alone: {error}"
