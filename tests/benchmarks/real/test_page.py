"""The page of real pushes, whole, on pushes of the project's own simulation."""

import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.real import __main__ as command
from benchmarks.real import page
from benchmarks.real.pushes import PushTable
from benchmarks.real.rows import Fixed, Predicted, Predictor, Row, published_rows
from benchmarks.real.trees import Trees
from sain_core.model import IdentityPrior

STILL = Fixed("still", "no motion", IdentityPrior())


@dataclass
class Half:
    """Predicts half of what happened, with regions; counts how often it is fitted."""

    fitted: int = 0
    key: str = "sain"
    title: str = "SAIN"
    identity: str = "half"
    learns_anew: bool = False

    def fit(self, train: PushTable, own: PushTable) -> Predictor:
        self.fitted += 1
        return self

    def predict(self, pushes: PushTable) -> Predicted:
        sizes = np.ones(len(pushes))
        return Predicted(pushes.placed(0.5 * pushes.moves), 0.04 * sizes, 0.5 * sizes)


@pytest.fixture(scope="module")
def half():
    return Half()


@pytest.fixture(scope="module")
def made(synthetic_pushes, half, tmp_path_factory):
    """The folder that a run of the command has filled."""
    folder = tmp_path_factory.mktemp("page")
    published = {"sim_quadratic": synthetic_pushes.after + np.array([0.003, 0.0, 0.02])}
    pushes = replace(synthetic_pushes, published=published)
    rows: list[Row] = [STILL, *published_rows(pushes), Trees(trees=3), half]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "read_pushes", lambda path, work: pushes)
        patch.setattr(command, "all_rows", lambda pushes, work, seed: rows)
        patch.setattr(sys, "argv", ["real", *arguments(folder), "--data", str(folder)])
        assert command.main() == 0
        fitted = half.fitted
        assert command.main() == 0
        assert half.fitted == fitted > 0, "what is kept is not computed again"
    return folder


def arguments(folder: Path) -> list[str]:
    return ["--out", str(folder / "work"), "--page", str(folder / "real.md")]


def results_of(folder: Path) -> dict:
    return json.loads((folder / "work/results.json").read_text())


def test_numbers_of_the_page_are_those_of_the_results(made):
    results = results_of(made)
    shown = results["cases"]["folds"]["errors"]["sim_quadratic"]
    np.testing.assert_allclose(shown["mm"], 3.0, atol=1e-9)
    np.testing.assert_allclose(shown["degrees"][0], np.degrees(0.02), rtol=1e-9)
    results["cases"]["folds"]["errors"]["sim_quadratic"]["mm"][0] = 123.45
    assert "123.45" in page.page(results)
    assert "123.45" not in (made / "real.md").read_text()


def test_the_page_is_made_again_from_the_results_alone(made, monkeypatch):
    text = (made / "real.md").read_bytes()
    (made / "real.md").unlink()
    monkeypatch.setattr(sys, "argv", ["real", *arguments(made), "--again"])
    assert command.main() == 0
    assert (made / "real.md").read_bytes() == text


def test_noise_is_what_the_simulation_added(made):
    noise = results_of(made)["noise"]
    assert noise["pairs"] == 198
    assert 0.2 < noise["mm"][0] < 0.65  # mean distance of a normal of 0.5 mm: 0.63 if all move
    assert noise["share"]["still"][0] < noise["share"]["sain"][0] < 0.1


def test_without_data_the_command_says_where_they_come_from(tmp_path, monkeypatch, capsys):
    for given in ([], ["--data", str(tmp_path / "nothing")]):
        monkeypatch.setattr(sys, "argv", ["real", *arguments(tmp_path), *given])
        assert command.main() == 1
        error = capsys.readouterr().err
        assert "PlanarManipulationToolBox" in error
        assert "DATA=" in error or "nothing" in error
    assert not (tmp_path / "real.md").exists()


def test_a_page_of_others_stays_and_by_default_all_is_written_below_out(
    made, tmp_path, monkeypatch, capsys
):
    (tmp_path / "real.md").write_text("the project's page")
    given = ["real", "--out", str(made / "work"), "--again"]
    monkeypatch.setattr(sys, "argv", [*given, "--page", str(tmp_path / "real.md")])
    assert command.main() == 1
    assert "real.md exists, and no list of SAIN names it; --overwrite" in capsys.readouterr().err
    assert (tmp_path / "real.md").read_text() == "the project's page"
    monkeypatch.setattr(sys, "argv", given)
    assert command.main() == 0
    assert (made / "work" / "real.md").read_text().startswith("# Real pushes")
