"""Earlier pushes show the kind of physics and its parameters, and whether a network holds."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from sain_core.errors import ConfigError
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.residual import residual_model
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.evidence import Known, ObservedPushes
from sain_model.inference.kinds import FRICTION, Belief, Kind, default_belief, friction_kind
from sain_model.inference.posterior import Posterior, infer
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import AXES, TEXTBOOK, PlanarConfig

Draw = Callable[[int, int], tuple[Scenes, Pushes]]
AXES_FIRST, TEXTBOOK_SECOND = range(2)
COUNT = 6


@pytest.fixture
def belief() -> Belief:
    return default_belief(PlanarPrior(AXES))


@pytest.fixture
def sain(belief: Belief) -> SainDynamics:
    torch.manual_seed(0)
    model = residual_model(InteractionNetwork(), friction_kind(PlanarPrior(AXES)), "planar_axes")
    return model.believing(belief)


def seen(draw: Draw, config: PlanarConfig, count: int = COUNT, seed: int = 5) -> PushHistory:
    """Return what a world of this physics shows, with errors of 0.1 mm."""
    scenes, pushes = draw(count, seed)
    after = PlanarPrior(config).step(scenes, pushes)
    after[..., :2] += np.random.default_rng(seed).normal(0, 1e-4, after[..., :2].shape)
    return PushHistory(scenes, pushes, after)


def observed(history: PushHistory) -> ObservedPushes:
    arrays = history.state, history.action, history.next_state
    return ObservedPushes(*arrays, np.zeros(len(history), np.int64))


def after(belief: Belief, history: PushHistory) -> Posterior:
    return infer(belief, observed(history), Known.everything(len(history)))


@pytest.mark.parametrize(("config", "kind"), [(AXES, AXES_FIRST), (TEXTBOOK, TEXTBOOK_SECOND)])
def test_pushes_show_the_kind_of_physics_and_its_friction(
    belief: Belief, random_pushes: Draw, config: PlanarConfig, kind: int
) -> None:
    posterior = after(belief, seen(random_pushes, replace(config, friction=0.17)))
    assert posterior.kind.tolist() == [kind]
    assert not posterior.inferred[0]
    assert posterior.values(belief, FRICTION)[0] == pytest.approx(0.17, rel=0.03)
    assert posterior.log_spread(belief, FRICTION)[0] < 0.05


def test_pushes_show_parameters_that_are_unlike_the_default_ones(
    belief: Belief, random_pushes: Draw
) -> None:
    truth = replace(TEXTBOOK, friction=0.2, tool_friction=0.3, disk_friction=0.05)
    posterior = after(belief, seen(random_pushes, truth, count=10))
    assert posterior.kind[0] == TEXTBOOK_SECOND
    assert posterior.inferred[0]
    kind = belief.kinds[TEXTBOOK_SECOND]
    found = kind.values(posterior.places)
    for column, parameter in enumerate(kind.parameters[:3]):
        off = np.log(found[parameter.name][0] / getattr(truth, parameter.name))
        spread = parameter.spread * posterior.spreads[0, column]
        assert abs(off) < 4 * spread + 0.05, parameter.name


def test_parameters_stay_inside_their_ranges(belief: Belief) -> None:
    kind = belief.kinds[0]
    for far in (-50.0, 50.0):
        values = kind.values(np.full((1, len(kind.names)), far))
        for parameter in kind.parameters:
            assert parameter.least <= values[parameter.name][0] <= parameter.most


def test_without_pushes_the_first_kind_and_the_nominal_friction_are_believed(
    belief: Belief, random_pushes: Draw
) -> None:
    history = seen(random_pushes, TEXTBOOK)
    order = np.zeros(COUNT, np.int64), np.arange(COUNT)
    posterior = infer(belief, observed(history), Known.earlier(*order))
    assert posterior.kind[0] == AXES_FIRST
    assert posterior.values(belief, FRICTION)[0] == pytest.approx(AXES.friction, rel=1e-12)
    assert posterior.pushes.tolist() == list(range(COUNT))


def test_a_history_and_a_row_of_many_say_the_same(sain: SainDynamics, random_pushes: Draw) -> None:
    history = seen(random_pushes, replace(TEXTBOOK, friction=0.09))
    order = np.zeros(COUNT, np.int64), np.arange(COUNT)
    inferred = sain.infer(observed(history), Known.earlier(*order))
    rows = sain.predict_rows(history.state, history.action, inferred)
    for push in range(COUNT):
        informed = sain.condition(history.select(slice(push)))
        one = informed.step(history.state[push : push + 1], history.action[push : push + 1])
        np.testing.assert_allclose(one[0], rows.mean[push], atol=1e-9)


def test_a_correction_that_pushes_contradict_is_dropped(
    belief: Belief, random_pushes: Draw
) -> None:
    torch.manual_seed(0)
    module = InteractionNetwork()
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    wild = residual_model(module, friction_kind(PlanarPrior(AXES)), "planar_axes").believing(belief)
    informed = wild.condition(seen(random_pushes, AXES))
    assert wild.corrects
    assert not informed.corrects
    scenes, pushes = random_pushes(3, 9)
    physics = informed.physics.step(scenes, pushes)
    np.testing.assert_array_equal(informed.step(scenes, pushes), physics)
    rollout = informed.rollout(scenes[0], pushes[None])
    np.testing.assert_array_equal(rollout[0, 0], informed.step(scenes[:1], pushes[:1])[0])


def test_a_belief_is_for_the_prior_that_it_was_made_with(belief: Belief) -> None:
    other = residual_model(InteractionNetwork(), friction_kind(PlanarPrior()), "planar")
    with pytest.raises(ConfigError, match="the belief is for a network on another prior"):
        other.believing(belief)


def test_a_kind_of_other_physics_has_no_parameters(random_pushes: Draw) -> None:
    kind = Kind("given", PlanarPrior(), (), np.zeros((0, 0)), corrected=True)
    history = seen(random_pushes, AXES)
    posterior = after(Belief((kind,)), history)
    assert not posterior.inferred[0]
    assert posterior.places.shape == (1, 0)
