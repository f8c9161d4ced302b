"""Records, their summary, the journal and the command."""

import json
from dataclasses import replace
from importlib.metadata import version
from io import StringIO

import pytest
from rich.console import Console

from sain_core.errors import OutputError
from sain_eval.cli.evaluate import EvaluateOptions, evaluate, jobs_of
from sain_eval.cli.evaluate import run as run_command
from sain_eval.loop.journal import Journal
from sain_eval.loop.play import EpisodeOutcome
from sain_eval.loop.results import (
    SceneRecord,
    scene_records,
    summarise,
    write_results,
)
from sain_eval.loop.tables import failure_line, failures, shape_table, table_cells
from sain_eval.scenes.scenarios import SCENARIOS

CASE = SCENARIOS["paper"].scene(0)
SETTINGS = {"tolerances": (0.05, 0.005)}


@pytest.fixture
def records(episode):
    outcome = EpisodeOutcome((episode,), episode.scenes[-1], 1, failure="too far")
    return scene_records(CASE, "planar", outcome, (0.05, 0.005))


def run(out, **changes):
    options = EvaluateOptions(
        out=out, **{"scenario": "paper", "scenes": 2, "controllers": "null", **changes}
    )
    evaluate(options, "evaluate", Console(file=StringIO()))
    return json.loads((out / "results.json").read_text())


def test_an_episode_is_judged_at_each_tolerance_and_the_summary_averages(records):
    wide, tight = records
    assert (wide.success, wide.pushes, wide.failure) == (True, 1, "")
    assert wide.final_distance == pytest.approx(0.04)
    assert wide.target_errors == pytest.approx((0.005,))
    assert (tight.success, tight.pushes, tight.failure) == (False, 2, "too far")
    assert tight.final_distance == pytest.approx(0.008)
    group = [replace(wide, seed=seed, pushes=2 + seed) for seed in range(3)]
    group.append(replace(wide, seed=3, success=False, pushes=15, failure="no"))
    (row,) = summarise(group)
    assert (row["scenes"], row["successes"]) == (4, 3)
    assert row["rate"]["estimate"] == 0.75
    assert row["pushes"]["estimate"] == 3.0
    assert row["target_error"] == pytest.approx(0.005)


def test_results_hold_all_it_takes_to_make_them_again(records, tmp_path):
    content = json.loads(write_results(tmp_path, records, {"seed": 0}, "evaluate").read_text())
    assert content["schema"] == "sain-results-1"
    assert content["config"] == {"seed": 0} and content["command"] == "evaluate"
    assert content["versions"]["sain"] == version("sain")
    assert content["versions"]["numpy"] and len(content["git_commit"]) >= 7
    assert {"cpu", "system"} == set(content["machine"])
    assert set(content["scenes"][0]) == set(SceneRecord.__dataclass_fields__)
    assert set(content["summary"][0]["rate"]) == {"estimate", "low", "high"}


def test_a_journal_goes_on_where_it_was_also_after_a_crash(records, tmp_path):
    journal = Journal(tmp_path, SETTINGS)
    assert not journal.path.exists()  # a run may be refused after this
    journal.add(records)
    whole = journal.path.read_text()
    for cut_off in ("", '[{"scenario": "pap'):
        journal.path.write_text(whole + cut_off)
        again = Journal(tmp_path, SETTINGS)
        assert again.records == records and again.done == {("paper", 0, "planar")}
        assert journal.path.read_text() == whole
    with pytest.raises(OutputError, match="made with another tolerances"):
        Journal(tmp_path, {"tolerances": (0.02,)})
    with pytest.raises(OutputError, match="made with another version of planar"):
        Journal(tmp_path, SETTINGS, versions={"planar": "trained again", "sain": "new"})
    for line in ("no json\n", '{"other": 1}\n'):
        journal.path.write_text(line)
        with pytest.raises(OutputError, match="is damaged"):
            Journal(tmp_path, SETTINGS)


def test_the_command_writes_the_same_files_with_one_process_and_with_workers(tmp_path):
    alone, together = tmp_path / "alone", tmp_path / "together"
    wanted = {"controllers": "straight", "pictures": 1}
    records = [run(alone, **wanted), run(together, workers=2, **wanted)]
    assert records[0]["scenes"] == records[1]["scenes"]
    assert [scene["seed"] for scene in records[0]["scenes"]] == [0, 0, 1, 1]
    names = {path.name for path in alone.iterdir()}
    assert names == {path.name for path in together.iterdir()} == {
        ".sain-files",
        "results.json", "table.md", "failures.md", "episodes.jsonl", "paper_0_straight.png",
    }  # fmt: skip
    picture = "paper_0_straight.png"
    assert (alone / picture).read_bytes() == (together / picture).read_bytes()


