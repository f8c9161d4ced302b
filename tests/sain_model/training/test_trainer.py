import json
from pathlib import Path

import numpy as np
import pytest
import torch

from sain_core.errors import CheckpointError
from sain_core.model import load_dynamics
from sain_core.randomness import bootstrap_mean, generator
from sain_core.scene import POSITION, TARGET
from sain_core.transitions import MOVED
from sain_model import commands
from sain_model.data.dataset import Split, load_dataset, split_by_episode
from sain_model.data.examples import Examples
from sain_model.dynamics.residual import residual_model
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.errors import TARGET_MOVED, TARGETS, evaluate, position_errors
from sain_model.inference.kinds import friction_kind
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.training.objectives import mixed_loss
from sain_model.training.settings import LossConfig, TrainingConfig
from tests.sain_model.conftest import make_trainer, write_dataset

SMALL = NetworkConfig(hidden=32, message=8)


@pytest.fixture
def split(dataset: Path) -> Split:
    return split_by_episode(load_dataset(dataset), 0, 0.2, 0.2)


def test_training_learns_a_residual(tmp_path: Path) -> None:
    split = split_by_episode(load_dataset(write_dataset(tmp_path, 100)), 0, 0.2, 0.2)
    config = TrainingConfig(
        epochs=60, batch=16, network=SMALL, loss=LossConfig(position_scale=0.005)
    )
    prior = PlanarPrior()
    trainer = make_trainer(split, prior, config, tmp_path)
    trainer.run()
    sain = residual_model(trainer.network, friction_kind(prior, infers=False), "planar")
    test = split.test.alike
    before, after = (
        position_errors(model.step(test.state, test.action), test.next_state, TARGET)
        for model in (prior, sain)
    )
    assert after.mean() < 0.6 * before.mean()
    history = trainer.history
    assert history.validation[history.best] == min(history.validation)


def test_a_killed_training_goes_on_to_the_same_weights(split: Split, tmp_path: Path) -> None:
    config = TrainingConfig(epochs=4, batch=32, network=SMALL)
    whole = make_trainer(split, PlanarPrior(), config, tmp_path / "whole")
    whole.run()

    class KillError(Exception):
        pass

    def kill(epoch: int, history: object) -> None:
        if epoch == 2:
            raise KillError

    with pytest.raises(KillError):
        make_trainer(split, PlanarPrior(), config, tmp_path / "cut").run(kill)
    resumed = make_trainer(split, PlanarPrior(), config, tmp_path / "cut")
    assert resumed.epoch == 2
    resumed.run()
    assert resumed.history == whole.history
    for name, value in whole.network.state_dict().items():
        assert torch.equal(resumed.network.state_dict()[name], value), name


def test_a_state_of_other_settings_or_damaged_is_refused(split: Split, tmp_path: Path) -> None:
    config = TrainingConfig(epochs=1, network=SMALL)
    make_trainer(split, PlanarPrior(), config, tmp_path).run()
    with pytest.raises(CheckpointError, match="belongs to other settings or data"):
        make_trainer(split, PlanarPrior(), TrainingConfig(epochs=2, network=SMALL), tmp_path)
    (tmp_path / "training.pt").write_bytes(b"half")
    with pytest.raises(CheckpointError, match="is damaged"):
        make_trainer(split, PlanarPrior(), config, tmp_path)


def test_the_loss_is_the_papers() -> None:
    """Without robustness: |dp|^2 + |dv|^2 + |d sin|^2 + |d cos|^2, averaged over disks."""
    random = torch.Generator().manual_seed(0)
    residual, velocity, predicted = (torch.randn(5, 2, 3, generator=random) for _ in range(3))
    examples = Examples(torch.zeros(5, 2, 1), torch.zeros(5, 2, 1), residual, velocity)
    ones = LossConfig(robust=False, position_scale=1.0, velocity_scale=1.0, heading_scale=1.0)
    rows = torch.arange(5)
    angle, guess = residual[..., 2], predicted[..., 2]
    expected = (
        (residual - predicted)[..., :2].square().sum(-1)
        + velocity.square().sum(-1)
        + (angle.sin() - guess.sin()).square()
        + (angle.cos() - guess.cos()).square()
    ).mean()
    assert mixed_loss(predicted, examples, rows, ones).item() == pytest.approx(expected.item())
    robust = mixed_loss(100 * predicted, examples, rows, LossConfig(robust=True))
    assert robust < mixed_loss(100 * predicted, examples, rows, LossConfig(robust=False))


