"""`make faults` in short: the graph goes on, and the table says so."""

import os

import pytest

from benchmarks.faults import surroundings
from benchmarks.faults.arm_faults import arm_faults
from benchmarks.faults.graph_faults import disks, strikes
from benchmarks.faults.table import Row, write_page
from sain_bringup.graph import LEARNER, SIMULATOR

pytestmark = pytest.mark.system
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root mounts disks")


def test_a_process_is_stopped_and_the_graph_goes_on(tmp_path):
    (row,) = strikes(tmp_path, "stop", 1, seed=0, parts=[SIMULATOR])
    assert row.fault.endswith(f": {SIMULATOR}")
    assert (row.tries, row.survived, row.lost) == (1, 1, 0), row
    assert 0.0 < row.recoveries[0] < 60.0


def test_a_learner_is_killed_and_its_laboratory_is_whole(tmp_path):
    (row,) = strikes(tmp_path, "kill", 1, seed=0, parts=[LEARNER])
    assert (row.tries, row.survived, row.lost) == (1, 1, 0), row


def test_an_arm_without_its_enable_signal_rests_and_goes_on_with_it(tmp_path):
    (row,) = arm_faults(tmp_path, 1, only="enable signal is lost")
    assert (row.tries, row.survived, row.lost) == (1, 1, 0), row
    assert row.recoveries[0] > 4.0


def test_lost_and_late_datagrams_change_nothing(tmp_path):
    row = surroundings.worst_datagrams(tmp_path, episodes=1)
    assert (row.survived, row.lost) == (1, 0), row


def test_the_wall_clock_jumps_ahead_and_changes_nothing(tmp_path):
    row = next(surroundings.clock_jumps(tmp_path, episodes=2))
    assert (row.survived, row.lost) == (2, 0), row


@as_root
def test_disks_that_cannot_be_written_end_the_graph_with_the_reason_and_a_whole_bag(tmp_path):
    for row in disks(tmp_path, 1):
        assert (row.survived, row.lost) == (1, 0), row


def test_the_page_has_what_the_table_has(tmp_path):
    rows = [
        Row("SIGKILL: model", 50, 49, 1, [0.5, 2.25]),
        Row("hostile messages: sim_node", 12000, 12000, 0, note="no node died"),
    ]
    write_page(tmp_path / "faults.md", rows, "make faults")
    text = (tmp_path / "faults.md").read_text()
    assert "| SIGKILL: model | 50 | 49 | 1 | 2.2 s | 2.2 s |" in text
    assert "| hostile messages: sim_node | 12,000 | 12,000 | 0 |  |  |" in text
    assert "* **hostile messages: sim_node**: no node died" in text
    assert "`make faults`, commit " in text
