"""`report`: where it writes a page, and what it refuses."""

import subprocess

import pytest
from rich.console import Console

from sain_bags.cli.report import ReportOptions, default_path, run
from sain_bringup.graph import executable
from sain_core.errors import OutputError
from sain_core.output import write_whole


def test_the_page_is_written_beside_the_bag(episode_bag, tmp_path):
    quiet = Console(quiet=True)
    run(ReportOptions(episode_bag), quiet)
    assert default_path(episode_bag) == tmp_path / "report.html"
    assert (tmp_path / "report.html").read_text(encoding="utf-8").startswith("<!")
    assert not list(tmp_path.glob("*.partial"))
    (tmp_path / "report.html").write_text("mine")
    with pytest.raises(OutputError, match=r"report\.html exists, and no list of .*--overwrite"):
        run(ReportOptions(episode_bag), quiet)
    run(ReportOptions(episode_bag, overwrite=True), quiet)
    with pytest.raises(OutputError, match="is a folder"):
        run(ReportOptions(episode_bag, tmp_path), quiet)
    assert default_path(episode_bag / "bag_0.mcap") == episode_bag / "bag_0.html"


def test_a_report_replaces_no_other_result(episode_bag, tmp_path):
    shard = write_whole(tmp_path / "data" / "shard-00000.npz", b"PAR1 of a week")
    match = r"npz is a text file.*a report replaces only a page: name"
    with pytest.raises(OutputError, match=match):
        run(ReportOptions(episode_bag, shard), Console(quiet=True))
    assert shard.read_bytes() == b"PAR1 of a week"
    for _ in range(2):
        run(ReportOptions(episode_bag, tmp_path / "data" / "page.html"), Console(quiet=True))


def test_the_command_fails_with_one_line(tmp_path):
    command = [str(executable("sain_bags", "report")), str(tmp_path / "none")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr == f"report: no bag at {tmp_path / 'none'}\n"
