"""The bench as a person starts it: the graph of a robot, and no simulator's node in it."""

import signal
import subprocess
import time

import pytest
import rclpy
from rclpy.node import Node

from sain_core.cli.command_line import executable

SIMULATORS = {"/clock", "/sain/world_parameters", "/sain/joint_states", "/sain/robot_description"}
ROBOTS = {
    "/sain/camera/color/image_raw", "/sain/camera/color/camera_info",
    "/sain/camera/aligned_depth_to_color/image_raw", "/joint_states", "/tf_static",
    "/sain/enable", "/sain/reach_table", "/sain/push", "/sain/push_result",
}  # fmt: skip


def topics(node: Node) -> set[str]:
    return {name for name, _ in node.get_topic_names_and_types()}


@pytest.mark.system
@pytest.mark.parametrize(
    ("robot", "faults", "goal"),
    [("ur5", "none", ("0.6", "0.1")), ("xarm7", "abort=0.3,every=6", ("0.5", "0.1"))],
)
def test_a_goal_is_reached_without_any_topic_of_the_simulator(
    ros_domain, tmp_path, robot, faults, goal
):
    bag = tmp_path / "bag"
    bench = [str(executable("sain_bringup", "graph")), "--model", "planar", "--pace", "2.0"]
    bench += ["--robot", robot, "--engine", "mujoco", "--faults", faults, "--bag", str(bag)]
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = Node("bystander", context=context)
    with subprocess.Popen(bench, stdout=subprocess.PIPE, text=True) as running:
        try:
            end = time.monotonic() + 120.0
            while not topics(node) >= ROBOTS:
                assert time.monotonic() < end, topics(node)
                assert running.poll() is None
                time.sleep(0.2)
            given = [str(executable("sain_bringup", "goal")), *goal, "--body", "0"]
            done = subprocess.run(
                [*given, "--timeout", "120"], capture_output=True, text=True, timeout=250
            )
            assert done.returncode == 0, done.stderr + done.stdout
            assert topics(node) & SIMULATORS == set()
        finally:
            running.send_signal(signal.SIGINT)
            said = running.communicate(timeout=60)[0]
            node.destroy_node()
            context.try_shutdown()
    assert running.returncode == 0, said
    assert (bag / "metadata.yaml").exists()
