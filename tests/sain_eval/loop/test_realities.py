"""The page of results: what a person reads in its cells."""

import json
from io import StringIO

import pytest
from rich.console import Console

from sain_core.errors import ConfigError, DatasetError
from sain_eval.cli.options import ResultsOptions
from sain_eval.cli.results import run
from sain_eval.loop.results import RESULTS_FILE, SCHEMA, SceneRecord, summarise


def evaluated(folder, engine, solved, controller="planar", camera=None):
    """Write results of four scenes, of which so many are solved."""
    records = [
        SceneRecord(
            "anywhere", seed, controller, 0.005, seed < solved, 4 + seed, 0.01, 0.03,
            (0.001, 0.003), (), 0, "" if seed < solved else "too far",
        )
        for seed in range(4)
    ]  # fmt: skip
    content = {
        "schema": SCHEMA,
        "command": f"evaluate --engine {engine}",
        "git_commit": "0123456789abcdef",
        "config": {"truth": {"world": "randomised", "engine": engine}, "camera": camera or {}},
        "summary": summarise(records),
    }
    folder.mkdir()
    (folder / RESULTS_FILE).write_text(json.dumps(content))
    return folder


def page(tmp_path, *folders, names=""):
    out = tmp_path / "docs" / "results.md"
    run(ResultsOptions(folders=folders, out=out, names=names), Console(file=StringIO()))
    return out.read_text()


def test_realities_are_columns_and_models_rows(tmp_path):
    text = page(
        tmp_path,
        evaluated(tmp_path / "a", "bullet", 4),
        evaluated(tmp_path / "b", "mujoco", 3),
        evaluated(tmp_path / "c", "mujoco", 2, "runs/x/sain.safetensors"),
        names="runs/x/sain.safetensors=SAIN trained here",
    )
    lines = text.splitlines()
    assert "| within | controller | Bullet | MuJoCo |" in lines
    assert (
        "| 0.5 cm | planar prior, history | **4/4** (51-100 %), 5.5 pushes, 2.0 mm |"
        " **3/4** (30-95 %), 5.0 pushes, 2.0 mm |"
    ) in lines
    assert "| 0.5 cm | SAIN trained here |  | **2/4** (15-85 %), 4.5 pushes, 2.0 mm |" in lines
    assert "* MuJoCo: `evaluate --engine mujoco`, commit 0123456789ab" in lines


def test_noisy_observations_are_another_reality(tmp_path):
    noisy = {"noise": "0.005,0.035", "delay": 0.1, "frame_rate": 30.0}
    seen = evaluated(tmp_path / "b", "bullet", 3, camera=noisy)
    text = page(tmp_path, evaluated(tmp_path / "a", "bullet", 4), seen)
    title = "| within | controller | Bullet | Bullet, noise 0.005,0.035, delay 0.1 |"
    assert title in text.splitlines()


def test_a_folder_without_results_is_named(tmp_path):
    (tmp_path / "other").mkdir()
    with pytest.raises(DatasetError, match=r"other/results\.json cannot be read"):
        page(tmp_path, tmp_path / "other")
    (tmp_path / "other" / RESULTS_FILE).write_text('{"schema": "else"}')
    with pytest.raises(DatasetError, match="schema 'else'; allowed: 'sain-results-1'"):
        page(tmp_path, tmp_path / "other")
    (tmp_path / "other" / RESULTS_FILE).write_text("[" * 100_000)
    with pytest.raises(DatasetError, match="holds no results"):
        page(tmp_path, tmp_path / "other")


def test_a_name_without_its_text_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="MODEL=TEXT"):
        ResultsOptions(folders=(tmp_path,), names="sain")
