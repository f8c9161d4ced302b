"""Models of other packages beside ours in ``evaluate``: named, followed, counted, closed."""

import json
import sys
from importlib.metadata import EntryPoint
from types import ModuleType

import numpy as np
import pytest

from sain_core import model
from sain_core.guarding import plugins
from sain_core.push import LENGTH
from sain_model import commands
from sain_model.evaluation.errors import AT_ONCE
from tests.sain_model.rolling import PUSHES, make_episodes, truth

FEW = np.arange(4 * PUSHES)  # four episodes


class Foreign(model.Model):
    """Physics that is right, but that refuses short pushes and has to be closed."""

    refused = 0

    def __init__(self) -> None:
        self.closed = False
        self.batches: list[int] = []

    def step(self, scenes: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        assert not self.closed
        self.batches.append(len(pushes))
        too_short = pushes[:, LENGTH] < 0.02
        self.refused += int(too_short.sum())
        return np.where(too_short[:, None, None], scenes, truth(scenes, pushes))

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def foreign(monkeypatch):
    """What a package that offers "foreign" has made so far."""
    made: list[Foreign] = []
    module = ModuleType("another_package")
    module.load = lambda name: made.append(Foreign()) or made[-1]  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "another_package", module)
    entry = EntryPoint("foreign", "another_package:load", model.GROUP)
    own = EntryPoint("planar_axes", "sain_model.dynamics.priors:load_prior", model.GROUP)
    monkeypatch.setattr(plugins, "entry_points", lambda group: [entry, own])
    return made


def test_it_is_physics_beside_the_others(tmp_path, foreign):
    folder, out = make_episodes(tmp_path / "data"), tmp_path / "errors.json"
    arguments = [str(folder), "--beside", "foreign", "planar_axes", "--out", str(out)]
    assert commands.evaluate([*arguments, "--open-loop", "1", "3"]) == 0
    report = json.loads(out.read_text())
    assert list(report["refused"]) == ["foreign"] and report["refused"]["foreign"] > 0
    for step in ("1", "3"):
        found = report["after"][step]
        assert "foreign" in found["ratios"]["target"]["SAIN"]  # the best physics
        rows = found["errors"]["target"]
        counts = {rows[name]["number"] for name in ("foreign", "planar, measured", "SAIN")}
        assert len(counts) == 1  # a refused push leaves no window out
    (one,) = foreign
    assert one.closed and max(one.batches) <= AT_ONCE
    text = (tmp_path / "errors_open_loop.md").read_text()
    assert f"* foreign: pushes that could not be carried out in the scenes that it predicted, and" \
        f" moved nothing: {one.refused}\n" in text  # fmt: skip


def test_what_is_not_installed_is_refused_before_anything_is_evaluated(tmp_path, foreign, capsys):
    folder, out = make_episodes(tmp_path / "data", FEW), tmp_path / "errors.json"
    arguments = [str(folder), "--beside", "foreign", "forein", "--out", str(out)]
    assert commands.evaluate(arguments) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert (
        "model 'forein' is unknown (did you mean 'foreign'?); known: foreign, planar_axes" in said
    )
    assert not out.exists() and foreign[0].closed
