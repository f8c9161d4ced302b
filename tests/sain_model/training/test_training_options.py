"""Schedules, early stop, presets, TensorBoard, and a training that is killed."""

import json
import math
import os
import signal
import struct
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from sain_bringup.graph import executable
from sain_core.cli.command_line import read_options
from sain_core.errors import ConfigError
from sain_model import commands
from sain_model.cli import train
from sain_model.data.dataset import Split, load_dataset, split_by_episode
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.training.progress import FOLDER, event_log
from sain_model.training.settings import (
    ADAM,
    HALVING_EPOCHS,
    HALVING_STEPS,
    LAMBDA,
    PAPER,
    PRESETS,
    OptimizerConfig,
    TrainingConfig,
    TrainOptions,
)
from sain_model.training.trainer import Batches
from tests.sain_model.conftest import make_trainer

SMALL = NetworkConfig(hidden=8, message=4)


@pytest.fixture
def split(dataset: Path) -> Split:
    return split_by_episode(load_dataset(dataset), 0, 0.2, 0.2)


def test_the_learning_rate_falls_along_a_cosine_or_by_halves() -> None:
    cosine = OptimizerConfig()
    assert [cosine.rate(e, 40, 0) for e in (0, 20)] == pytest.approx([1.0, 0.5])
    assert cosine.rate(39, 40, 0) == pytest.approx((1 + math.cos(math.pi * 39 / 40)) / 2)
    steps = OptimizerConfig(schedule=HALVING_STEPS, halving=2500)
    assert [steps.rate(0, 1, s) for s in (0, 2499, 2500, 7500)] == [1.0, 1.0, 0.5, 0.125]
    epochs = OptimizerConfig(schedule=HALVING_EPOCHS, halving=2500)
    assert [epochs.rate(e, 8000, 10**6) for e in (0, 2499, 2500, 7999)] == [1.0, 1.0, 0.5, 0.125]


def test_adam_adds_the_l2_term_of_equation_5() -> None:
    weight = torch.nn.Parameter(torch.tensor([0.3, -2.0]))
    other = torch.nn.Parameter(weight.detach().clone())
    settings = OptimizerConfig(ADAM)
    with_decay = settings.make([weight], 1e-3, 2 * 0.05)
    without = settings.make([other], 1e-3, 0.0)
    for _ in range(3):
        for parameter, optimiser, penalty in ((weight, with_decay, 0.0), (other, without, 0.05)):
            loss = (parameter - 1.0).square().sum() + penalty * parameter.square().sum()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
    torch.testing.assert_close(weight, other)


def test_an_epoch_of_so_many_steps_goes_on_where_the_last_one_stopped() -> None:
    config = TrainingConfig(seed=3, batch=16)
    by_steps = Batches(replace(config, epoch_steps=3), np.arange(100), 1)
    by_pass = Batches(config, np.arange(100), 1)
    steps = [rows for epoch in range(7) for rows in by_steps.epoch(epoch)]
    passes = [rows for epoch in range(3) for rows in by_pass.epoch(epoch)]
    assert len(steps) == len(passes) == 21
    assert all(torch.equal(a, b) for a, b in zip(steps, passes, strict=True))


def test_patience_ends_a_training_that_brings_nothing_more(split: Split, tmp_path: Path) -> None:
    config = TrainingConfig(epochs=60, batch=16, network=SMALL, patience=3, learning_rate=0.05)
    stopped = make_trainer(split, PlanarPrior(), config, tmp_path)
    stopped.run()
    history = stopped.history
    assert stopped.epoch < 60 and stopped.epoch == history.best + 1 + 3
    again = make_trainer(split, PlanarPrior(), config, tmp_path)
    again.run()  # it is finished: it only takes the best weights
    assert again.history == history
    for name, value in stopped.network.state_dict().items():
        assert torch.equal(again.network.state_dict()[name], value)


def test_only_validated_epochs_can_be_best(split: Split, tmp_path: Path) -> None:
    config = TrainingConfig(epochs=8, batch=16, network=SMALL)
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


def test_the_papers_settings_are_one_word_and_can_be_changed() -> None:
    command = parsed(["data", "--out", "out", "--preset", "paper"])
    training = command.training
    assert training == PAPER == PRESETS["paper"]
    assert (training.batch, training.epochs, training.validate_every) == (16, 8000, 500)
    assert (training.learning_rate, training.optimizer) == (
        1e-3,
        OptimizerConfig(ADAM, HALVING_STEPS, 2500),
    )
    assert training.weight_decay == 2 * LAMBDA and not training.loss.robust
    assert training.validation == 0.2
    changed = parsed(["d", "--out", "o", "--preset", "paper", "--validation", "0.1"])
    assert changed.training == replace(PAPER, validation=0.1)
    assert parsed(["d", "--out", "o"]).training == TrainingConfig()
    steps, epochs = PRESETS["paper-steps"], PRESETS["paper-epochs"]
    assert steps.epochs * steps.epoch_steps == 8000
    assert epochs.optimizer.rate(7999, 8000, 10**7) == 0.125
    with pytest.raises(ConfigError, match=r"OptimizerConfig.schedule is 'linear'"):
        OptimizerConfig(schedule="linear")


