"""The node that finds bodies without tags: depth images in, poses with covariance out."""

from time import monotonic
from typing import Any

import numpy as np
from sensor_msgs.msg import Image, JointState

from sain_arm.robot.robot import read_robot
from sain_arm.ros.joint_listener import JointListener
from sain_core.errors import BusyError
from sain_core.ros.qos import RELIABLE
from sain_core.scene import POSE, STATE_SIZE
from sain_core.types import Mask
from sain_interfaces.msg import Plan
from sain_vision.detection.arm_mask import ArmMask
from sain_vision.detection.outlines import OutlineFinder, Pose
from sain_vision.detection.sighting import grey_of
from sain_vision.optics import CameraModel
from sain_vision.ros.body_parameter import read_body_file
from sain_vision.ros.images import decode_depth
from sain_vision.ros.settings import DEPTH_TOPICS, OutlineNodeConfig
from sain_vision.ros.sighting_node import Found, SightingNode


class OutlineNode(SightingNode):
    """Publishes the bodies without tags whose tops a depth image shows."""

    settings, topics = OutlineNodeConfig, DEPTH_TOPICS
    what, overlay = "outlines", "camera/outlines"
    config: OutlineNodeConfig

    def __init__(self, **options: Any) -> None:
        super().__init__("outline_node", **options)
        if self.config.robot:
            self._listen_to_arm(self.config)
        self.reception.listen(Plan, "plan", self._on_plan, RELIABLE)
        self.ready = f"outlines of {len(self.bodies.names)} bodies"

    def _listen_to_arm(self, config: OutlineNodeConfig) -> None:
        robot = read_robot(config.robot)
        self._joints, self._arm = JointListener(robot, config.max_age), ArmMask(robot)
        self.reception.listen(JointState, "/joint_states", self._joints.listen, RELIABLE)

    def _mask(self, camera: CameraModel) -> tuple[Mask | None, list[str]]:
        """Return which pixels may show the arm; None where that is not known, and why."""
        if not self.config.robot:
            return None, []
        try:
            return self._arm.draw(self._joints.current, camera), []
        except BusyError as error:
            return None, [f"the arm is masked by its height alone: {error}"]

    def use(self, config: OutlineNodeConfig) -> None:
        """Look for the bodies that a file states."""
        self.config, self.bodies = config, read_body_file(config.bodies)
        self.finder = OutlineFinder(self.bodies, config.outlines)
        self.last: dict[int, Pose] = {}
        self.planned: dict[int, Pose] = {}
        self.next_search = 0.0  # [s]

    def _on_plan(self, message: Plan) -> None:
        """Take note of where the push that was sent should lead the bodies."""
        self.planned = {}
        count = len(self.bodies.names)
        if message.status == Plan.PUSH and message.disks == count and message.horizon > 0:
            scene = np.array(message.predicted[: count * STATE_SIZE]).reshape(count, STATE_SIZE)
            if np.isfinite(scene).all():
                self.planned = dict(enumerate(scene[:, POSE]))

    def find(self, message: Image, camera: CameraModel) -> Found:
        """Find outlines, and the bodies that have them."""
        depth = decode_depth(message)
        known = {
            body: [poses[body] for poses in (self.last, self.planned) if body in poses]
            for body in range(len(self.bodies.names))
        }
        search = monotonic() >= self.next_search
        arm, unmasked = self._mask(camera)
        sightings, problems = self.finder.find(depth, camera, known, everywhere=search, arm=arm)
        if search:
            self.next_search = monotonic() + self.config.search_period
        self.last |= {one.body: one.pose for one in sightings}
        return sightings, problems + unmasked, lambda: grey_of(depth)
