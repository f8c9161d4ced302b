"""Rollouts to learn from: what they predict, how gradients run through them, and resuming."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from sain_core.scene import POSE, POSITION, TARGET
from sain_model.data.dataset import Dataset, Split, split_by_episode
from sain_model.dynamics.sain import residual_model
from sain_model.evaluation.errors import plain, roll_out
from sain_model.inference.kinds import friction_kind
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.training.objectives import Rollouts, roll
from sain_model.training.settings import TrainingConfig
from sain_model.training.trainer import Trainer
from tests.sain_model.conftest import make_trainer, random_network
from tests.sain_model.rolling import load_episodes, whole_windows

SMALL = NetworkConfig(hidden=16, message=8)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return load_episodes(tmp_path_factory.mktemp("episodes"))


@pytest.fixture(scope="module")
def split(data):
    return split_by_episode(Dataset((data,)), 0, 0.2, 0.2)


def test_training_rolls_out_what_is_deployed(data):
    windows = whole_windows(data, 4)
    sain = residual_model(
        random_network(0.4, 1, hidden=16, message=8).weights,
        friction_kind(PlanarPrior(), infers=False),
        "planar",
        recurrent=True,
    )

    def at_friction(scenes: np.ndarray, pushes: np.ndarray, rows: np.ndarray) -> np.ndarray:
        return sain.step(scenes, pushes, {"friction": np.full(len(rows), 0.15)})

    deployed = roll_out(at_friction, windows)
    told = {"friction": np.full(windows.rows.shape, 0.15)}
    with torch.inference_mode():
        learned = roll(
            InteractionNetwork.of(sain.network.weights), windows, sain.physics, told
        ).numpy()
    off = learned[..., :2] - deployed[..., POSITION]
    # Contacts amplify the rounding of headings that are wrapped in one and not in the other.
    assert np.quantile(np.abs(off), 0.99) < 1e-5
    assert np.abs(deployed - roll_out(plain(sain), windows)).max() > 1e-3


def test_differences_give_the_gradient_of_the_whole_rollout(data):
    """Compared with nudging the weights themselves, which knows nothing of how it is done."""
    network = random_network(0.4, 1, hidden=16, message=8)
    windows = whole_windows(data, 2).select(np.arange(8))
    bias = network.dynamics[-1].bias
    roll(network, windows, PlanarPrior())[:, 1, TARGET, :2].sum().backward()
    found = bias.grad
    expected = []
    for number in range(3):
        sums = []
        for sign in (1.0, -1.0):
            with torch.no_grad():
                bias[number] += sign * 0.02
                poses = roll(network, windows, PlanarPrior())
                sums.append(poses[:, 1, TARGET, :2].sum().item())
                bias[number] -= sign * 0.02
        expected.append((sums[0] - sums[1]) / 0.04)
    np.testing.assert_allclose(found, expected, rtol=0.1, atol=0.1 * np.abs(expected).max())


def train(split: Split, folder: Path, config: TrainingConfig) -> Trainer:
    single = make_trainer(split, PlanarPrior(), config.of_pushes, folder)
    single.run()
    rollouts = Rollouts(split, friction_kind(PlanarPrior(), infers=False), config)
    quick = replace(config.of_rollouts, batch=8, learning_rate=5e-3)
    return Trainer(single.network, rollouts, quick, folder / "rollouts.pt")


def test_training_on_rollouts_lowers_the_error_of_rollouts(split, tmp_path):
    config = TrainingConfig(
        epochs=2, batch=32, network=SMALL, seed=3, steps_ahead=3, rollout_epochs=4
    )
    trainer = train(split, tmp_path, config)
    windows = whole_windows(split.test.alike, 3)

    def error() -> float:
        with torch.inference_mode():
            poses = roll(trainer.network, windows, PlanarPrior()).numpy()
        off = (poses - windows.next_scenes[..., POSE])[:, -1, TARGET, :2]
        return float(np.linalg.norm(off, axis=-1).mean())

    before = error()
    trainer.run()
    assert error() < 0.9 * before
    assert trainer.history.train[-1] < trainer.history.train[0]
