"""SAIN for bodies of any shape, on a prior told the bodies."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from sain_core.errors import CheckpointError
from sain_core.push import BODY, LENGTH
from sain_core.scene import make_scene
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scenes
from sain_model.data.dataset import Part
from sain_model.dynamics.checkpoint import ModelCard, card_path, save_checkpoint
from sain_model.dynamics.intervals import IntervalConfig, Intervals
from sain_model.dynamics.load import load_checkpoint
from sain_model.dynamics.priors import prior_settings
from sain_model.dynamics.residual import module_of, residual_model, with_intervals
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.predictors import predict_with_history
from sain_model.inference.kinds import friction_kind
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import PlanarConfig

T_AND_STAR = Bodies.named(["t", "star"], ["pushable", "pushable"])


def network() -> InteractionNetwork:
    torch.manual_seed(0)
    made = InteractionNetwork(NetworkConfig(hidden=8, message=4, members=2))
    with torch.no_grad():
        for parameter in made.parameters():
            parameter.add_(0.05 * torch.randn_like(parameter))
    return made


@pytest.fixture
def sain() -> SainDynamics:
    regions = Intervals(mid=IntervalConfig(scores=(1e-4,), factors=(2.0,)))
    prior = PlanarPrior()
    return residual_model(network(), friction_kind(prior), "planar", intervals=regions).with_bodies(
        T_AND_STAR
    )


def pushes_of(count: int) -> tuple[Scenes, Pushes]:
    places = np.array([(0.45, 0.0), (0.58, 0.02)])
    scene = make_scene(places, np.array([8.0, 7.5]), np.array([0.07, 0.06]), np.array([0.3, 1.0]))
    random = np.random.default_rng(1)
    angles = random.uniform(-3, 3, count), random.uniform(-0.7, 0.7, count)
    lengths, body = random.uniform(0.02, 0.15, count), random.integers(2, size=count)
    pushes = np.column_stack([body, *angles, lengths, np.full(count, 0.2)])
    return np.repeat(scene[None], count, axis=0), pushes


def test_it_predicts_what_its_prior_predicts_and_the_residual(sain: SainDynamics) -> None:
    scenes, pushes = pushes_of(20)
    physics = PlanarPrior().with_bodies(T_AND_STAR).step(scenes, pushes)
    told = sain.step(scenes, pushes)
    np.testing.assert_array_equal(told, sain.correct(scenes, pushes, physics))
    assert 1e-5 < np.abs(told - physics)[..., :2].max() < 0.05


def test_a_push_of_no_length_moves_nothing(sain: SainDynamics) -> None:
    scenes, pushes = pushes_of(4)
    pushes[:, LENGTH] = 0.0
    np.testing.assert_array_equal(sain.step(scenes, pushes), scenes)


def test_a_rollout_is_its_steps(sain: SainDynamics) -> None:
    scenes, pushes = pushes_of(12)
    sequences = pushes.reshape(4, 3, 5)
    told = sain.rollout(scenes[0], sequences)
    np.testing.assert_array_equal(told, sain.rollout(scenes[0], sequences))
    regions = sain.regions(scenes[0], sequences, told)
    assert regions is not None
    assert regions.shape == (4, 3, 2)
    assert (regions > 0.0).all()


def test_friction_is_inferred_with_the_bodies(sain: SainDynamics) -> None:
    scenes, pushes = pushes_of(6)
    truth = PlanarPrior(PlanarConfig(friction=0.19)).with_bodies(T_AND_STAR).step(scenes, pushes)
    told = sain.condition(PushHistory(scenes, pushes, truth))
    assert isinstance(told.physics, PlanarPrior)
    assert told.physics.config.friction == pytest.approx(0.19, rel=0.05)
    assert told.bodies == T_AND_STAR


def test_the_pushed_body_has_the_region_of_a_mid_disk() -> None:
    intervals = Intervals(
        mid=IntervalConfig(scores=(1e-4,), factors=(1.0,)),
        target=IntervalConfig(scores=(1e-4,), factors=(3.0,)),
    )
    sain = residual_model(
        network(), friction_kind(PlanarPrior(), infers=False), "planar", intervals=intervals
    )
    scenes, pushes = pushes_of(10)
    told = sain.with_bodies(T_AND_STAR).predict(scenes, pushes)
    assert told.radius is not None
    score = 1e-4 + told.members
    pushed = pushes[:, [BODY]] == [0, 1]
    np.testing.assert_allclose(told.radius, np.where(pushed, 1.0, 3.0) * score)


def test_a_checkpoint_is_what_was_saved(tmp_path: Path, sain: SainDynamics) -> None:
    path = tmp_path / "shapes.safetensors"
    save_checkpoint(path, module_of(sain), ModelCard("planar", prior_settings(PlanarPrior()), {}))
    scenes, pushes = pushes_of(10)
    loaded = load_checkpoint(path).with_bodies(T_AND_STAR)
    np.testing.assert_array_equal(loaded.step(scenes, pushes), sain.step(scenes, pushes))


def test_a_card_with_other_features_is_refused(tmp_path: Path, sain: SainDynamics) -> None:
    path = tmp_path / "shapes.safetensors"
    save_checkpoint(path, module_of(sain), ModelCard("planar", prior_settings(PlanarPrior()), {}))
    text = card_path(path).read_text()
    card_path(path).write_text(text.replace('"body_features": 20', '"body_features": 15'))
    with pytest.raises(CheckpointError, match="body_features is 15; this version reads 20"):
        load_checkpoint(path)


def test_disks_are_bodies_too(sain: SainDynamics) -> None:
    """No bodies need be given where all are the paper's disks."""
    plain = sain.with_bodies(PAPER_DISKS)
    scenes, pushes = pushes_of(8)
    told = plain.step(scenes, pushes)
    np.testing.assert_array_equal(told, plain.with_bodies(Bodies.disks(2)).step(scenes, pushes))


def test_earlier_pushes_widen_regions_in_a_world_unlike_home(sain: SainDynamics) -> None:
    """In a graph, from the history, as in an evaluation, from the rows of an episode."""
    assert sain.network is not None and sain.network.intervals is not None
    adapting = replace(sain.network.intervals, usual_log=-1.0, usual_log_std=1.0)
    sain = with_intervals(sain, adapting)
    scenes, pushes = pushes_of(6)
    after = PlanarPrior(PlanarConfig(friction=0.19)).with_bodies(T_AND_STAR).step(scenes, pushes)
    after[..., :2] += 0.02
    state, action, following = scenes[:5], pushes[:5], after[:5]
    told = sain.condition(PushHistory(state, action, following))
    assert told.widening[0] > 2.0
    assert sain.condition(PushHistory(state[:0], action[:0], following[:0])).widening[0] == 1.0
    radius = told.predict(scenes[5:], pushes[5:]).radius
    episode = Part(
        state=scenes,
        action=pushes,
        next_state=after,
        physics_next=scenes,
        episode=np.zeros(6, np.int64),
        step=np.arange(6),
        friction=np.full(6, 0.19),
        floor_next=scenes,
        bodies=T_AND_STAR,
    )
    rows = predict_with_history(sain, episode)
    assert rows.radius is not None
    assert radius is not None
    np.testing.assert_allclose(rows.radius[5:], radius, rtol=1e-6)
    first = sain.predict(scenes[:1], pushes[:1]).radius
    assert first is not None
    np.testing.assert_allclose(rows.radius[:1], first, rtol=1e-6)
