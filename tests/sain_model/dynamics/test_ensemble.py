"""An ensemble is lone networks side by side: in one call, trained together, kept together."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from sain_core.errors import CheckpointError
from sain_core.model import load_dynamics
from sain_core.push import LENGTH
from sain_core.scene import MASS
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scenes
from sain_model.data.dataset import Split, load_dataset, split_by_episode
from sain_model.dynamics.checkpoint import ModelCard, card_path, save_checkpoint
from sain_model.dynamics.priors import prior_settings
from sain_model.dynamics.residual import residual_model
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.kinds import FRICTION, friction_kind
from sain_model.network.feature_kernels import BODY_FEATURES
from sain_model.network.interaction_network import InteractionNetwork, ensemble, new_network
from sain_model.network.relation_kernels import RELATION_FEATURES
from sain_model.network.settings import BOOTSTRAP, NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.training.settings import TrainingConfig
from sain_model.training.trainer import Batches
from tests.sain_model.conftest import make_trainer

Draw = Callable[[int, int], tuple[Scenes, Pushes]]
SMALL = NetworkConfig(hidden=16, message=8)
THREE = NetworkConfig(hidden=16, message=8, members=3)


def wild(seed: int, config: NetworkConfig = SMALL) -> InteractionNetwork:
    torch.manual_seed(seed)
    network = InteractionNetwork(config)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.copy_(0.5 * torch.randn_like(parameter))
    return network


@pytest.fixture
def split(dataset: Path) -> Split:
    return split_by_episode(load_dataset(dataset), 0, 0.2, 0.2)


@pytest.mark.parametrize("bodies", [2, 4])
def test_an_ensemble_in_one_call_is_its_members_one_by_one(bodies: int) -> None:
    lone = [wild(seed) for seed in range(3)]
    together = ensemble(lone)
    random = torch.Generator().manual_seed(0)
    inputs = [torch.randn(3, 5, bodies, BODY_FEATURES, generator=random)]
    inputs += [torch.randn(3, 5, bodies * bodies, RELATION_FEATURES, generator=random)]
    shared = [part[0] for part in inputs]
    with torch.inference_mode():
        alone = torch.stack([network(*shared) for network in lone])
        own = torch.stack([lone[m](inputs[0][m], inputs[1][m]) for m in range(3)])
        torch.testing.assert_close(together.each(*shared), alone, atol=1e-6, rtol=1e-5)
        torch.testing.assert_close(together(*shared), alone.mean(0), atol=1e-6, rtol=1e-5)
        torch.testing.assert_close(together.each(*inputs), own, atol=1e-6, rtol=1e-5)
        many = [part[:1].expand(1100, *part.shape[1:]) for part in shared]  # more than a chunk
        torch.testing.assert_close(together(*many)[-1], alone.mean(0)[0], atol=1e-6, rtol=1e-5)
    assert (alone[0] - alone[1]).abs().max() > 1e-3


def test_every_member_starts_with_weights_of_its_own_and_the_first_as_a_lone_one() -> None:
    weights = new_network(THREE, seed=5).state_dict()["relation.0.weight"]
    assert weights.shape == (3, 16, RELATION_FEATURES)
    assert not torch.equal(weights[0], weights[1]) and not torch.equal(weights[1], weights[2])
    assert torch.equal(weights[0], new_network(SMALL, seed=5).state_dict()["relation.0.weight"])


def test_a_member_learns_what_it_would_learn_alone(split: Split, tmp_path: Path) -> None:
    common = {"epochs": 1, "batch": 8}  # one: which epoch is best is the ensemble's question
    lone = make_trainer(
        split, PlanarPrior(), TrainingConfig(network=SMALL, **common), tmp_path / "1"
    )
    three = make_trainer(
        split, PlanarPrior(), TrainingConfig(network=THREE, **common), tmp_path / "3"
    )
    start = {name: value[0].clone() for name, value in three.network.state_dict().items()}
    lone.run()
    three.run()
    learned = three.network.state_dict()
    for name, value in lone.network.state_dict().items():
        torch.testing.assert_close(learned[name][0], value, atol=1e-5, rtol=0)
    moved = max(float((learned[name][0] - start[name]).abs().max()) for name in start)
    assert moved > 0.01


def test_every_member_sees_all_of_the_data_in_an_order_of_its_own() -> None:
    batches = Batches(TrainingConfig(batch=16), np.repeat(np.arange(20), 5), 3)
    rows = torch.cat(list(batches.epoch(4)), dim=1)
    assert rows.shape == (3, 100)
    assert (rows.sort(dim=1).values == torch.arange(100)).all()
    assert not torch.equal(rows[0], rows[1]) and not torch.equal(rows[1], rows[2])
    alone = torch.cat(list(Batches(TrainingConfig(batch=16), np.arange(100), 1).epoch(4)), dim=1)
    assert torch.equal(alone[0], rows[0])


def test_a_bootstrap_draws_whole_episodes() -> None:
    episodes = np.tile(np.repeat(np.arange(50), 4), 2)  # as with mirrored copies
    batches = Batches(TrainingConfig(batch=32, diversity=BOOTSTRAP), episodes, 4)
    first, second = (torch.cat(list(batches.epoch(number)), dim=1) for number in (0, 1))
    for member in range(4):
        assert torch.equal(first[member].sort().values, second[member].sort().values)
        times = np.bincount(first[member].numpy(), minlength=400)
        by_episode = [set(times[episodes == number].tolist()) for number in range(50)]
        assert sum(len(counts) > 1 for counts in by_episode) <= 1  # the last one is cut short
        drawn = np.mean([max(counts) > 0 for counts in by_episode])
        assert 0.45 < drawn < 0.8  # 1 - 1/e on average
    assert len({tuple(row.tolist()) for row in first.sort(dim=1).values}) == 4


def test_a_checkpoint_keeps_every_member(tmp_path: Path, random_pushes: Draw) -> None:
    network = ensemble([wild(seed) for seed in range(3)])
    path, prior = tmp_path / "three.safetensors", PlanarPrior()
    save_checkpoint(path, network, ModelCard("planar", prior_settings(prior), {}))
    loaded = load_dynamics(str(path))
    assert isinstance(loaded, SainDynamics) and loaded.network.members == 3
    scenes, pushes = random_pushes(20, 0)
    before = residual_model(network, friction_kind(prior, infers=False), "planar").predict(
        scenes, pushes
    )
    after = loaded.predict(scenes, pushes)
    np.testing.assert_array_equal(after.mean, before.mean)
    np.testing.assert_array_equal(after.members, before.members)
    for members in (1, 2, 4):
        card = json.loads(card_path(path).read_text())
        card["network"]["members"] = members
        card_path(path).write_text(json.dumps(card))
        with pytest.raises(CheckpointError, match=r"tensor \S+ has shape \(3, .*needs \("):
            load_dynamics(str(path))


def test_the_mean_is_what_step_predicts_and_the_spread_that_of_the_members(
    random_pushes: Draw,
) -> None:
    lone = [wild(seed) for seed in range(3)]
    prior = PlanarPrior()
    sain = residual_model(ensemble(lone), friction_kind(prior, infers=False), "planar")
    scenes, pushes = random_pushes(40, 0)
    pushes[:5, LENGTH] = 0.0
    prediction = sain.predict(scenes, pushes)
    np.testing.assert_array_equal(prediction.mean, sain.step(scenes, pushes))
    places = np.stack(
        [
            residual_model(n, friction_kind(prior, infers=False), "planar").step(scenes, pushes)
            for n in lone
        ]
    )
    spread = np.sqrt(places[..., :2].var(axis=0, ddof=1).sum(axis=-1))
    np.testing.assert_allclose(prediction.members, spread, atol=1e-6)
    assert spread.max() > 1e-3 and (prediction.members[:5] == 0.0).all()
    assert prediction.radius is None
    alone = residual_model(lone[0], friction_kind(prior, infers=False), "planar").predict(
        scenes, pushes
    )
    assert (alone.spread == 0.0).all()


def test_what_is_not_known_of_the_friction_is_told_and_earlier_pushes_make_it_less(
    random_pushes: Draw,
) -> None:
    prior = PlanarPrior()
    sain = residual_model(wild(0), friction_kind(prior), "planar")
    scenes, pushes = random_pushes(40, 1)
    first = sain.predict(scenes, pushes)
    assert sain.spread(FRICTION) == pytest.approx(0.5, rel=0.05)  # of the belief at the start
    seen = prior.step(scenes[:3], pushes[:3])
    known = sain.condition(PushHistory(scenes[:3], pushes[:3], seen))
    assert known.spread(FRICTION) < 0.5 * sain.spread(FRICTION)
    assert known.predict(scenes, pushes).friction.mean() < 0.5 * first.friction.mean()
    ends = [
        sain.step(scenes, pushes, {FRICTION: np.full(len(pushes), 0.12 * np.exp(way))})[..., :2]
        for way in (-sain.spread(FRICTION), sain.spread(FRICTION))
    ]
    expected = np.linalg.norm(ends[1] - ends[0], axis=-1) / 2
    np.testing.assert_allclose(first.friction, expected, atol=1e-12)


def test_members_disagree_where_they_have_not_been(split: Split, tmp_path: Path) -> None:
    config = TrainingConfig(epochs=60, batch=16, network=THREE)
    trainer = make_trainer(split, PlanarPrior(), config, tmp_path)
    trainer.run()
    sain = residual_model(trainer.network, friction_kind(PlanarPrior(), infers=False), "planar")
    scenes, pushes = split.test.alike.state, split.test.alike.action
    heavy = scenes.copy()
    heavy[..., MASS] += 5.0  # 12 to 14 kg; trained on 7 to 9
    usual = sain.predict(scenes, pushes).members[:, 1].mean()
    assert sain.predict(heavy, pushes).members[:, 1].mean() > 2.0 * usual
