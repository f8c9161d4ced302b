"""A full /dev/shm and a computer without a network are told, before ROS dies or waits."""

import os
import shutil
import subprocess
import sys
from types import SimpleNamespace

import pytest

from sain_core.errors import OutputError
from sain_core.guarding import lifetime
from sain_core.guarding.lifetime import RANGE, check_loopback, check_shared_memory
from sain_sim.commands import sim_node


def test_room_for_a_few_pages_is_enough(tmp_path, monkeypatch):
    check_shared_memory()
    check_shared_memory(tmp_path / "not there")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=16384))
    check_shared_memory(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=12288))
    with pytest.raises(OutputError, match="is full, and ROS cannot start without a page there"):
        check_shared_memory(tmp_path)


def test_a_node_says_so_and_does_not_start(monkeypatch, capsys):
    monkeypatch.setattr(lifetime, "LEAST", 2**63)
    assert sim_node([]) == 1
    assert capsys.readouterr().err.startswith("sim_node: /dev/shm is full")


def test_without_a_network_a_command_says_at_once_what_to_do():
    isolated = ["unshare", "--user", "--map-root-user", "--net"]
    if subprocess.run([*isolated, "true"], capture_output=True).returncode:
        pytest.skip("this computer lets nobody make a network of his own")
    code = "from sain_bringup.commands import closed_loop; raise SystemExit(closed_loop([]))"
    command, closed = [*isolated, sys.executable, "-c", code], {**os.environ, RANGE: "LOCALHOST"}
    ended = subprocess.run(command, capture_output=True, text=True, env=closed)
    assert ended.returncode == 1 and ended.stdout == ""
    assert ended.stderr == (
        "closed_loop: nodes talk over 127.0.0.1, which cannot be used here: Network is unreachable;"
        " run `sudo ip link set lo up`, or start the container with a network\n"
    )


def test_who_opens_the_network_needs_no_loopback(monkeypatch):
    monkeypatch.setenv(RANGE, "LOCALHOST")
    check_loopback()
    with pytest.raises(lifetime.NoNetworkError):
        check_loopback("203.0.113.1")  # nobody's own
    monkeypatch.setenv(RANGE, "SUBNET")
    check_loopback("203.0.113.1")
