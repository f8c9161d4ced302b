"""The whole graph with this robot in place of the simulator.

ros2 launch my_robot my_robot.launch.py goal:='0.65 0.1'
"""

from pathlib import Path

import my_robot
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription

GRAPH = Path(get_package_share_directory("sain_bringup"), "launch", "closed_loop.launch.py")
ROBOT = {
    "driver": "ros2 run my_robot robot_node",
    "bodies": str(Path(my_robot.__file__).with_name("bodies.yaml")),
    "noise": "0.0005,0.005",  # of the camera; METRES,RADIANS
}


def generate_launch_description() -> LaunchDescription:
    """Return the graph: all arguments of `closed_loop.launch.py` may be given besides."""
    included = IncludeLaunchDescription(str(GRAPH), launch_arguments=ROBOT.items())
    return LaunchDescription([included])
