"""What earlier pushes tell of the friction: of their own episode, and of nothing to come."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import DatasetError, InvalidInputError
from sain_core.history import PushHistory
from sain_core.model import IdentityPrior
from sain_core.push import LENGTH, mirror_pushes
from sain_core.scene import POSITION, mirror_scenes
from sain_core.types import Pushes, Scenes
from sain_model.data.dataset import Part
from sain_model.data.friction_noise import fit_noise
from sain_model.dynamics.sain import SainDynamics
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.friction import FrictionConfig, FrictionFilter
from sain_model.physics.planar import PlanarPrior

Draw = Callable[[int, int], tuple[Scenes, Pushes]]
PRIOR = PlanarPrior()
NOMINAL = PRIOR.config.friction
EPISODES, PUSHES = 12, 5
FRICTIONS = np.repeat(np.geomspace(0.05, 0.3, EPISODES), PUSHES)
EPISODE = np.repeat(np.arange(EPISODES), PUSHES)
STEP = np.tile(np.arange(PUSHES), EPISODES)


@pytest.fixture
def friction() -> FrictionFilter:
    return FrictionFilter(PRIOR, NOMINAL)


def history(draw: Draw, truth: float, pushes: int = PUSHES, noise: float = 0.0) -> PushHistory:
    scenes, actions = draw(pushes, 5)
    after = PRIOR.step(scenes, actions, {"friction": np.full(pushes, truth)})
    after[..., POSITION] += np.random.default_rng(1).normal(0, noise, after[..., POSITION].shape)
    return PushHistory(scenes, actions, after)


def world(draw: Draw) -> tuple[Scenes, Pushes, Scenes]:
    scenes, pushes = draw(EPISODES * PUSHES, 6)
    return scenes, pushes, PRIOR.step(scenes, pushes, {"friction": FRICTIONS})


@pytest.mark.parametrize("truth", [0.035, 0.08, 0.12, 0.2, 0.38])
def test_a_few_pushes_tell_the_friction_also_outside_the_usual_range(
    friction: FrictionFilter, random_pushes: Draw, truth: float
) -> None:
    belief = friction.infer(history(random_pushes, truth, noise=2e-4))
    assert belief.mean == pytest.approx(truth, rel=0.05)
    assert belief.spread < 0.1
    assert belief.pushes == PUSHES


def test_noise_that_is_stated_makes_the_friction_less_sure(
    friction: FrictionFilter, random_pushes: Draw
) -> None:
    past = history(random_pushes, 0.2, noise=2e-3)
    trusted = friction.infer(past)
    noisy = friction.infer(replace(past, noise=np.full((PUSHES, past.disks), 2e-3)))
    assert noisy.mean == pytest.approx(0.2, rel=0.1)
    assert noisy.spread > trusted.spread
    none = friction.infer(replace(past, noise=np.zeros((PUSHES, past.disks))))
    assert none.mean == trusted.mean


def test_without_pushes_the_friction_is_the_nominal_one(friction: FrictionFilter) -> None:
    belief = friction.infer(PushHistory.empty())
    assert (belief.mean, belief.pushes) == (NOMINAL, 0)
    assert belief.spread == pytest.approx(friction.config.width, rel=0.1)
    assert PRIOR.condition(PushHistory.empty()).config == PRIOR.config


def test_pushes_that_moved_nothing_tell_nothing(
    friction: FrictionFilter, random_pushes: Draw
) -> None:
    idle = history(random_pushes, 0.2)
    pushes = idle.action.copy()
    pushes[:, LENGTH] = 0.0
    belief = friction.infer(PushHistory(idle.state, pushes, idle.state))
    assert belief.mean == pytest.approx(NOMINAL)
    assert belief.spread == pytest.approx(friction.start().spread)


def test_pushes_told_one_by_one_are_pushes_told_at_once(
    friction: FrictionFilter, random_pushes: Draw
) -> None:
    past = history(random_pushes, 0.17, noise=5e-4)
    belief = friction.start()
    for row in range(len(past)):
        rows = slice(row, row + 1)
        told = friction.log_likelihood(past.state[rows], past.action[rows], past.next_state[rows])
        belief = belief.after(told[0])
    at_once = friction.infer(past)
    np.testing.assert_array_equal(belief.weights, at_once.weights)
    order = np.arange(len(past))[::-1]
    turned = PushHistory(past.state[order], past.action[order], past.next_state[order])
    np.testing.assert_allclose(friction.infer(turned).weights, at_once.weights, atol=1e-12)


def test_a_mirror_shows_the_same_friction(friction: FrictionFilter, random_pushes: Draw) -> None:
    past = history(random_pushes, 0.17, noise=5e-4)
    seen = PushHistory(
        mirror_scenes(past.state), mirror_pushes(past.action), mirror_scenes(past.next_state)
    )
    assert friction.infer(seen).mean == pytest.approx(friction.infer(past).mean, rel=1e-3)


def test_one_push_that_no_friction_explains_does_not_decide(
    friction: FrictionFilter, random_pushes: Draw
) -> None:
    past = history(random_pushes, 0.17, pushes=8)
    wrong = past.next_state.copy()
    wrong[3, :, POSITION] += 0.05
    belief = friction.infer(PushHistory(past.state, past.action, wrong))
    assert belief.mean == pytest.approx(0.17, rel=0.05)


def test_each_push_knows_the_earlier_pushes_of_its_own_episode_alone(
    friction: FrictionFilter, random_pushes: Draw
) -> None:
    scenes, pushes, after = world(random_pushes)
    likelihood = friction.log_likelihood(scenes, pushes, after)
    known = friction.earlier(likelihood, EPISODE, STEP)
    np.testing.assert_array_equal(known.pushes, STEP)
    np.testing.assert_array_equal(known.mean[STEP == 0], NOMINAL)
    for row in (1, 7, 24, 59):
        rows = (EPISODE[row] == EPISODE) & (STEP[row] > STEP)
        alone = friction.infer(PushHistory(scenes[rows], pushes[rows], after[rows]))
        assert known.mean[row] == pytest.approx(alone.mean, rel=1e-6)
        assert known.spread[row] == pytest.approx(alone.spread, rel=1e-4)


def test_nothing_leaks_from_the_present_the_future_or_another_episode(
    friction: FrictionFilter, random_pushes: Draw
) -> None:
    scenes, pushes, after = world(random_pushes)
    likelihood = friction.log_likelihood(scenes, pushes, after)
    usual = friction.earlier(likelihood, EPISODE, STEP)
    row = 3 * PUSHES + 2
    changed = likelihood.copy()
    unseen = (EPISODE[row] != EPISODE) | (STEP[row] <= STEP)
    changed[unseen] = np.random.default_rng(0).normal(0, 30, changed[unseen].shape)
    told = friction.earlier(changed, EPISODE, STEP)
    assert told.mean[row] == pytest.approx(usual.mean[row], rel=1e-9)
    assert told.mean[row + 1] != pytest.approx(usual.mean[row + 1], rel=1e-3)
    changed = likelihood.copy()
    changed[row - 1] += np.linspace(0.0, 200.0, changed.shape[1])
    assert friction.earlier(changed, EPISODE, STEP).mean[row] > 1.01 * usual.mean[row]


def test_the_order_of_the_rows_does_not_matter(
    friction: FrictionFilter, random_pushes: Draw
) -> None:
    likelihood = friction.log_likelihood(*world(random_pushes))
    usual = friction.earlier(likelihood, EPISODE, STEP)
    order = np.random.default_rng(0).permutation(len(EPISODE))
    mixed = friction.earlier(likelihood[order], EPISODE[order], STEP[order])
    np.testing.assert_allclose(mixed.mean, usual.mean[order], rtol=1e-9)
    np.testing.assert_array_equal(mixed.pushes, usual.pushes[order])


def test_a_short_memory_holds_the_latest_pushes(
    friction: FrictionFilter, random_pushes: Draw
) -> None:
    scenes, pushes, after = world(random_pushes)
    likelihood = friction.log_likelihood(scenes, pushes, after)
    known = friction.earlier(likelihood, EPISODE, STEP, np.full(len(EPISODE), 1))
    alone = friction.infer(PushHistory(scenes[7:8], pushes[7:8], after[7:8]))
    assert known.mean[8] == pytest.approx(alone.mean, rel=1e-6)
    assert known.pushes.max() == 1
    none = friction.earlier(likelihood, EPISODE, STEP, np.zeros(len(EPISODE), dtype=int))
    np.testing.assert_array_equal(none.mean, NOMINAL)


def test_hindsight_leaves_the_push_itself_out(
    friction: FrictionFilter, random_pushes: Draw
) -> None:
    likelihood = friction.log_likelihood(*world(random_pushes))
    usual = friction.others(likelihood, EPISODE)
    np.testing.assert_array_equal(usual.pushes, PUSHES - 1)
    changed = likelihood.copy()
    changed[8] += np.linspace(0.0, 200.0, changed.shape[1])
    told = friction.others(changed, EPISODE)
    assert told.mean[8] == pytest.approx(usual.mean[8], rel=1e-9)
    assert told.mean[7] > 1.01 * usual.mean[7]
    assert told.mean[3] == usual.mean[3]


def transitions(draw: Draw, noise: float) -> Part:
    scenes, pushes, after = world(draw)
    after[..., POSITION] += np.random.default_rng(2).normal(0, noise, after[..., POSITION].shape)
    return Part(scenes, pushes, after, after, EPISODE, STEP, FRICTIONS, after)


def test_physics_is_trusted_less_where_it_errs_more(random_pushes: Draw) -> None:
    exact = fit_noise(PRIOR, transitions(random_pushes, 5e-5))
    rough = fit_noise(PRIOR, transitions(random_pushes, 3e-3))
    assert exact.noise < rough.noise


def test_noise_needs_the_truth_and_episodes_of_two_pushes(random_pushes: Draw) -> None:
    data = transitions(random_pushes, 1e-3)
    with pytest.raises(DatasetError, match="none of 12 episodes has two pushes"):
        fit_noise(PRIOR, data.select(STEP == 0))
    data.friction[3] = np.nan
    with pytest.raises(DatasetError, match="no true friction"):
        fit_noise(PRIOR, data)


def test_the_planar_prior_learns_from_the_past(random_pushes: Draw) -> None:
    scenes, pushes = random_pushes(30, 8)
    truth = PRIOR.step(scenes, pushes, {"friction": np.full(30, 0.2)})
    told = PRIOR.condition(history(random_pushes, 0.2))
    before, after = (
        np.linalg.norm((model.step(scenes, pushes) - truth)[..., POSITION], axis=-1).mean()
        for model in (PRIOR, told)
    )
    assert after < 0.1 * before


def test_sain_learns_from_the_past_if_it_was_trained_to(random_pushes: Draw) -> None:
    scenes, pushes = random_pushes(30, 8)
    past = history(random_pushes, 0.2)
    deaf = SainDynamics(InteractionNetwork(), PRIOR, "planar")
    assert deaf.condition(past) is deaf
    sain = SainDynamics(InteractionNetwork(), PRIOR, "planar", friction=FrictionConfig())
    assert sain.condition(PushHistory.empty()) is sain
    told = sain.condition(past)
    friction = FrictionFilter(PRIOR, NOMINAL).infer(past).mean
    np.testing.assert_array_equal(
        told.step(scenes, pushes), sain.step(scenes, pushes, {"friction": np.full(30, friction)})
    )
    assert sain.prior is PRIOR


def test_a_model_without_friction_cannot_be_told_one() -> None:
    learned = SainDynamics(InteractionNetwork(), PRIOR, "planar").at(0.2)
    assert isinstance(learned.prior, PlanarPrior) and learned.prior.config.friction == 0.2
    with pytest.raises(InvalidInputError, match="the prior 'identity' knows no friction"):
        SainDynamics(InteractionNetwork(), IdentityPrior(), "identity").at(0.2)