def test_the_settings_beside_a_checkpoint(dataset: Path, tmp_path: Path) -> None:
    options = ["--preset", "paper-steps", "--epochs", "2", "--epoch-steps", "3", "--hidden", "8"]
    assert commands.train([str(dataset), "--out", str(tmp_path), *options]) == 0
    settings = json.loads((tmp_path / "config.json").read_text())
    card = json.loads((tmp_path / "sain.json").read_text())
    assert settings["training"]["batch"] == card["training"]["batch"] == 16
    assert settings["training"]["optimizer"]["optimizer"] == "adam"
    assert settings["data_sha256"] == card["data"]["sha256"]
    assert settings["training"]["seed"] == card["training"]["seed"] == 0
    assert settings["environment"] == card["versions"]
    assert card["versions"]["torch"] == torch.__version__
    assert card["training"]["epochs_done"] == 2
    before = (tmp_path / "config.json").read_bytes()
    assert commands.train([str(dataset), "--out", str(tmp_path), "--epochs", "3"]) == 1
    assert (tmp_path / "config.json").read_bytes() == before  # of the training that is there


def events(folder: Path) -> list[tuple[str, int, float]]:
    """Read what a TensorBoard would: records of 8 bytes length, 4 check, content, 4 check."""
    from tensorboardX.proto.event_pb2 import Event

    found = []
    for path in sorted(folder.glob("events.*")):
        content, place = path.read_bytes(), 0
        while place < len(content):
            (length,) = struct.unpack_from("<Q", content, place)
            event = Event.FromString(content[place + 12 : place + 12 + length])
            found += [(v.tag, event.step, v.simple_value) for v in event.summary.value]
            place += 16 + length
    return found


def test_tensorboard_gets_the_losses(dataset: Path, tmp_path: Path) -> None:
    options = ["--epochs", "3", "--hidden", "8", "--tensorboard"]
    assert commands.train([str(dataset), "--out", str(tmp_path), *options]) == 0
    state = torch.load(tmp_path / "training.pt", weights_only=True)
    expected = [
        (f"loss/{name}", epoch, pytest.approx(state[name][epoch - 1]))
        for epoch in (1, 2, 3)
        for name in ("train", "validation")
    ]
    found = [(tag.replace("training", "train"), *rest) for tag, *rest in events(tmp_path / FOLDER)]
    assert found == expected


def test_without_tensorboardx_it_says_what_to_install(
    dataset: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(sys.modules, "tensorboardX", None)
    options = ["--epochs", "1", "--hidden", "8"]
    assert commands.train([str(dataset), "--out", str(tmp_path), *options, "--tensorboard"]) == 1
    assert "pip install 'sain_model[tensorboard]'" in " ".join(capsys.readouterr().err.split())
    with pytest.raises(ConfigError, match="needs tensorboardX"), event_log(tmp_path, 0):
        pass
    assert commands.train([str(dataset), "--out", str(tmp_path), *options]) == 0


def test_an_ensemble_that_is_killed_in_training_ends_in_the_same_bytes(
    dataset: Path, tmp_path: Path
) -> None:
    options = ["--epochs", "25", "--hidden", "8", "--message", "4", "--batch", "8"]
    options += ["--members", "3"]
    assert commands.train([str(dataset), "--out", str(tmp_path / "whole"), *options]) == 0
    cut = tmp_path / "cut"
    command = [
        str(executable("sain_model", "train")),
        str(dataset),
        "--out",
        str(cut),
    ]
    child = subprocess.Popen(
        [*command, *options],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )
    while not (cut / "training.pt").exists():
        assert child.poll() is None
        time.sleep(0.005)
    os.killpg(child.pid, signal.SIGKILL)
    assert child.wait() == -signal.SIGKILL
    assert not (cut / "sain.safetensors").exists()
    done = len(torch.load(cut / "training.pt", weights_only=True)["train"])
    assert 1 <= done < 25
    assert commands.train([str(dataset), "--out", str(cut), *options]) == 0
    whole = (tmp_path / "whole" / "sain.safetensors").read_bytes()
    assert (cut / "sain.safetensors").read_bytes() == whole
    cards = [json.loads((tmp_path / run / "sain.json").read_text()) for run in ("whole", "cut")]
    assert cards[0]["intervals"] == cards[1]["intervals"]
    assert cards[0]["training"] == cards[1]["training"]
