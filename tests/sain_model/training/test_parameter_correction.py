"""A network that corrects parameters of the prior: what it learns, predicts, serves and keeps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from sain_core.errors import CheckpointError
from sain_core.model import load_dynamics
from sain_core.push import BODY, LENGTH, PushLimits, pushed_bodies
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scenes
from sain_model import commands
from sain_model.data.dataset import Dataset, Part, Split
from sain_model.dynamics.parameter_correction import ToldPushes, conditioned_moves, correcting_model
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.errors import evaluate
from sain_model.inference.kinds import FRICTION, friction_kind
from sain_model.network import interaction_network as told
from sain_model.network.features import push_frames
from sain_model.network.interaction_network import InteractionNetwork, new_network
from sain_model.physics.planar import PlanarConfig, PlanarPrior
from sain_model.serving.server import load_server
from sain_model.serving.service import ServingConfig
from sain_model.training.fit import fit
from sain_model.training.settings import OF_PARAMETERS
from tests.sain_model.conftest import read_card

SMALL = replace(OF_PARAMETERS.network, hidden=16, message=8)
SHORT = replace(OF_PARAMETERS, epochs=4, epoch_steps=5, batch=16, network=SMALL)
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
    return ToldPushes(PlanarPrior().with_bodies(bodies), scenes, pushes, frames, {})


def laboratory(bodies: Bodies, count: int, first: int) -> Part:
    """Pushes where the table is slippery and slopes, in episodes of four."""
    scenes, pushes = draw(bodies, count, first)
    corrections = np.zeros((count, len(bodies), told.CORRECTIONS))
    corrections[..., told.PULL_X], corrections[..., told.DRAG] = 1.5, -1.0
    corrections[np.arange(count), pushed_bodies(pushes), told.LENGTH] = 1.0
    values = told.corrected_values(corrections, pushes, PlanarConfig())
    after = PlanarPrior().with_bodies(bodies).step(scenes, pushes, values)
    return Part(
        state=scenes,
        action=pushes,
        next_state=after,
        physics_next=scenes,
        episode=first + np.arange(count) // 4,
        step=np.arange(count) % 4,
        friction=np.full(count, 0.12),
        floor_next=np.full_like(scenes, np.nan),
        bodies=bodies,
    )


@pytest.fixture(scope="module")
def split() -> Split:
    parts = [
        Dataset((laboratory(PAIR, n, first), laboratory(ALONE, n, first + 100)))
        for n, first in ((100, 0), (24, 200), (40, 400))
    ]
    return Split(*parts)


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


def wild(seed: int) -> InteractionNetwork:
    network = new_network(SMALL, seed)
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    return network


def test_it_starts_out_as_the_prior_and_a_push_of_no_length_moves_nothing() -> None:
    scenes, pushes = draw(PAIR, 20, 2)
    network = new_network(replace(SMALL, members=2), 0)
    sain = correcting_model(network, friction_kind(PlanarPrior(), infers=False)).with_bodies(PAIR)
    physics = PlanarPrior().with_bodies(PAIR).step(scenes, pushes)
    np.testing.assert_allclose(sain.step(scenes, pushes), physics, atol=1e-12)
    sain = correcting_model(wild(0), sain.belief.trained).with_bodies(PAIR)
    assert np.abs(sain.step(scenes, pushes) - physics).max() > 1e-3
    pushes[:, LENGTH] = 0.0
    np.testing.assert_array_equal(sain.step(scenes, pushes), scenes)


def test_it_finds_out_what_a_laboratory_is_like(split: Split, tmp_path: Path) -> None:
    config = replace(SHORT, epoch_steps=25, learning_rate=1e-2)
    sain, _ = fit(split, friction_kind(PlanarPrior(), infers=False), config, tmp_path)
    found = evaluate(split.test, {"sain": sain})["after"]["1"]["ratios"]
    for group in ("pushed, alone", "pushed, one of several"):
        assert found[group]["sain"]["its prior"]["mm"][0] < 0.6


def test_the_command_writes_a_checkpoint_that_serves_any_bodies(
    any_bodies: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--output", "parameters", "--history", "episode", "--epoch-steps", "2"]
    options += ["--epochs", "2", "--members", "2"]
    shares = ["--hidden", "8", "--validation", "0.2", "--test", "0.2"]
    assert commands.train([str(any_bodies), "--out", str(tmp_path), *options, *shares]) == 0
    assert "Errors after one push, by bodies" in capsys.readouterr().out
    path = tmp_path / "sain.safetensors"
    card = read_card(path)
    assert card.body_features == 20
    pushed = card.errors["after"]["1"]["errors"]["pushed"]
    assert {one["number"] for one in pushed.values()} == {card.data["transitions"]["test"]}
    sain = load_dynamics(str(path))
    assert isinstance(sain, SainDynamics)
    assert sain.belief.trained.names == (FRICTION,)
    server, (scenes, pushes) = load_server(ServingConfig(model=str(path))), draw(PAIR, 4, 5)
    rollout = server.rollout(scenes[0], pushes.reshape(2, 2, -1), bodies=PAIR)
    shaped = sain.with_bodies(PAIR)
    first = shaped.step(np.repeat(scenes[:1], 2, axis=0), pushes[::2])
    np.testing.assert_array_equal(rollout[:, 0], first)
    assert server.regions(scenes[0], pushes.reshape(2, 2, -1), rollout, bodies=PAIR) is None
    assert server.description.kind == "parameter_correction"
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(CheckpointError, match="SHA-256"):
        load_dynamics(str(path))


def test_what_cannot_be_corrected_is_refused(
    dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [str(dataset), "--out", str(tmp_path), "--output", "parameters"]
    assert commands.train([*arguments, "--prior", "identity"]) == 1
    assert "corrects planar or planar_axes, not 'identity'" in " ".join(
        capsys.readouterr().err.split()
    )
    assert commands.train([*arguments, "--steps-ahead", "3"]) == 1
    assert "--steps-ahead trains residuals" in " ".join(capsys.readouterr().err.split())
