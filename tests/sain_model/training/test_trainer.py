"""Training: what is learned, settings, resuming after a stop, and what a person sees of it."""

import json
import math
from dataclasses import replace
from importlib.metadata import version

import pytest
import torch

from sain_core.cli.arguments import read_options
from sain_core.cli.program import main
from sain_core.errors import CheckpointError, ConfigError
from sain_core.scene import TARGET
from sain_model import commands
from sain_model.cli import train
from sain_model.data.dataset import load_dataset, split_by_episode
from sain_model.dynamics.sain import residual_model
from sain_model.evaluation.errors import position_errors
from sain_model.inference.kinds import friction_kind
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.training.objectives import Examples, mixed_loss
from sain_model.training.settings import (
    ADAM,
    HALVING_STEPS,
    LAMBDA,
    PAPER,
    PRESETS,
    TrainingConfig,
    TrainOptions,
)
from tests.sain_model.conftest import make_trainer, write_dataset

SMALL = NetworkConfig(hidden=32, message=8)


@pytest.fixture
def split(dataset):
    return split_by_episode(load_dataset(dataset), 0, 0.2, 0.2)


def test_training_learns_a_residual(tmp_path):
    split = split_by_episode(load_dataset(write_dataset(tmp_path, 60)), 0, 0.2, 0.2)
    config = TrainingConfig(
        epochs=30, batch=16, learning_rate=4e-3, network=SMALL, position_scale=0.005
    )
    prior = PlanarPrior()
    trainer = make_trainer(split, prior, config, tmp_path)
    trainer.run()
    sain = residual_model(trainer.network.weights, friction_kind(prior, infers=False), "planar")
    test = split.test.alike
    before, after = (
        position_errors(model.step(test.state, test.action), test.next_state, TARGET)
        for model in (prior, sain)
    )
    assert after.mean() < 0.7 * before.mean()
    history = trainer.history
    assert history.validation[history.best] == min(history.validation)


def test_the_loss_is_the_papers():
    """Without robustness: |dp|^2 + |dv|^2 + |d sin|^2 + |d cos|^2, averaged over disks."""
    random = torch.Generator().manual_seed(0)
    residual, velocity, predicted = (torch.randn(5, 2, 3, generator=random) for _ in range(3))
    examples = Examples(torch.zeros(5, 2, 1), torch.zeros(5, 2, 1), residual, velocity)
    ones = TrainingConfig(robust=False, position_scale=1.0, velocity_scale=1.0, heading_scale=1.0)
    rows = torch.arange(5)
    angle, guess = residual[..., 2], predicted[..., 2]
    expected = (
        (residual - predicted)[..., :2].square().sum(-1)
        + velocity.square().sum(-1)
        + (angle.sin() - guess.sin()).square()
        + (angle.cos() - guess.cos()).square()
    ).mean()
    assert mixed_loss(predicted, examples, rows, ones).item() == pytest.approx(expected.item())
    robust = mixed_loss(100 * predicted, examples, rows, TrainingConfig(robust=True))
    assert robust < mixed_loss(100 * predicted, examples, rows, TrainingConfig(robust=False))


def test_a_command_line_says_what_is_wrong(dataset, tmp_path, capsys):
    assert commands.train([str(tmp_path / "none"), "--out", str(tmp_path)]) == 1
    assert "does not exist" in " ".join(capsys.readouterr().err.split())
    missing = str(tmp_path / "m.safetensors")
    assert commands.evaluate([str(dataset), "--checkpoint", missing]) == 1
    assert "does not exist" in " ".join(capsys.readouterr().err.split())


TINY = NetworkConfig(hidden=8, message=4)


def test_patience_ends_a_training_that_brings_nothing_more(split, tmp_path):
    config = TrainingConfig(epochs=60, batch=16, network=TINY, patience=3, learning_rate=0.05)
    stopped = make_trainer(split, PlanarPrior(), config, tmp_path)
    stopped.run()
    history = stopped.history
    assert stopped.epoch < 60 and stopped.epoch == history.best + 1 + 3
    again = make_trainer(split, PlanarPrior(), config, tmp_path)
    again.run()  # it is finished: it only takes the best weights
    assert again.history == history
    for name, value in stopped.network.state_dict().items():
        assert torch.equal(again.network.state_dict()[name], value)


