"""The page of results: what a person reads in its cells."""

import json
from io import StringIO

import pytest
from rich.console import Console

from sain_core.errors import DatasetError
from sain_eval.cli.results import ResultsOptions, run
from sain_eval.loop.results import RESULTS_FILE, SceneRecord, write_results


def evaluated(
    folder, engine, solved, controller="planar", camera=None, scenario="anywhere", within=0.005
):
    """Write results of four scenes, of which so many are solved."""
    fallbacks = int(controller == "sain")
    records = [
        SceneRecord(
            scenario, seed, controller, within, seed < solved, 4 + seed, 0.01,
            (0.001, 0.003), 0, "" if seed < solved else "too far", fallbacks,
        )
        for seed in range(4)
    ]  # fmt: skip
    config = {"truth": {"world": "randomised", "engine": engine}, "camera": camera or {}}
    path = write_results(folder, records, config, f"evaluate --engine {engine}")
    path.write_text(json.dumps(json.loads(path.read_text()) | {"git_commit": "0123456789abcdef"}))
    return folder


def page(tmp_path, *folders, names=""):
    out = tmp_path / "docs" / "results.md"
    run(ResultsOptions(folders=folders, out=out, names=names), Console(file=StringIO()))
    return out.read_text().replace("\u00a0", " ")


def test_realities_are_columns_and_models_rows(tmp_path):
    text = page(
        tmp_path,
        evaluated(tmp_path / "a", "bullet", 4),
        evaluated(tmp_path / "b", "mujoco", 3),
        evaluated(tmp_path / "c", "mujoco", 2, "runs/x/sain.safetensors"),
        names="runs/x/sain.safetensors=SAIN trained here",
    )
    lines = text.splitlines()
    assert "| within | model | Bullet | MuJoCo |" in lines
    assert (
        "| 0.5 cm | planar prior, history | **4/4** (51-100 %), 5.5 pushes, 2.0 mm |"
        " **3/4** (30-95 %), 5.0 pushes, 2.0 mm |"
    ) in lines
    assert "| 0.5 cm | SAIN trained here |  | **2/4** (15-85 %), 4.5 pushes, 2.0 mm |" in lines
    assert lines[lines.index("# MuJoCo, commit 0123456789ab") + 1] == "evaluate --engine mujoco"


def test_an_overview_of_each_reality_has_scenarios_in_rows_and_models_in_columns(tmp_path):
    lines = page(
        tmp_path,
        evaluated(tmp_path / "a", "bullet", 4, within=0.02),
        evaluated(tmp_path / "b", "bullet", 3),
        evaluated(tmp_path / "c", "bullet", 2, "oracle"),
        evaluated(tmp_path / "d", "mujoco", 1, "sain", scenario="paper"),
    ).splitlines()
    bullet = lines.index("### Bullet")
    assert lines[bullet + 2] == "| scenario | within | planar prior, history | oracle |"
    assert lines[bullet + 4 : bullet + 6] == ["| `anywhere` | 0.5 cm | 3/4, 5.0 | 2/4, 4.5 |", ""]
    mujoco = lines.index("### MuJoCo")
    assert lines[mujoco + 4] == "| `paper` | 0.5 cm | 1/4, 4.0 |"


def test_the_papers_numbers_are_beside_those_of_sain(tmp_path):
    lines = page(
        tmp_path,
        *(
            evaluated(tmp_path / f"{name}{within}", "bullet", 4, name, None, "paper", within)
            for name in ("sain", "planar")
            for within in (0.05, 0.02)
        ),
        evaluated(tmp_path / "mujoco", "mujoco", 4, "sain", None, "paper", 0.05),
    ).splitlines()
    assert "| within | model | the paper, to 5 cm | Bullet | MuJoCo |" in lines
    (sain,) = [line for line in lines if line.startswith("| 5 cm | SAIN as shipped |")]
    assert "| 40/40 (91-100 %) | **4/4** (51-100 %), 5.5 pushes, 2.0 mm, 4 by physics |" in sain
    (planar,) = [line for line in lines if line.startswith("| 5 cm | planar prior, history |")]
    assert "40/40" not in planar
    assert "| `paper` | 2 cm | 40/40 (91-100 %) | 4/4, 5.5 | 4/4, 5.5 |" in lines
    assert "| `paper` | 5 cm | 4/4, 5.5 |" in lines  # the paper has no MuJoCo


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (lambda text: None, r"results\.json cannot be read"),
        (lambda text: '{"schema": "else"}', "schema 'else'; allowed: 'sain-results-1'"),
        (lambda text: "[" * 100_000, "holds no results"),
        (lambda text: text.replace("heading_tolerance", "turn"), "no results .*'turn'"),
        (lambda text: text.replace('"pushes": 4', '"pushes": null'), "pushes is None; it must be"),
    ],
)
def test_a_folder_without_results_is_named(tmp_path, content, message):
    folder = evaluated(tmp_path / "a", "bullet", 4)
    path, text = folder / RESULTS_FILE, content((folder / RESULTS_FILE).read_text())
    path.unlink()
    if text:
        path.write_text(text)
    with pytest.raises(DatasetError, match=message):
        page(tmp_path, folder)
