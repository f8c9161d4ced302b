"""Errors of pushes and rollouts: what they are, over which windows, and what is drawn."""

import json

import numpy as np
import pytest

from sain_core.model import IdentityPrior, Model, load_dynamics
from sain_core.scene import POSITION, TARGET
from sain_model import commands
from sain_model.data.dataset import Dataset
from sain_model.evaluation.errors import (
    MEASURED,
    NAMES,
    PUSHED,
    TARGET_MISSED,
    TARGET_MOVED,
    TARGETS,
    evaluate,
)
from sain_model.physics.planar import PlanarPrior
from sain_model.serving.server import ModelServer
from sain_model.serving.service import ServingConfig
from tests.sain_model.rolling import EPISODES, PUSHES, load_episodes, make_episodes, truth

OPTIONS = ["--epochs", "2", "--hidden", "8", "--message", "4", "--test", "0.3"]


class Oracle(Model):
    def step(self, scenes: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        return truth(scenes, pushes)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return load_episodes(tmp_path_factory.mktemp("episodes"))


def test_errors_after_some_pushes_are_what_they_say(data):
    found = evaluate(Dataset((data,)), {"oracle": Oracle()}, (3,))["after"]["3"]["errors"]
    row = found[TARGETS][MEASURED]
    assert row["number"] == EPISODES * (PUSHES - 2)
    off = []
    for first in np.flatnonzero(data.step < PUSHES - 2):
        scene = data.state[first : first + 1]
        for push in data.action[first : first + 3]:
            scene = PlanarPrior().step(scene, push[None])
        off.append(scene[0, TARGET, POSITION] - data.next_state[first + 2, TARGET, POSITION])
    errors = 1e3 * np.linalg.norm(off, axis=-1)
    mean, low, high = row["mm"]
    assert mean == pytest.approx(errors.mean()) and low < mean < high
    assert row["median"] == pytest.approx(np.median(errors))
    assert row["p95"] == pytest.approx(np.quantile(errors, 0.95))
    oracle = found[PUSHED]["oracle"]
    assert oracle["p95"] == 0.0 and oracle["agreed"] == 1.0


def test_groups_are_by_contact_and_by_what_came_before(data):
    found = evaluate(Dataset((data,)), {})["after"]["1"]["errors"]
    counts = {group: rows[MEASURED]["number"] for group, rows in found.items()}
    way = (data.next_state - data.state)[:, TARGET, POSITION]
    moved = int((np.linalg.norm(way, axis=-1) > 0.002).sum())
    assert 0 < moved < len(data)
    assert counts[TARGET_MOVED] == moved and counts[TARGET_MISSED] == len(data) - moved
    assert counts["target, 3+ earlier"] == EPISODES * (PUSHES - 3)
    assert found[TARGET_MISSED]["no motion"]["p95"] < 2.0
    assert found[TARGETS]["no motion"]["agreed"] == pytest.approx(1 - moved / len(data))


def test_ratios_are_of_means_with_an_interval(data):
    still = {"still": IdentityPrior(), "oracle": Oracle()}
    found = evaluate(Dataset((data,)), still, (3,))["after"]["3"]
    (below,) = found["ratios"][TARGETS]["oracle"]
    assert below.startswith("planar")
    assert tuple(found["ratios"][TARGETS]["oracle"][below]["mm"]) == (0.0, 0.0, 0.0)
    ratio, low, high = found["ratios"][TARGETS]["still"][below]["mm"]
    assert 1.0 < low < ratio < high
    errors = found["errors"][TARGETS]
    assert ratio == pytest.approx(errors["still"]["mm"][0] / errors[below]["mm"][0])


def test_the_command_lines_make_and_compare_the_four_kinds(tmp_path):
    folder = make_episodes(tmp_path / "data")
    kinds = {
        "learned": ["--prior", "identity"],
        "residual": [],
        "recurrent": ["--steps-ahead", "3", "--rollout-epochs", "2"],
    }
    paths = {kind: tmp_path / kind / "sain.safetensors" for kind in kinds}
    for kind, more in kinds.items():
        assert commands.train([str(folder), "--out", str(tmp_path / kind), *OPTIONS, *more]) == 0
        card = json.loads(paths[kind].with_suffix(".json").read_text())
        sain = load_dynamics(str(paths[kind]))
        assert card["kind"] == sain.origin.kind == kind
        server = ModelServer(sain, ServingConfig(model=str(paths[kind])))
        assert server.origin.kind == kind
        shown = card["errors"]["after"]["1"]["errors"][TARGETS]
        assert shown[NAMES[kind]]["number"] == 30  # 5 episodes of 6 pushes held out
        names = {path.name for path in (tmp_path / kind).iterdir()}
        assert {"sain.safetensors", "sain.json", "loss.png", "config.json"} <= names
    assert card["training"]["steps_ahead"] == 3
    assert card["training"]["rollouts"]["best_epoch"] in (1, 2)
    assert (tmp_path / "recurrent" / "rollout_loss.png").exists()

    out = tmp_path / "errors.json"
    arguments = ["--checkpoint", str(paths["residual"]), "--out", str(out), "--beside"]
    arguments += [str(paths["learned"]), str(paths["recurrent"]), "planar_axes"]
    assert commands.evaluate([str(folder), *arguments, "--open-loop", "1", "5"]) == 0
    rows = json.loads(out.read_text())["after"]["5"]["errors"][TARGETS]
    assert {"learned only", "SAIN", "recurrent SAIN", "no motion"} <= set(rows)
    assert {"planar, history", "recurrent SAIN, history"} <= set(rows)
    assert rows["planar_axes"] != rows["planar, measured"]
    table = (tmp_path / "errors_open_loop.md").read_text()
    assert "### After 5 pushes, target" in table and "| recurrent SAIN, history |" in table
    assert (tmp_path / "errors_open_loop.png").stat().st_size > 10_000
