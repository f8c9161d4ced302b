"""Errors of rollouts: what they are, over which windows, and what the command lines write."""

import json
from pathlib import Path

import numpy as np
import pytest

from sain_core.errors import CheckpointError, DatasetError
from sain_core.history import PushHistory
from sain_core.model import IdentityPrior, Model, load_dynamics
from sain_core.scene import POSITION, TARGET
from sain_model import commands
from sain_model.cli import evaluate as evaluate_cli
from sain_model.data.dataset import Dataset, split_by_episode
from sain_model.dynamics.checkpoint import ModelCard
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.open_loop import MEASURED, predict_open_loop, roll_out
from sain_model.evaluation.open_loop_errors import errors_after, ratios
from sain_model.evaluation.open_loop_report import report_open_loop
from sain_model.physics.planar import PlanarPrior
from sain_model.serving.server import ModelServer
from sain_model.serving.settings import ServingConfig
from tests.sain_model.rolling import EPISODES, PUSHES, load_episodes, make_episodes, truth

OPTIONS = ["--epochs", "2", "--hidden", "8", "--message", "4", "--test", "0.3"]


class Oracle(Model):
    def step(self, scenes: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        return truth(scenes, pushes)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return load_episodes(tmp_path_factory.mktemp("episodes"))


def test_errors_after_some_pushes_are_what_they_say(data: Dataset) -> None:
    loop = predict_open_loop(data, {"oracle": Oracle()}, PUSHES)
    found = errors_after(loop, 3, seed=0)
    row = found["all"][MEASURED]
    assert row["windows"] == EPISODES * (PUSHES - 2) and row["episodes"] == EPISODES
    off = []
    for first in np.flatnonzero(data.step < PUSHES - 2):
        scene = data.state[first : first + 1]
        for push in data.action[first : first + 3]:
            scene = PlanarPrior().step(scene, push[None])
        off.append(scene[0, TARGET, POSITION] - data.next_state[first + 2, TARGET, POSITION])
    errors = 1e3 * np.linalg.norm(off, axis=-1)
    assert row["target"]["mean"] == pytest.approx(errors.mean())
    assert row["target"]["median"] == pytest.approx(np.median(errors))
    assert row["target"]["p95"] == pytest.approx(np.quantile(errors, 0.95))
    assert row["target"]["low"] < errors.mean() < row["target"]["high"]
    oracle = found["all"]["oracle"]
    assert oracle["mid"]["p95"] == 0.0 and oracle["contacts_agreed"] == 1.0


def test_windows_are_split_by_contact_and_by_what_came_before(data: Dataset) -> None:
    loop = predict_open_loop(data, {}, 2)
    found = errors_after(loop, 1, seed=0)
    counts = {part: rows[MEASURED]["windows"] for part, rows in found.items()}
    way = (data.next_state - data.state)[:, TARGET, POSITION]
    moved = int((np.linalg.norm(way, axis=-1) > 0.002).sum())
    assert 0 < moved < len(data)
    assert counts["contact made"] == moved and counts["contact missed"] == len(data) - moved
    assert counts["3 pushes before and more"] == EPISODES * (PUSHES - 3)
    assert found["contact missed"]["no motion"]["target"]["p95"] < 2.0
    assert found["all"]["no motion"]["contacts_agreed"] == pytest.approx(1 - moved / len(data))


def test_history_is_of_earlier_pushes_alone(data: Dataset) -> None:
    planar = PlanarPrior()
    loop = predict_open_loop(data, {}, 2)
    told = loop.predictions[f"{MEASURED}, history"]
    np.testing.assert_array_equal(told[loop.earlier == 0], loop.predictions[MEASURED][::PUSHES])
    row = 4  # of episode 0: four pushes came before
    past = PushHistory(data.state[:row], data.action[:row], data.next_state[:row])
    knowing = planar.condition(past)
    expected = roll_out(knowing, data.state[row : row + 1], data.action[None, row : row + 2])
    np.testing.assert_allclose(told[row], expected[0], atol=1e-9)


def test_what_is_recorded_for_single_pushes_is_known_for_them_alone(data: Dataset) -> None:
    loop = predict_open_loop(data, {}, 2)
    bullet = loop.predictions["bullet, nominal"]
    np.testing.assert_array_equal(bullet[:, 0], data.physics_next)
    assert np.isnan(bullet[:, 1]).all()
    found = errors_after(loop, 2, seed=0)
    assert "bullet, nominal" not in found["all"] and "floor" not in found["all"]


def test_ratios_are_of_means_with_an_interval(data: Dataset) -> None:
    still = {"still": IdentityPrior(), "also still": IdentityPrior(), "oracle": Oracle()}
    loop = predict_open_loop(data, still, 3)
    found = ratios(loop, 3, "still", seed=0)
    assert found["also still"] == [1.0, 1.0, 1.0]
    assert found["oracle"] == [0.0, 0.0, 0.0]
    ratio, low, high = found[MEASURED]
    assert low < ratio < high < 1.0


def test_steps_that_no_window_reaches_are_left_out(data: Dataset, tmp_path: Path) -> None:
    report = report_open_loop(tmp_path / "errors.json", data, {}, 0, (1, PUSHES, 15))
    assert set(report) == {"1", str(PUSHES)}
    assert report["1"]["best_physics"].startswith("planar")


def test_the_command_lines_make_and_compare_the_four_kinds(tmp_path: Path) -> None:
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
        assert isinstance(sain, SainDynamics)
        assert card["kind"] == sain.kind == kind
        server = ModelServer(sain, ServingConfig(model=str(paths[kind])))
        assert server.description.kind == kind
        shown = card["errors"]["open_loop"]["5"]
        assert shown["windows"] == 10  # 5 episodes of 6 pushes held out
        name = "learned only" if kind == "learned" else f"{kind} SAIN"
        assert set(shown["target_mean"]) == {MEASURED, name}
    assert card["rollouts"]["steps_ahead"] == 3
    assert card["training"]["rollouts"]["best_epoch"] in (1, 2)
    assert (tmp_path / "recurrent" / "rollout_loss.png").exists()

    out = tmp_path / "errors.json"
    arguments = ["--checkpoint", str(paths["residual"]), "--learned", str(paths["learned"])]
    arguments += ["--recurrent", str(paths["recurrent"]), "--out", str(out)]
    arguments += ["--beside", "planar_axes", str(paths["recurrent"])]
    assert commands.evaluate([str(folder), *arguments, "--open-loop", "1", "5"]) == 0
    report = json.loads(out.read_text())
    rows = report["open_loop"]["5"]["errors"]["all"]
    assert {"learned only", "residual SAIN", "recurrent SAIN", "no motion"} <= set(rows)
    assert {"planar, measured, history", "recurrent SAIN, history"} <= set(rows)
    assert rows[str(paths["recurrent"])] == rows["recurrent SAIN"]
    assert rows["planar_axes"] != rows["planar, measured"]
    alone = report["open_loop"]["1"]["errors"]["all"]["residual SAIN"]["target"]["mean"]
    assert alone == pytest.approx(report["all"]["SAIN"]["target_mean"])
    table = (tmp_path / "errors_open_loop.md").read_text()
    assert "### After 5 pushes, all" in table and "| recurrent SAIN, history |" in table
    assert (tmp_path / "errors_open_loop.png").stat().st_size > 10_000


def test_what_any_model_has_seen_is_not_evaluated_on(data: Dataset) -> None:
    def card(seed: int, test: float = 0.3) -> ModelCard:
        training = {"seed": seed, "validation": 0.1, "test": test}
        return ModelCard("planar", {}, {}, data={"sha256": data.sha256}, training=training)

    held = evaluate_cli.unseen(data, card(0), card(1))
    both = [split_by_episode(data, seed, 0.1, 0.3).test.episode for seed in (0, 1)]
    assert set(held.episode) == set(both[0]) & set(both[1])
    other = ModelCard("planar", {}, {}, data={"sha256": "other"})
    assert len(evaluate_cli.unseen(data, other)) == len(data)
    mute = ModelCard("planar", {}, {}, data={"sha256": data.sha256}, training={"seed": 0})
    with pytest.raises(CheckpointError, match="which episodes of its data it has seen"):
        evaluate_cli.unseen(data, mute)
    with pytest.raises(DatasetError, match="trained on all episodes between them"):
        evaluate_cli.unseen(data, *(card(seed, 0.1) for seed in range(6)))