def test_the_command_lines_end_in_a_checkpoint_and_a_report(dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    options = ["--epochs", "2", "--hidden", "8", "--message", "4", "--test", "0.3"]
    assert commands.train([str(dataset), "--out", str(out), *options]) == 0
    names = {path.name for path in out.iterdir()}
    assert {"sain.safetensors", "sain.json", "loss.png", "config.json"} <= names
    card = json.loads((out / "sain.json").read_text())
    assert card["data"]["episodes"] == {"train": 12, "validation": 2, "test": 6}
    assert sum(card["data"]["transitions"].values()) == 120
    errors = card["errors"]["after"]["1"]["errors"][TARGETS]
    assert errors["SAIN"]["number"] == card["data"]["transitions"]["test"]
    sain = load_dynamics(str(out / "sain.safetensors"))
    assert isinstance(sain, SainDynamics) and sain.origin.kind == "residual"
    assert card["friction"] == {"width": 0.5}

    learned = tmp_path / "learned"
    assert (
        commands.train([str(dataset), "--out", str(learned), *options, "--prior", "identity"]) == 0
    )
    report = tmp_path / "errors.json"
    arguments = ["--checkpoint", str(out / "sain.safetensors"), "--out", str(report)]
    arguments += ["--beside", str(learned / "sain.safetensors")]
    assert commands.evaluate([str(dataset), *arguments]) == 0
    errors = json.loads(report.read_text())
    assert errors["transitions"] == card["data"]["transitions"]["test"]
    groups = errors["after"]["1"]["errors"]
    assert groups[TARGETS]["SAIN"] == card["errors"]["after"]["1"]["errors"][TARGETS]["SAIN"]
    assert set(groups[TARGETS]) == {
        "no motion",
        "planar, nominal",
        "bullet, nominal",
        "planar, measured",
        "planar, true friction",
        "learned only",
        "SAIN",
        "planar, history",
        "its prior, history",
        "SAIN, history",
        "SAIN, true friction",
        "floor",
    }
    earlier = [groups[f"target, {name} earlier"] for name in ("0", "1", "2", "3+")]
    assert [group["SAIN"]["number"] for group in earlier] == [6, 6, 6, 18]
    assert earlier[0]["SAIN, history"]["mm"] == earlier[0]["SAIN"]["mm"]
    assert earlier[3]["SAIN, history"]["mm"] != earlier[3]["SAIN"]["mm"]
    assert groups[TARGETS]["floor"]["mm"][0] == pytest.approx(0.1 * 2**0.5)


def test_a_command_line_says_what_is_wrong(
    dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert commands.train([str(tmp_path / "none"), "--out", str(tmp_path)]) == 1
    assert "does not exist" in " ".join(capsys.readouterr().err.split())
    missing = str(tmp_path / "m.safetensors")
    assert commands.evaluate([str(dataset), "--checkpoint", missing]) == 1
    assert "does not exist" in " ".join(capsys.readouterr().err.split())


def test_errors_are_what_they_say(dataset: Path) -> None:
    data = load_dataset(dataset)
    found, part = evaluate(data, {}), data.alike
    groups = found["after"]["1"]["errors"]
    off = position_errors(PlanarPrior().step(part.state, part.action), part.next_state, TARGET)
    row = groups[TARGETS]["planar, measured"]
    assert row["mm"][0] == pytest.approx(off.mean())
    assert row["p95"] == pytest.approx(np.quantile(off, 0.95))
    moved = np.linalg.norm((part.next_state - part.state)[:, TARGET, POSITION], axis=-1) > MOVED
    assert groups[TARGET_MOVED]["no motion"]["number"] == moved.sum()
    shares = found["removed"][TARGET_MOVED]
    assert shares["planar, measured"] == pytest.approx(0.0, abs=1e-9)
    assert shares["no motion"] < 0.0


def test_the_interval_is_over_episodes() -> None:
    episodes = np.repeat(np.arange(50), 20)
    values = np.repeat(np.random.default_rng(0).normal(size=50), 20)
    _, low, high = bootstrap_mean(values, generator(0, "bootstrap"), episodes)
    assert low < values.mean() < high
    assert high - low == pytest.approx(2 * 1.96 * values.std() / 50**0.5, rel=0.15)
