"""`make faults` in short: the graph goes on, input is answered or refused, and the page says so."""

import subprocess
import sys

import pytest

from benchmarks.faults.graph_faults import POLICY, strikes
from benchmarks.faults.table import Row, write_page
from sain_bringup.graph import LEARNER, PLANNER
from tests.paths import ROOT

pytestmark = pytest.mark.system


def test_a_learner_is_killed_and_its_laboratory_is_whole(tmp_path):
    (row,) = strikes(tmp_path, "kill", 1, seed=0, parts=[LEARNER])
    assert (row.tries, row.survived, row.lost) == (1, 1, 0), row
    assert 0.0 < row.recoveries[0] < 60.0


def test_nothing_is_lost_when_the_planner_with_a_policy_is_killed(tmp_path):
    (row,) = strikes(tmp_path, "policy", 1, seed=0, parts=[PLANNER], policy=POLICY)
    assert (row.fault, row.tries, row.survived, row.lost) == (
        "SIGKILL: planner, with a policy", 1, 1, 0,
    ), row  # fmt: skip


def test_mutated_files_are_read_or_refused_and_spoilt_messages_are_answered(tmp_path):
    """Run it in a process without threads, from which it can fork."""
    few = ["--only", "files", "messages", "--files", "5", "--messages", "20"]
    command = [sys.executable, "-m", "benchmarks.faults.graph_faults", *few]
    page = tmp_path / "faults.md"
    done = subprocess.run([*command, "--page", str(page)], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    assert "| 5 mutated files | 7 | 7 | 0 |  |  |" in page.read_text()
    assert page.read_text().count("hostile messages: ") == 3


def test_the_page_has_what_the_table_has(tmp_path):
    rows = [Row("SIGKILL: model", 50, 49, 1, [0.5, 2.25], note="no node died")]
    write_page(tmp_path / "faults.md", rows, "make faults")
    text = (tmp_path / "faults.md").read_text()
    assert "| SIGKILL: model | 50 | 49 | 1 | 2.2 s | 2.2 s |" in text
    assert "* **SIGKILL: model**: no node died" in text
    assert "`make faults`, commit " in text
