"""The picture of README: it has the numbers of the page of results."""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.results import results_figure
from benchmarks.results.results_figure import read_overview
from tests.paths import ROOT

PAGE = ROOT / "docs/reference/results.md"


@pytest.fixture
def draw(tmp_path, monkeypatch):
    def pixels_of(text: str) -> np.ndarray:
        page, out = tmp_path / "results.md", tmp_path / "results.png"
        page.write_text(text)
        command = ["results_figure", "--page", str(page), "--out", str(out)]
        monkeypatch.setattr(sys, "argv", command)
        results_figure.main()
        return pixels(out)

    return pixels_of


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB"), dtype=int)


def changed(one: np.ndarray, other: np.ndarray) -> int:
    """How many pixels differ by more than smoothing."""
    return int((np.abs(one - other).max(axis=-1) > 64).sum()) if one.shape == other.shape else -1


def test_the_numbers_are_those_of_the_overview():
    page = PAGE.read_text()
    found = {(one.scenario, one.world, one.model): one for one in read_overview(page)}
    shipped = found["anywhere", "Bullet", "SAIN as shipped"]
    cell = f"{shipped.solved}/{shipped.scenes},\N{NO-BREAK SPACE}{shipped.pushes}"
    assert cell in next(line for line in page.splitlines() if line.startswith("| `anywhere` |"))
    assert {world for _, world, _ in found} == {
        "Bullet",
        "Bullet, rough",
        "MuJoCo",
        "MuJoCo, measured",
        "gym-pusht",
    }


def test_the_picture_of_the_readme_is_that_of_the_page(draw):
    shown = pixels(ROOT / "docs/media/results.png")
    assert changed(shown, draw(PAGE.read_text())) == 0, "make it again: its command is in README"
