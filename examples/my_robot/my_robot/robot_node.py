"""A robot's driver: carries out pushes. `PushDriver` answers each with its result."""

from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
from rclpy.node import Node

from my_robot.pretend_table import RATE, PretendTable, RobotConfig
from sain_core import wire
from sain_core.feasibility import Feasibility, Stroke
from sain_core.ros import codec
from sain_core.ros.node_main import NAMESPACE, node_main, steady_timer
from sain_core.ros.parameters import read_parameters
from sain_core.ros.push_driver import PushDriver
from sain_core.ros.qos import RELIABLE
from sain_core.scene import THETA
from sain_interfaces.msg import Push

ARM = Feasibility()  # where this arm reaches, and its tool


class RobotNode(Node):
    """Carries out one push at a time. The converter makes scenes of its camera's poses."""

    def __init__(self, **options: Any) -> None:
        """Set the table and wait for pushes."""
        super().__init__("robot_node", namespace=NAMESPACE, **options)
        self.table = PretendTable(read_parameters(self, RobotConfig))
        self.driver = PushDriver(self, self._begin, ARM)
        self.poses = self.create_publisher(PoseArray, "poses", RELIABLE)
        self.truth = self.create_publisher(PoseArray, "true_poses", RELIABLE)  # for who judges
        self.driver.reception.listen(PoseArray, "set_up", self._on_set_up, RELIABLE)
        steady_timer(self, 1.0 / RATE, self._on_frame)
        self.ready = f"{len(self.table.bodies)} bodies on the table"

    @property
    def now(self) -> float:
        """The time [s]."""
        return float(self.get_clock().now().nanoseconds * 1e-9)

    def _begin(self, push: Push, stroke: Stroke) -> None:
        """Push: here a real robot moves, and calls `finish` when its stroke is over."""
        self.driver.finish(self.table.push(wire.decode_push(push), self.now))

    def _on_frame(self) -> None:
        """Do what the camera does: publish where the bodies are."""
        now = self.now
        seen, stamp = self.table.look(now), codec.encode_time(round(1e9 * now))
        self.poses.publish(encode_poses(seen, stamp))
        self.truth.publish(encode_poses(self.table.scene[:, : THETA + 1], stamp))

    def _on_set_up(self, message: PoseArray) -> None:
        """Let a person put the bodies elsewhere; their push, if there is one, comes to nothing."""
        rows = [
            (p.position.x, p.position.y, 2 * np.arctan2(p.orientation.z, p.orientation.w))
            for p in message.poses
        ]
        self.table.set_up(np.array(rows))

    def destroy_node(self) -> None:
        """Let another driver have the results."""
        super().destroy_node()
        self.driver.release_namespace()


def encode_poses(poses: np.ndarray, stamp: Time) -> PoseArray:
    """Return poses (N, 3) as a message."""
    message = PoseArray(header=codec.header(stamp))
    for x, y, theta in poses.tolist():
        turn = Quaternion(z=float(np.sin(theta / 2)), w=float(np.cos(theta / 2)))
        message.poses.append(Pose(position=Point(x=x, y=y), orientation=turn))
    return message


def main() -> None:
    """Run the node."""
    node_main(RobotNode, "robot_node")


if __name__ == "__main__":
    main()
