"""The way of a push before it is made: markers for RViz."""

from typing import Final

import numpy as np
from geometry_msgs.msg import Point
from rclpy.node import Node
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from sain_arm.planning.push_planner import PushPlan
from sain_arm.planning.timing import Trajectory
from sain_arm.robot.arm_model import ArmModel
from sain_core.ros import codec
from sain_core.ros.qos import LATCHED

POSTURES: Final = 9  # of the arm that are drawn along a way
POINTS: Final = 60  # of the tip's line
WAY = ColorRGBA(r=0.1, g=0.5, b=0.9, a=0.9)
PUSH = ColorRGBA(r=0.9, g=0.3, b=0.1, a=0.9)
GHOST = ColorRGBA(r=0.4, g=0.4, b=0.45, a=0.5)


class Ghost:
    """Publishes where the tool will go, and postures of the arm on its way, as lines."""

    def __init__(self, node: Node) -> None:
        """Create the publisher."""
        self._node = node
        self._publisher = node.create_publisher(MarkerArray, "ghost", LATCHED)

    def show(self, arm: ArmModel, plan: PushPlan) -> None:
        """Show a plan in place of the one before."""
        ways = ((plan.approach, WAY), (plan.stroke, PUSH))
        markers = [Marker(action=Marker.DELETEALL)]
        for number, (way, colour) in enumerate(ways):
            tips = [arm.tip(way.at(time)[0]) for time in np.linspace(0.0, way.duration, POINTS)]
            markers.append(self._line("tip", number, tips, 0.004, colour))
            for index, posture in enumerate(_postures(way)):
                links = arm.skeleton(posture)
                name = f"posture_{number}"
                markers.append(self._line(name, index, links, 0.015, GHOST))
        self._publisher.publish(MarkerArray(markers=markers))

    def _line(
        self, name: str, number: int, points: list[np.ndarray], width: float, colour: ColorRGBA
    ) -> Marker:
        stamp = self._node.get_clock().now().to_msg()
        marker = Marker(header=codec.header(stamp), ns=name, id=number, type=Marker.LINE_STRIP)
        marker.scale.x, marker.color, marker.pose.orientation.w = width, colour, 1.0
        marker.points = [Point(x=x, y=y, z=z) for x, y, z in np.array(points).tolist()]
        return marker


def _postures(way: Trajectory) -> list[np.ndarray]:
    return [way.at(time)[0] for time in np.linspace(0.0, way.duration, POSTURES)]
