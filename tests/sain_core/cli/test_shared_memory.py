"""A full /dev/shm is told, before ROS dies of it."""

import shutil
from types import SimpleNamespace

import pytest

from sain_core.cli import shared_memory
from sain_core.cli.shared_memory import check_shared_memory
from sain_core.errors import OutputError
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
    monkeypatch.setattr(shared_memory, "LEAST", 2**63)
    assert sim_node([]) == 1
    assert capsys.readouterr().err.startswith("sim_node: /dev/shm is full")
