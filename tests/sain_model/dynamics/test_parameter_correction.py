"""A network inside physics finds out what physics was not told; and keeps it."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from sain_core.errors import CheckpointError
from sain_core.model import load_dynamics
from sain_core.push import LENGTH
from sain_core.scene import POSITION, TARGET
from sain_model import commands
from sain_model.data.dataset import Split, split_by_episode
from sain_model.data.mixed import load_transitions
from sain_model.dynamics import corrections as told
from sain_model.dynamics.checkpoint import (
    CORRECTION_ARCHITECTURE,
    ModelCard,
    card_path,
    save_checkpoint,
)
from sain_model.dynamics.correction_network import CorrectionEnsemble
from sain_model.dynamics.parameter_correction import ParameterCorrection
from sain_model.dynamics.physics_gradient import ToldPushes, conditioned_moves, moves
from sain_model.dynamics.priors import load_planar
from sain_model.dynamics.settings import PLANAR_AXES, CorrectionNetworkConfig
from sain_model.physics.planar import PlanarConfig, PlanarPrior
from sain_model.physics.planar_config import AXES
from sain_model.serving.server import ModelServer
from sain_model.serving.settings import ServingConfig
from sain_model.training.correction_training import CorrectionTrainer, make_trainers, train_members
from sain_model.training.settings import CorrectionTrainingConfig

SMALL = CorrectionNetworkConfig(hidden=16, message=8)
OPTIONS = ["--steps", "6", "--epochs", "2", "--hidden", "8", "--validation", "0.2", "--test", "0.2"]
SHORT = CorrectionTrainingConfig(steps=20, epochs=4, batch=16, network=SMALL)


@pytest.fixture(scope="module")
def laboratory(dataset: Path) -> Split:
    """The dataset in a laboratory with a slope, a worn table and masses off the middle."""
    data = load_transitions(dataset)
    corrections = np.zeros((len(data), 2, told.CORRECTIONS))
    corrections[..., told.PULL_X], corrections[..., told.DRAG] = 1.5, -1.0
    corrections[..., told.MASS_LEFT] = 1.2
    values = told.corrected_values(corrections, data.action, PlanarConfig())
    after = PlanarPrior().step(data.state, data.action, values)
    return split_by_episode(replace(data, next_state=after), 0, 0.2, 0.2)


def error(sain: ParameterCorrection | PlanarPrior, data) -> float:
    off = sain.step(data.state, data.action) - data.next_state
    return float(np.linalg.norm(off[:, TARGET, POSITION], axis=-1).mean())


def test_it_starts_out_as_the_prior(random_pushes) -> None:
    scenes, pushes = random_pushes(30, 0)
    sain = ParameterCorrection(CorrectionEnsemble(replace(SMALL, members=2)), PlanarPrior())
    np.testing.assert_allclose(
        sain.step(scenes, pushes), PlanarPrior().step(scenes, pushes), atol=1e-12
    )


def test_gradients_are_those_of_simulated_variations(random_pushes) -> None:
    scenes, pushes = random_pushes(12, 1)
    prior, shape = PlanarPrior(), (12, 2, told.CORRECTIONS)
    corrections = torch.zeros(shape, requires_grad=True)
    weights = torch.from_numpy(np.random.default_rng(0).normal(size=(12, 2, 3)).astype(np.float32))
    (
        weights * conditioned_moves(corrections, ToldPushes(prior, scenes, pushes, pushes))
    ).sum().backward()
    assert corrections.grad is not None
    for disk, column in ((0, told.DRAG), (1, told.PULL_Y), (1, told.MASS_FORE), (0, told.LENGTH)):
        more = np.zeros(shape)
        more[:, disk, column] = 0.1
        ends = [
            moves(
                scenes,
                pushes,
                prior.step(scenes, pushes, told.corrected_values(c, pushes, prior.config)),
            )
            for c in (0 * more, more)
        ]
        slope = ((ends[1] - ends[0]) * weights.numpy()).sum(axis=(1, 2)) / 0.1
        found = corrections.grad[:, disk, column].numpy()
        np.testing.assert_allclose(found, slope, rtol=1e-3, atol=1e-4)
    assert (corrections.grad[:, 1, told.OF_DISKS :] == 0.0).all()  # of the mid disk's row alone


def test_it_finds_out_what_a_laboratory_is_like(laboratory, tmp_path) -> None:
    config = replace(SHORT, steps=120, learning_rate=1e-2)
    trainer = CorrectionTrainer(laboratory, PlanarPrior(), config, tmp_path)
    trainer.run()
    networks = CorrectionEnsemble(SMALL)
    networks[0] = trainer.network
    sain = ParameterCorrection(networks, PlanarPrior())
    assert error(sain, laboratory.test) < 0.35 * error(PlanarPrior(), laboratory.test)
    scenes, pushes = laboratory.test.state, laboratory.test.action.copy()
    corrections, _ = sain.corrections(scenes, pushes, PlanarPrior().step(scenes, pushes))[0]
    assert np.median(corrections[..., told.PULL_X]) > 0.5
    pushes[:, LENGTH] = 0.0
    np.testing.assert_array_equal(sain.step(scenes, pushes), scenes)


def test_a_killed_training_goes_on_to_the_same_weights(laboratory, tmp_path) -> None:
    class KilledError(Exception):
        pass

    def kill(number: int, history: object) -> None:
        if number == 2:
            raise KilledError

    whole = CorrectionTrainer(laboratory, PlanarPrior(), SHORT, tmp_path / "whole")
    whole.run()
    with pytest.raises(KilledError):
        CorrectionTrainer(laboratory, PlanarPrior(), SHORT, tmp_path / "killed").run(kill)
    resumed = CorrectionTrainer(laboratory, PlanarPrior(), SHORT, tmp_path / "killed")
    assert resumed.epoch == 2
    resumed.run()
    for name, value in whole.network.state_dict().items():
        torch.testing.assert_close(resumed.network.state_dict()[name], value, rtol=0, atol=0)
    with pytest.raises(CheckpointError, match="belongs to other settings"):
        CorrectionTrainer(laboratory, PlanarPrior(), replace(SHORT, steps=30), tmp_path / "killed")


def test_members_differ_and_are_averaged(laboratory, tmp_path) -> None:
    config = replace(SHORT, network=replace(SMALL, members=2))
    networks, histories = train_members(make_trainers(laboratory, PlanarPrior(), config, tmp_path))
    assert len(networks) == len(histories) == 2
    scenes, pushes = laboratory.test.state, laboratory.test.action
    ends = []
    for member in networks:
        alone = CorrectionEnsemble(SMALL)
        alone[0] = member
        ends.append(ParameterCorrection(alone, PlanarPrior()).step(scenes, pushes)[..., POSITION])
    assert np.abs(ends[0] - ends[1]).max() > 1e-6
    both = ParameterCorrection(networks, PlanarPrior()).step(scenes, pushes)[..., POSITION]
    np.testing.assert_allclose(both, (ends[0] + ends[1]) / 2, atol=1e-9)


def test_the_command_writes_a_checkpoint_that_is_a_dynamics(dataset, tmp_path, capsys) -> None:
    arguments = [str(dataset), "--out", str(tmp_path), *OPTIONS, "--members", "2"]
    assert commands.train_correction(arguments) == 0
    path = tmp_path / "correction.safetensors"
    sain = load_dynamics(str(path))
    assert isinstance(sain, ParameterCorrection) and len(sain.networks) == 2
    data = load_transitions(dataset)
    assert np.isfinite(sain.step(data.state, data.action)).all()
    server = ModelServer(sain, ServingConfig(model=str(path)))
    residual, after = server.predict(data.state, data.action)
    physics = sain.prior.step(data.state, data.action)
    np.testing.assert_allclose(residual[..., POSITION], (after - physics)[..., POSITION])
    assert server.description.kind == "parameter_correction" and server.description.model_hash
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(CheckpointError, match="SHA-256"):
        load_dynamics(str(path))
    with pytest.raises(SystemExit) as refused:
        commands.train_correction([*arguments, "--prior", "identity"])
    assert refused.value.code == 2 and "identity" in capsys.readouterr().err


def test_without_held_out_episodes_nothing_is_trained(dataset, tmp_path, capsys) -> None:
    assert (
        commands.train_correction([str(dataset), "--out", str(tmp_path), *OPTIONS, "--test", "0"])
        == 1
    )
    assert "errors need held-out episodes; give --test above 0" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_settings_are_written_when_a_state_was_accepted(dataset, tmp_path) -> None:
    arguments = [str(dataset), "--out", str(tmp_path), *OPTIONS]
    assert commands.train_correction(arguments) == 0
    settings = tmp_path / "config.json"
    assert json.loads(settings.read_text())["training"]["learning_rate"] == 2e-3
    kept = settings.read_bytes()
    assert (
        commands.train_correction([*arguments, "--learning-rate", "1e-3"]) == 1
    )  # of another training
    assert settings.read_bytes() == kept


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("correction") / "correction.safetensors"
    prior = load_planar(PLANAR_AXES, {"friction": 0.14})
    settings = {"prior": PLANAR_AXES, "prior_config": asdict(prior.config), "network": {}}
    save_checkpoint(
        path, CorrectionEnsemble(SMALL), ModelCard(**settings, architecture=CORRECTION_ARCHITECTURE)
    )
    return path


def with_card(checkpoint: Path, folder: Path, **changes: object) -> str:
    """The path of a copy whose card says something else."""
    path = folder / checkpoint.name
    path.write_bytes(checkpoint.read_bytes())
    card = json.loads(card_path(checkpoint).read_text()) | changes
    card_path(path).write_text(json.dumps(card))
    return str(path)


def test_what_a_card_leaves_out_is_the_usual_of_its_own_prior(checkpoint, tmp_path) -> None:
    whole = load_dynamics(str(checkpoint))
    assert isinstance(whole, ParameterCorrection) and whole.prior.config == replace(
        AXES, friction=0.14
    )
    path = with_card(checkpoint, tmp_path, prior_config={"friction": 0.14})
    assert load_dynamics(path).prior.config == whole.prior.config


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"prior_config": {"friction": "0.14"}}, "friction is '0.14'; it must be of type float"),
        ({"prior_config": {"frictoin": 0.14}}, "frictoin"),
        ({"prior_config": {"friction": -1.0}}, r"PlanarConfig\.friction is -1\.0"),
        ({"prior": "identity"}, "parameters of 'identity' cannot be corrected"),
        ({"network": {"hidden": "16"}}, "network: hidden is '16'; it must be of type int"),
    ],
)
def test_a_card_that_is_not_sound_is_refused(checkpoint, tmp_path, changes, message) -> None:
    path = with_card(checkpoint, tmp_path, **changes)
    with pytest.raises(CheckpointError, match=rf"correction\.json: .*{message}"):
        load_dynamics(path)
