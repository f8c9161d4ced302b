"""The graph on a full ROS 2 install: simulator, model, planner and recorder.

    ros2 launch sain_bringup closed_loop.launch.py model:=planar gui:=true

A goal starts it moving; a closed loop that gives goals and reports is
``ros2 run sain_bringup closed_loop``, which starts the same nodes by itself.
"""

from datetime import datetime
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from sain_bringup.rviz import view_of

CONFIG = Path(get_package_share_directory("sain_bringup"), "config")
DEFAULT_PARAMETERS = CONFIG / "launch.yaml"

ARGUMENTS = {
    "namespace": ("/sain", "namespace of all nodes"),
    "model": ("sain", "what predicts: sain, planar, identity, or a checkpoint's path"),
    "belief": ("", "file of sain_model identify, with which each episode begins"),
    "params_file": (str(DEFAULT_PARAMETERS), "ROS parameters on top of the nodes' defaults"),
    "gui": ("false", "show the simulator's window"),
    "seed": ("0", "of the first scene and of the planner"),
    "goal": ("", "goal to begin with, as 'X Y' in metres; empty: none"),
    "record": ("true", "record all topics"),
    "bag": (f"bags/{datetime.now():%Y%m%d-%H%M%S}", "folder to make for the recording"),
    "rviz": ("false", "start RViz, where rviz2 is installed"),
}


def generate_launch_description() -> LaunchDescription:
    """Return the nodes and their arguments."""
    value = {name: LaunchConfiguration(name) for name in ARGUMENTS}
    seed = {"seed": ParameterValue(value["seed"], value_type=int)}
    simulated = {"use_sim_time": True}  # the simulator's time is in all headers
    gui = {"gui": ParameterValue(value["gui"], value_type=bool)}
    model = {name: ParameterValue(value[name], value_type=str) for name in ("model", "belief")}

    def node(package: str, executable: str, *parameters: object) -> Node:
        return Node(
            package=package,
            executable=executable,
            namespace=value["namespace"],
            parameters=[value["params_file"], *parameters],
            output="screen",
        )

    recorder = Node(
        package="sain_bags",
        executable="record",
        namespace=value["namespace"],
        arguments=["--out", value["bag"]],
        condition=IfCondition(value["record"]),
        output="screen",
    )

    def goal(context: LaunchContext) -> list[Node]:
        words = value["goal"].perform(context).split()
        given = {"package": "sain_bringup", "executable": "goal", "namespace": value["namespace"]}
        return [Node(**given, arguments=words, output="screen")] if words else []

    def rviz(context: LaunchContext) -> list[Node]:
        view = view_of(value["namespace"].perform(context), CONFIG / "sain.rviz")
        given = {"package": "rviz2", "executable": "rviz2", "arguments": ["-d", str(view)]}
        return [Node(**given, parameters=[simulated], output="screen")]

    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    nodes = [
        node("sain_sim", "sim_node", seed, gui),
        node("sain_model", "model_node", model, simulated),
        node("sain_mppi", "mppi_node", seed, simulated),
        recorder,
        OpaqueFunction(function=goal),
        OpaqueFunction(function=rviz, condition=IfCondition(value["rviz"])),
    ]
    return LaunchDescription([*declared, *nodes])