def test_a_person_finds_all_of_an_evaluation_in_its_pages(records, tmp_path):
    """Scenarios in the order of all, with rates, and why each episode failed, planners first."""
    scenarios, tolerances = "streak,blocked,rearrange_4", "0.02:0.1,0.01:0.05"
    options = EvaluateOptions(
        out=tmp_path,
        scenes=3,
        scenario=scenarios,
        controllers="straight,planar",
        tolerances=tolerances,
    )
    journal = Journal(tmp_path, options.settings())
    for job in jobs_of(options, set()):
        lost = (job.scenario == "rearrange_4" and job.seed == 1) or job.controller == "straight"
        why = "80 pushes left body 2 9.0 mm and 0.200 rad from its pose" if lost else ""
        streak = {"most_goals": 100, "goals": 30 + job.seed} if job.scenario == "streak" else {}
        made = [
            replace(
                records[0], scenario=job.scenario, seed=job.seed, controller=job.controller,
                tolerance=one.distance, heading_tolerance=one.turn, success=not lost, failure=why,
                has_heading=True, shapes=("t",), **streak,
            )
            for one in job.tolerances
        ]  # fmt: skip
        journal.add(made)
    printed = StringIO()
    run_command(options, Console(width=250, file=printed))
    page = (tmp_path / "table.md").read_text()
    rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| ")][2:]
    names = list(dict.fromkeys(row[0].removeprefix("| ") for row in rows))
    assert names == ["rearrange_4", "blocked", "streak"]
    (row,) = (row for row in rows if row[:3] == ["| rearrange_4", "planar", "1 cm, 0.05 rad"])
    assert row[3:5] == ["2/3", "21-94 %"] and row[5] == "1.0" and row[6].startswith("5.0 mm")
    (row,) = (row for row in rows if row[:3] == ["| streak", "planar", "2 cm, 0.1 rad"])
    assert row[3] == "3/3; 30, 31, 32 of 100 goals in a row"
    failed, shown = (tmp_path / "failures.md").read_text(), printed.getvalue()
    assert (
        "## rearrange_4, planar: 1 of 3\n\n* rearrange_4 1 (t), planar, not within 2 cm" in failed
    )
    assert "## blocked, straight: 3 of 3\n" in failed
    assert shown.index("rearrange_4 1 (t), planar") < shown.index("blocked 0 (t), straight")


POSE_RECORD = SceneRecord(
    "shapes", 7, "planar", 0.02, True, 4, 0.012, (0.004, 0.006), 1, "",
    heading_tolerance=0.1, has_heading=True, final_turn=0.05, turn_errors=(0.02, 0.04),
    plan_seconds=(0.2, 0.4), shapes=("butter",),
)  # fmt: skip


def test_the_table_has_headings_refusals_and_planning_times():
    cells = table_cells(summarise([POSE_RECORD])[0])
    assert cells == [
        "shapes", "planar", "2 cm, 0.1 rad", "1/1", "21-100 %", "4.0", "5.0 mm, 0.030 rad", "1",
        "300 / 390 ms",
    ]  # fmt: skip


def test_each_shape_has_its_line_in_the_order_of_the_library(records):
    other = replace(POSE_RECORD, seed=0, shapes=("disk",))
    lines = shape_table([POSE_RECORD, other, *records]).splitlines()
    assert [line.split(" | ")[0] for line in lines] == ["| shape", "| ---", "| disk", "| butter"]
    assert shape_table(records) == ""


def test_a_failure_is_listed_once_with_scene_and_reason(records):
    missed = replace(POSE_RECORD, success=False, failure="30 pushes left body 0 12.0 mm away")
    tight = replace(missed, tolerance=0.01, heading_tolerance=0.05)
    found = failures([tight, missed, POSE_RECORD, *records])
    assert list(map(failure_line, found)) == [
        "paper 0, planar, not within 0.5 cm: too far; 2 pushes, 1 refused, ended 8.0 mm away",
        "shapes 7 (butter), planar, not within 2 cm, 0.1 rad: 30 pushes left body 0 12.0 mm away;"
        " 4 pushes, 1 refused, ended 12.0 mm, 0.050 rad away",
    ]
