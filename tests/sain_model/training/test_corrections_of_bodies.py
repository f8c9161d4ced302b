"""Parameter corrections of bodies of any shape: what is learned, predicted, served and kept."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from sain_core.history import PushHistory
from sain_core.model import load_dynamics
from sain_core.push import BODY, LENGTH, PushLimits, pushed_bodies
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scenes
from sain_model import commands
from sain_model.data.dataset import Dataset
from sain_model.data.mixed import MixedDataset, MixedSplit
from sain_model.dynamics import corrections as told
from sain_model.dynamics.checkpoint import read_card
from sain_model.dynamics.correction_network import CorrectionEnsemble
from sain_model.dynamics.parameter_correction import ParameterCorrection
from sain_model.dynamics.physics_gradient import ToldPushes, conditioned_moves
from sain_model.dynamics.settings import CorrectionNetworkConfig
from sain_model.evaluation.shape_errors import shape_errors
from sain_model.network.features import push_frames
from sain_model.physics.friction import FrictionConfig
from sain_model.physics.planar import PlanarConfig, PlanarPrior
from sain_model.serving.server import load_server
from sain_model.serving.settings import ServingConfig
from sain_model.training.correction_training import CorrectionTrainer
from sain_model.training.settings import CorrectionTrainingConfig

SMALL = CorrectionNetworkConfig(hidden=16, message=8)
ROLES = ("pushable", "pushable")
PAIR, ALONE = Bodies.named(("t", "bar"), ROLES), Bodies.named(("square",), ROLES[:1])


def draw(bodies: Bodies, count: int, seed: int) -> tuple[Scenes, Pushes]:
    random = np.random.default_rng(seed)
    places = np.array([(0.45, 0.0), (0.57, 0.02)])[: len(bodies)]
    scenes = np.stack(
        [
            make_scene(
                places,
                random.uniform(7.0, 9.0, len(bodies)),
                np.full(len(bodies), 0.07),
                random.uniform(-3.0, 3.0, len(bodies)),
            )
            for _ in range(count)
        ]
    )
    body = random.integers(len(bodies), size=count)
    pushes = PushLimits().sample(random, count)
    pushes[:, BODY] = body
    return scenes, pushes


def pushes_of(bodies: Bodies, count: int, seed: int) -> ToldPushes:
    scenes, pushes = draw(bodies, count, seed)
    frames = push_frames(scenes, pushes, bodies)
    return ToldPushes(PlanarPrior().with_bodies(bodies), scenes, pushes, frames)


def laboratory(bodies: Bodies, count: int, first: int) -> Dataset:
    """Pushes where the table is slippery and slopes, in episodes of four."""
    scenes, pushes = draw(bodies, count, first)
    corrections = np.zeros((count, len(bodies), told.CORRECTIONS))
    corrections[..., told.PULL_X], corrections[..., told.DRAG] = 1.5, -1.0
    corrections[np.arange(count), pushes[:, 3].astype(int), told.LENGTH] = 1.0
    values = told.corrected_values(corrections, pushes, PlanarConfig())
    after = PlanarPrior().with_bodies(bodies).step(scenes, pushes, values)
    return Dataset(
        state=scenes,
        action=pushes,
        next_state=after,
        physics_next=scenes,
        episode=first + np.arange(count) // 4,
        step=np.arange(count) % 4,
        friction=np.full(count, 0.12),
        floor_next=np.full_like(scenes, np.nan),
        sha256="",
        bodies=bodies,
    )


@pytest.fixture(scope="module")
def split() -> MixedSplit:
    parts = [
        MixedDataset((laboratory(PAIR, n, first), laboratory(ALONE, n, first + 100)), "", ())
        for n, first in ((100, 0), (24, 200), (40, 400))
    ]
    return MixedSplit(*parts)


def test_gradients_are_those_of_simulated_variations() -> None:
    pushes = pushes_of(PAIR, 12, 1)
    shape = (12, 2, told.CORRECTIONS)
    corrections = torch.zeros(shape, requires_grad=True)
    weights = np.random.default_rng(0).normal(size=(12, 2, 3)).astype(np.float32)
    (torch.from_numpy(weights) * conditioned_moves(corrections, pushes)).sum().backward()
    assert corrections.grad is not None
    body = pushed_bodies(pushes.pushes)
    for column in (told.DRAG, told.PULL_Y, told.MASS_FORE, told.LENGTH, told.LOCATION):
        more = np.zeros(shape)
        more[np.arange(12), body, column] = 0.1
        slope = ((pushes.moves(more) - pushes.moves(0 * more)) * weights).sum(axis=(1, 2)) / 0.1
        found = corrections.grad[np.arange(12), body, column].numpy()
        np.testing.assert_allclose(found, slope, rtol=1e-3, atol=1e-4)
    own = corrections.grad[np.arange(12), 1 - body, told.OF_DISKS :]
    assert (own == 0.0).all()  # of the pushed body's row alone


def test_it_starts_out_as_the_prior_and_a_push_of_no_length_moves_nothing() -> None:
    scenes, pushes = draw(PAIR, 20, 2)
    networks = CorrectionEnsemble(replace(SMALL, members=2))
    sain = ParameterCorrection(networks, PlanarPrior()).with_bodies(PAIR)
    physics = PlanarPrior().with_bodies(PAIR).step(scenes, pushes)
    np.testing.assert_allclose(sain.step(scenes, pushes), physics, atol=1e-12)
    for network in networks:
        for parameter in network.parameters():
            torch.nn.init.normal_(parameter, std=0.1)
    assert np.abs(sain.step(scenes, pushes) - physics).max() > 1e-3
    pushes[:, LENGTH] = 0.0
    np.testing.assert_array_equal(sain.step(scenes, pushes), scenes)


def test_it_finds_out_what_a_laboratory_is_like(split: MixedSplit, tmp_path: Path) -> None:
    config = CorrectionTrainingConfig(
        steps=100, epochs=4, batch=16, learning_rate=1e-2, network=SMALL
    )
    trainer = CorrectionTrainer(split, PlanarPrior(), config, tmp_path)
    trainer.run()
    networks = CorrectionEnsemble(SMALL)
    networks[0] = trainer.network
    sain = ParameterCorrection(networks, PlanarPrior())
    errors = shape_errors(split.test, sain)["bodies"]
    for group in ("pushed, alone", "pushed, one of several"):
        assert errors[group]["ratio_mm"][0] < 0.6


def test_friction_is_inferred_where_it_learned_to() -> None:
    scenes, pushes = draw(PAIR, 6, 3)
    truth = PlanarPrior().at(0.19).with_bodies(PAIR).step(scenes, pushes)
    history = PushHistory(scenes, pushes, truth)
    sain = ParameterCorrection(CorrectionEnsemble(SMALL), PlanarPrior()).with_bodies(PAIR)
    assert sain.condition(history).prior.config.friction == 0.12
    learned = replace(sain, friction=FrictionConfig(outline_noise=3e-4)).condition(history)
    assert learned.prior.config.friction == pytest.approx(0.19, rel=0.05)
    assert learned.bodies == PAIR


def test_the_command_writes_a_checkpoint_that_serves_any_bodies(
    any_bodies: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--history", "episode", "--steps", "4", "--epochs", "2"]
    shares = ["--hidden", "8", "--validation", "0.2", "--test", "0.2"]
    assert (
        commands.train_correction([str(any_bodies), "--out", str(tmp_path), *options, *shares]) == 0
    )
    assert "Errors of pushed bodies by shape" in capsys.readouterr().out
    path = tmp_path / "correction.safetensors"
    card = read_card(path)
    assert card.body_features == 20
    assert card.errors["bodies"]["pushed"]["pushes"] == card.data["transitions"]["test"]
    sain = load_dynamics(str(path))
    assert isinstance(sain, ParameterCorrection)
    assert sain.filter is not None
    server, (scenes, pushes) = load_server(ServingConfig(model=str(path))), draw(PAIR, 4, 5)
    rollout = server.rollout(scenes[0], pushes.reshape(2, 2, 4), bodies=PAIR)
    shaped = sain.with_bodies(PAIR)
    first = shaped.step(np.repeat(scenes[:1], 2, axis=0), pushes[::2])
    np.testing.assert_array_equal(rollout[:, 0], first)
    assert server.regions(scenes[0], pushes.reshape(2, 2, 4), rollout, bodies=PAIR) is None
