"""A short version of `benchmarks.hostile_files`: no command ends in a traceback, or takes long."""

from pathlib import Path

import pytest
from rich.console import Console

from benchmarks.hostile.measuring import READ, REFUSED
from benchmarks.hostile_files import MOST_MB, Options, Outcome, choose_files, run_files, table

BAGS = (
    "metadata: aliases", "metadata: wrong kinds", "chunk: 4 GB", "chunk: 2^64 - 1", "chunk: listed",
    "chunk: false count", "schema: recursive", "schema: wide", "schema: 10^6", "schema: huge",
    "message: long", "sqlite3: endless", "rosbag2: packed", "file: fifo", "file: zero",
    "messages mutated",
)  # fmt: skip


def check(outcomes: list[Outcome]) -> None:
    """Check what does not depend on how busy the machine is."""
    wrong = [outcome for outcome in outcomes if outcome.found.state not in (READ, REFUSED)]
    assert not [outcome.summary for outcome in wrong]
    assert max(outcome.found.megabytes for outcome in outcomes) < MOST_MB


def test_bags(tmp_path: Path) -> None:
    options = Options(count=1, kinds=("bag",), families=BAGS)
    outcomes = list(run_files(options, tmp_path, Console(quiet=True)))
    check(outcomes)
    assert {outcome.command for outcome in outcomes} >= {"info", "report", "recover", "play"}
    assert sum(outcome.found.state == REFUSED for outcome in outcomes) > 20


@pytest.mark.parametrize("kind", ["checkpoint", "belief", "data", "results", "parameters"])
def test_other_files(kind: str, tmp_path: Path) -> None:
    families = ("file: fifo", "digits", "false shape")
    options = Options(count=1, kinds=(kind,), families=families)
    outcomes = list(run_files(options, tmp_path, Console(quiet=True)))
    check(outcomes)
    assert len(table(outcomes)) > 1


def test_every_family_is_tried_and_mutations_fill_the_number() -> None:
    files = list(choose_files(Options()))
    assert len(set(files)) == len(files) == 1000
    assert {file.number for file in files if file.family == "file: fifo"} == {0}
    assert len({file.number for file in files if file.family == "messages mutated"}) > 50
