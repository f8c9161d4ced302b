"""A graph that does nothing says why, in the terminal of the command that started it."""

import signal
import subprocess
import threading
import time

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
