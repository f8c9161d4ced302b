"""Earlier pushes tell the ratio of masses where these are not measured."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from sain_core.scene import MASS, POSITION
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.identify import identify
from sain_model.dynamics.residual import residual_model
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.belief_file import read_belief, write_belief
from sain_model.inference.evidence import Known, ObservedPushes
from sain_model.inference.kinds import (
    FRICTION,
    MASS_RATIO,
    Belief,
    default_belief,
    friction_kind,
)
from sain_model.inference.posterior import infer
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import AXES, PlanarConfig, with_mass_ratio

Draw = Callable[[int, int], tuple[Scenes, Pushes]]
RATIO = 1.6


def telling(
    draw: Draw, config: PlanarConfig = AXES, count: int = 4, noise: float | None = None
) -> PushHistory:
    """Return pushes that move the target in a world whose masses are not as scenes state.

    They are seen with errors of 0.1 mm, or with a noise [m].
    """
    scenes, pushes = draw(200, 7)
    scenes[..., MASS] = 8.0
    after = PlanarPrior(config).step(with_mass_ratio(scenes, RATIO), pushes)
    after[..., MASS] = 8.0
    moved = np.linalg.norm((after - scenes)[:, 1, POSITION], axis=-1) > 0.01
    chosen = np.flatnonzero(moved)[:count]
    assert len(chosen) == count
    error = np.random.default_rng(3).normal(0, noise or 1e-4, after[..., POSITION].shape)
    after[..., POSITION] += error
    seen = None if noise is None else np.full((count, 2), noise)
    return PushHistory(scenes[chosen], pushes[chosen], after[chosen], seen)


@pytest.fixture
def belief() -> Belief:
    return default_belief(PlanarPrior(AXES)).with_unknown_masses()


@pytest.fixture
def sain() -> SainDynamics:
    torch.manual_seed(0)
    model = residual_model(InteractionNetwork(), friction_kind(PlanarPrior(AXES)), "planar_axes")
    return model.believing(default_belief(PlanarPrior(AXES)))


@pytest.mark.parametrize("friction", [0.08, 0.12, 0.2])
def test_four_pushes_tell_the_ratio_of_masses(
    belief: Belief, random_pushes: Draw, friction: float
) -> None:
    history = telling(random_pushes, replace(AXES, friction=friction))
    arrays = history.state, history.action, history.next_state
    pushes = ObservedPushes(*arrays, np.zeros(len(history), np.int64))
    posterior = infer(belief, pushes, Known.everything(len(history)))
    spread = posterior.log_spread(belief, MASS_RATIO)[0]
    assert 0.0 < spread < 0.1
    off = abs(np.log(posterior.values(belief, MASS_RATIO)[0] / RATIO))
    assert off < 2.0 * spread
    assert posterior.values(belief, FRICTION)[0] == pytest.approx(friction, rel=0.05)


@pytest.mark.parametrize("noise", [None, 0.001])
def test_predictions_rest_on_the_ratio(
    sain: SainDynamics, random_pushes: Draw, noise: float | None
) -> None:
    history = telling(random_pushes, noise=noise)
    usual, unknown = sain.condition(history), sain.with_unknown_masses()
    told = unknown.condition(history)
    assert unknown.spread(MASS_RATIO) == pytest.approx(0.3, rel=0.05)
    assert 0.0 < told.spread(MASS_RATIO) < 0.15
    off = abs(np.log(told.value(MASS_RATIO) / RATIO))
    assert off < 2.0 * told.spread(MASS_RATIO)

    later = telling(random_pushes, count=12).select(slice(4, None))
    errors = [
        np.linalg.norm((m.step(later.state, later.action) - later.next_state)[:, 1, :2], axis=-1)
        for m in (told, usual)
    ]
    assert errors[0].mean() < 0.5 * errors[1].mean()


def test_one_step_and_a_rollout_agree_and_state_masses_as_they_were(
    sain: SainDynamics, random_pushes: Draw
) -> None:
    told = sain.with_unknown_masses().condition(telling(random_pushes))
    scenes, pushes = random_pushes(6, 5)
    for scene, push in zip(scenes, pushes, strict=True):
        one = told.step(scene[None], push[None])[0]
        np.testing.assert_allclose(told.rollout(scene, push[None, None])[0, 0], one, atol=1e-9)
        np.testing.assert_array_equal(one[:, MASS], scene[:, MASS])


def test_regions_are_wider_before_the_ratio_is_told(
    sain: SainDynamics, random_pushes: Draw
) -> None:
    unknown, history = sain.with_unknown_masses(), telling(random_pushes)
    spreads = [
        model.predict(history.state, history.action).friction[:, 1].mean()
        for model in (sain, unknown, unknown.condition(history))
    ]
    assert spreads[2] < spreads[0] < spreads[1]


def test_where_masses_are_measured_their_ratio_is_that_of_the_prior(
    sain: SainDynamics, random_pushes: Draw
) -> None:
    conditioned = sain.condition(telling(random_pushes))
    assert (conditioned.value(MASS_RATIO), conditioned.spread(MASS_RATIO)) == (1.0, 0.0)


def test_a_model_of_a_ratio_of_masses_is_that_of_measured_masses(
    sain: SainDynamics, random_pushes: Draw
) -> None:
    prior = PlanarPrior(replace(AXES, mass_ratio=RATIO))
    model = sain.believing(default_belief(prior))
    scenes, pushes = random_pushes(6, 5)
    weighed = with_mass_ratio(scenes, RATIO)
    inferred, measured = model.step(scenes, pushes), sain.step(weighed, pushes)
    np.testing.assert_allclose(inferred[..., :MASS], measured[..., :MASS], atol=1e-12)


def test_a_ratio_changes_no_product_of_two_masses(random_pushes: Draw) -> None:
    scenes, _ = random_pushes(3, 5)
    ratios = np.array([1.0, 0.5, 2.0])
    weighed = with_mass_ratio(scenes, ratios)[..., MASS]
    change = weighed / scenes[..., MASS]
    np.testing.assert_allclose(change[:, 1] / change[:, 0], ratios)
    np.testing.assert_allclose(change.prod(axis=1), 1.0)


@pytest.mark.parametrize("unknown", [False, True])
def test_a_belief_is_read_as_it_was_written(belief: Belief, tmp_path: Path, unknown: bool) -> None:
    belief = belief if unknown else default_belief(PlanarPrior(AXES))
    read = read_belief(write_belief(tmp_path / "belief.json", belief))
    for kind, other in zip(read.kinds, belief.kinds, strict=True):
        assert (kind.name, kind.names, kind.prior) == (other.name, other.names, other.prior)
        np.testing.assert_array_equal(kind.covariance, other.covariance)
    assert (MASS_RATIO in read.likeliest.names) == unknown


def test_recordings_of_the_same_bodies_tell_their_ratio(
    sain: SainDynamics, random_pushes: Draw
) -> None:
    history = telling(random_pushes, count=40)
    episodes = np.repeat(np.arange(8), 5)
    part = ObservedPushes(history.state, history.action, history.next_state, episodes)
    belief = identify(sain.with_unknown_masses(), {"lab": [part]})
    assert belief.likeliest.config.mass_ratio == pytest.approx(RATIO, rel=0.05)
    assert sain.believing(belief).spread(MASS_RATIO) < 0.1
    scenes, pushes = history.state, history.action
    off = sain.believing(belief).step(scenes, pushes) - history.next_state
    assert np.linalg.norm(off[:, 1, POSITION], axis=-1).mean() < 0.001
