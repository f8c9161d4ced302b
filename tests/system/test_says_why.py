"""A graph that does nothing says why, and a goal that a planner lost is sent again."""

import os
import re
import signal
import subprocess
import threading
import time
from pathlib import Path

import pytest
from rclpy.node import Node

from sain_core.cli.command_line import executable
from sain_core.ros.node_main import WARN, Diagnostics

pytestmark = pytest.mark.system

GRAPH = ("--driver", "elsewhere", "--model", "planar", "--no-record")


def test_a_graph_prints_once_what_it_lacks_and_what_its_nodes_report(graph):
    arm = graph.add(Node("arm_node", namespace="sain", context=graph.context))
    Diagnostics(arm, "arm").set(WARN, "not enabled: the arm does not move")
    command = [str(executable("sain_bringup", "graph")), *GRAPH]
    lines: list[str] = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        reader = threading.Thread(target=lambda: lines.extend(running.stdout or ()))
        reader.start()
        try:
            said = lambda words: [line for line in lines if words in line]  # noqa: E731
            enable = "arm_node: not enabled: the arm does not move; start in another terminal:"
            source = "! no source of scenes in namespace /sain"
            graph.wait(lambda: said(enable) and said(source), "both lines")
            end = time.monotonic() + 4.0
            graph.wait(lambda: time.monotonic() > end, "repeated diagnostics")
            assert len(said(enable)) == len(said(source)) == 1
            assert not said("no planner")
        finally:
            running.send_signal(signal.SIGINT)
            running.wait(timeout=60)
            reader.join()
    assert running.returncode == 0, lines


def test_a_goal_is_reached_though_its_planner_is_killed(tmp_path, ros_domain):
    command = [str(executable("sain_bringup", "graph")), "--no-record", "--model", "planar"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        try:
            goal = [str(executable("sain_bringup", "goal")), "0.8", "0.2", "--timeout", "60"]
            with subprocess.Popen(goal, stdout=subprocess.PIPE, text=True) as asking:
                printed = [asking.stdout.readline()]
                while not printed[-1].startswith("push 1 "):
                    printed.append(asking.stdout.readline())
                os.kill(child_of(running.pid, "mppi_node"), signal.SIGKILL)
                printed += asking.stdout.readlines()
            text = "".join(printed)
            assert asking.returncode == 0, text
            again = text.index("the planner was restarted: the goal is sent again")
            counts = [int(count) for count in re.findall(r"^push (\d+) ", text, re.M)]
            assert counts == sorted(set(counts)) and counts[-1] >= 2, text
            assert text.index("reached with", again) > again
            assert f"reached with {counts[-1]} pushes" in text
        finally:
            running.send_signal(signal.SIGINT)
            running.wait(timeout=60)


def child_of(process: int, name: str) -> int:
    """Return the number of the child of a process that has this word in its command."""
    for child in Path(f"/proc/{process}/task/{process}/children").read_text().split():
        if name in Path(f"/proc/{child}/cmdline").read_text():
            return int(child)
    raise AssertionError(f"no {name}")