def test_only_validated_epochs_can_be_best(split, tmp_path):
    config = TrainingConfig(epochs=8, batch=16, network=TINY)
    every = make_trainer(split, PlanarPrior(), config, tmp_path / "1")
    every.run()
    third = make_trainer(split, PlanarPrior(), replace(config, validate_every=3), tmp_path / "3")
    third.run()
    assert third.history.train == every.history.train
    losses = every.history.validation
    seen = [math.inf, math.inf, losses[2], losses[2], losses[2], losses[5], losses[5], losses[7]]
    assert third.history.validation == seen
    assert third.history.best in (2, 5, 7)


def parsed(arguments: list[str]) -> TrainOptions:
    options: TrainOptions = read_options(train.options(arguments), "train", arguments)
    return options


def test_the_papers_settings_are_one_word_and_can_be_changed():
    command = parsed(["data", "--out", "out", "--preset", "paper"])
    training = command.training
    assert training == PAPER == PRESETS["paper"]
    assert (training.batch, training.epochs, training.validate_every) == (16, 8000, 500)
    assert (training.learning_rate, training.optimizer) == (1e-3, ADAM)
    assert (training.schedule, training.halving) == (HALVING_STEPS, 2500)
    assert training.weight_decay == 2 * LAMBDA and not training.robust
    assert training.validation == 0.2
    changed = parsed(["d", "--out", "o", "--preset", "paper", "--validation", "0.1"])
    assert changed.training == replace(PAPER, validation=0.1)
    assert parsed(["d", "--out", "o"]).training == TrainingConfig()
    steps, epochs = PRESETS["paper-steps"], PRESETS["paper-epochs"]
    assert steps.epochs * steps.epoch_steps == 8000
    assert epochs.rate(7999, 10**7) == 0.125 * 1e-3
    with pytest.raises(ConfigError, match=r"TrainingConfig.schedule is 'linear'"):
        TrainingConfig(schedule="linear")
    with pytest.raises(ConfigError, match="steps_ahead 3; rollouts infer the friction alone"):
        TrainingConfig(history="earlier", steps_ahead=3)


def test_the_settings_beside_a_checkpoint(dataset, tmp_path):
    options = ["--preset", "paper-steps", "--epochs", "2", "--epoch-steps", "3", "--hidden", "8"]
    assert commands.train([str(dataset), "--out", str(tmp_path), *options]) == 0
    settings = json.loads((tmp_path / "config.json").read_text())
    card = json.loads((tmp_path / "sain.json").read_text())
    assert settings["training"].items() <= card["training"].items()
    assert (card["training"]["batch"], card["training"]["optimizer"]) == (16, "adam")
    assert settings["data_sha256"] == card["data"]["sha256"]
    assert settings["environment"] == card["versions"]
    assert card["versions"]["sain"] == version("sain")
    assert card["training"]["epochs_done"] == 2
    before = (tmp_path / "config.json").read_bytes()
    assert commands.train([str(dataset), "--out", str(tmp_path), "--epochs", "3"]) == 1
    assert (tmp_path / "config.json").read_bytes() == before  # of the training that is there


def test_a_killed_training_goes_on_to_the_same_weights(split, tmp_path):
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
    with pytest.raises(CheckpointError, match="belongs to other settings or data"):
        make_trainer(split, PlanarPrior(), replace(config, epochs=9), tmp_path / "cut")
    (tmp_path / "cut" / "training.pt").write_bytes(b"half")
    with pytest.raises(CheckpointError, match="is damaged"):
        make_trainer(split, PlanarPrior(), config, tmp_path / "cut")


@pytest.mark.parametrize("name", ["../mine", "", ".mine", "/tmp/mine", "*", "config"])
def test_a_checkpoint_has_a_name_in_its_folder(name, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["train", str(tmp_path), "--out", str(out), "--name", name]) != 0
    assert capsys.readouterr().err.startswith(f"train: --name is {name!r}; allowed: letters")
    assert not [*tmp_path.iterdir()]
