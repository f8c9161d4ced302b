"""What makes no sense is refused in one line before anything starts."""

import re
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from sain_bringup.ros.closed_loop import (
    ClosedLoopOptions,
    make_output_folder,
    run,
    what_is_left,
)
from sain_core.errors import ConfigError, OutputError
from tests.sain_core.shapes.test_outlines import a_bar, objects

DEMO = ClosedLoopOptions()


def test_the_demo_is_three_anywhere_one_paper_and_one_push_t() -> None:
    names = [scenario for scenario, _ in DEMO.plans]
    assert names == ["anywhere", "anywhere", "anywhere", "paper", "push_t"]
    assert DEMO.tolerance == 0.02


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scenario": "anywere"}, r"scenario 'anywere' is unknown \(did you mean 'anywhere'\?\)"),
        ({"episodes": 0}, "episodes is 0; it must be at least 1"),
        ({"tolerance": 0.0}, "tolerance is 0.0 m; it must be at least 0.0001 m"),
        ({"tolerance": float("nan")}, "tolerance is nan; it must be finite"),
        ({"model": "plannar"}, r"model 'plannar' is unknown \(did you mean 'planar'\?\)"),
        ({"engine": "ode"}, "engine 'ode' is unknown; known: bullet, mujoco"),
        ({"seed": -1}, "seed is -1; it must be at least 0"),
        ({"timeout": 0.0}, "timeout is 0.0 s; it must be at least 0.1 s"),
        ({"params_file": Path("missing.yaml")}, r"--params-file missing.yaml: No such file"),
    ],
)
def test_options_that_make_no_sense(change, message):
    with pytest.raises(ConfigError, match=message):
        replace(DEMO, **change)  # type: ignore[arg-type]


def test_bodies_of_a_file_need_it_and_an_engine_with_heights(tmp_path):
    file = objects(tmp_path, a_bar(), a_bar(name="Can", height_m=0.06))
    given = {"scenario": "anything:can", "outlines": file, "engine": "mujoco"}
    options = replace(DEMO, **given)
    assert options.plans == [("anything:can", 0)]
    assert options.simulator()["outlines"] == str(file)
    with pytest.raises(ConfigError, match="has bodies of own heights: add --engine mujoco"):
        replace(options, engine="bullet")
    with pytest.raises(ConfigError, match="body 'cam' is unknown"):
        run(replace(options, scenario="anything:cam", out=tmp_path / "out"), Console())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("text", ["a: [", "- 1", "", "sim_node: {seed: 3}"])
def test_a_parameter_file_must_be_one(text, tmp_path):
    path = tmp_path / "params.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"params\.yaml"):
        replace(DEMO, params_file=path)


def test_results_are_never_overwritten(tmp_path):
    out = tmp_path / "a" / "b"
    assert make_output_folder(replace(DEMO, out=out)) == out
    (out / "bag").mkdir()
    (out / "bag" / "bag_0.mcap").write_bytes(b"recorded")
    with pytest.raises(OutputError, match=r"has bag, and a run needs an empty folder.*--overwrite"):
        make_output_folder(replace(DEMO, out=out))
    (out / "bag" / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"nothing is removed: SAIN did not write .*notes\.txt"):
        make_output_folder(replace(DEMO, out=out, overwrite=True))
    (out / "bag" / "notes.txt").unlink()
    assert make_output_folder(replace(DEMO, out=out, overwrite=True)) == out
    assert not (out / "bag").exists()


def test_without_an_episode_only_what_the_run_wrote_is_removed(tmp_path):
    out = make_output_folder(replace(DEMO, out=tmp_path / "out"))
    (out / "logs").mkdir()
    (out / "logs" / "planner.log").write_text("failed")
    (out / "mine.txt").write_text("the only copy")
    assert re.search(r"nothing is removed: .*mine\.txt", what_is_left(out, 0))
    assert (out / "mine.txt").exists() and (out / "logs" / "planner.log").exists()
    (out / "mine.txt").unlink()
    assert what_is_left(out, 0) == f"No episode was played, so {out} was removed."
    assert not out.exists()
