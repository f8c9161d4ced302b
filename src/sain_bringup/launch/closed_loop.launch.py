"""The graph on a full ROS 2 install: simulator, model, planner and recorder, looked after.

    ros2 launch sain_bringup closed_loop.launch.py model:=planar gui:=true

A goal starts it moving; a closed loop that gives goals and reports is
``ros2 run sain_bringup closed_loop``, which looks after the same processes with the same code.
"""

import atexit
import os
import sys
from datetime import datetime
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction
from launch.events import Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from sain_sim.world.engines import DEFAULT_ENGINE, DEFAULT_ROBOT

CONFIG = Path(get_package_share_directory("sain_bringup"), "config")
DEFAULT_PARAMETERS = CONFIG / "launch.yaml"

ARGUMENTS = {
    "engine": (DEFAULT_ENGINE, "physics engine: bullet, mujoco, or a package's world"),
    "namespace": ("/sain", "namespace of all nodes"),
    "model": ("sain", "what predicts: sain, planar, identity, or a checkpoint's path"),
    "belief": ("", "file of sain_model identify, with which each episode begins"),
    "robot": (DEFAULT_ROBOT, "robot that is simulated: its YAML file, or a shipped one's name"),
    "driver": ("", "command of a robot's driver, in place of the simulator; or: elsewhere"),
    "faults": ("", "faults of a bench in place of the simulator, or: none"),
    "bodies": ("", "YAML file of the bodies of driver or bench, of whose poses scenes are made"),
    "noise": ("0,0", "standard deviation of observed poses: METRES,RADIANS"),
    "params_file": (str(DEFAULT_PARAMETERS), "ROS parameters on top of the nodes' defaults"),
    "gui": ("false", "show the simulator's window"),
    "seed": ("0", "of the first scene and of the planner"),
    "goal": ("", "goal to begin with, as 'X Y' in metres; empty: none"),
    "record": ("true", "record all topics"),
    "bag": (f"bags/{datetime.now():%Y%m%d-%H%M%S}", "folder to make for the recording"),
    "rviz": ("false", "start RViz with the topics of /sain, where rviz2 is installed"),
}


# Of `graph`, one word each.
OPTIONS = (
    "engine", "model", "belief", "robot", "driver", "faults", "bodies", "noise", "params_file",
    "seed", "bag",
)  # fmt: skip


def generate_launch_description() -> LaunchDescription:
    """Return the graph, which is one process here, and its arguments."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])


def nodes(context: LaunchContext) -> list[Node]:
    """Return the processes for the arguments as they were given."""
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    options = [f"--{name.replace('_', '-')}={value[name]}" for name in OPTIONS if value[name]]
    options += [f"--{'' if is_true(value[name]) else 'no-'}{name}" for name in ("gui", "record")]
    ours = {"package": "sain_bringup", "namespace": value["namespace"], "output": "screen"}
    ending = {"on_exit": OpaqueFunction(function=end), "sigterm_timeout": "600"}
    started = [Node(executable="graph", arguments=options, **ours, **ending)]
    if value["goal"]:
        started.append(Node(executable="goal", arguments=value["goal"].split(), **ours))
    if is_true(value["rviz"]):
        view = str(CONFIG / "sain.rviz")
        given = {"parameters": [{"use_sim_time": True}], "output": "screen"}  # as all headers
        started.append(Node(package="rviz2", executable="rviz2", arguments=["-d", view], **given))
    return started


def is_true(text: str) -> bool:
    """Return what a launch argument says; raises `ValueError` for neither true nor false."""
    if text.lower() not in ("true", "false"):
        raise ValueError(f"{text!r} is neither true nor false")
    return text.lower() == "true"


def end(context: LaunchContext) -> list[EmitEvent]:
    """End the launch with the graph, and with its exit code: launch itself has 0 and 1 alone."""
    exited: ProcessExited = context.locals.event
    if exited.returncode:
        atexit.register(leave, exited.returncode)
    reason = f"the graph ended with exit code {exited.returncode}"
    return [EmitEvent(event=Shutdown(reason=reason))]


def leave(code: int) -> None:
    """End this process at once."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
