"""The whole graph with its page, as `make live` starts it, and a viewer who steers it."""

import re
import signal
import subprocess
import time

import numpy as np
import pytest

from sain_bringup.graph import executable
from sain_live.requests import Reset
from tests.sain_live.straw import free_port
from tests.sain_live.viewer import Viewer

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

GOAL = "/goals/0"
PATIENCE = 120.0  # [s]


@pytest.fixture
def port(ros_domain, tmp_path):
    """The port of a graph in a domain of its own, once it prints its address."""
    port = free_port()
    options = ["--port", str(port), "--no-record", "--model", "planar", "--real-time-factor", "0"]
    command = [str(executable("sain_live", "live")), "--scenario", "push_t", *options]
    said = tmp_path / "said.txt"
    with said.open("w") as stream:
        process = subprocess.Popen(command, stdout=stream, stderr=stream, cwd=tmp_path)
    end = time.monotonic() + PATIENCE
    try:
        while not (found := re.search(r"the page is at http://127.0.0.1:(\d+)", said.read_text())):
            assert time.monotonic() < end and process.poll() is None, said.read_text()
            time.sleep(0.1)
        assert int(found[1]) == port
        yield port
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(timeout=30)
    assert process.returncode in (0, 130), said.read_text()


def test_a_goal_is_dragged_a_setting_changed_and_a_body_arrives(port):
    viewer = Viewer(port)

    def wait(words):
        viewer.wait(lambda: words in viewer.texts, words, PATIENCE)

    pose = Reset.draw("push_t", 0).case.goal.poses[0]
    wait("push_t, seed 0")
    viewer.wait(lambda: viewer.nodes.get(GOAL, {}).get("position", [0])[0] == pose.x, "the goal")
    x, y = pose.x - 0.05, pose.y
    viewer.drag(GOAL, (pose.x, pose.y), (x, y))
    wait("Start follows it")
    viewer.turn("horizon", 3)
    viewer.turn("loop", "Start")
    wait("goal reached")
    assert np.hypot(*np.subtract(viewer.nodes["/bodies/0"]["position"][:2], (x, y))) < 0.021
    viewer.close()
    later = Viewer(port)
    later.wait(lambda: later.controls and GOAL in later.nodes, "the page")
    assert later.controls[later.control("horizon")]["value"] == 3
    later.close()
