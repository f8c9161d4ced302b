"""Earlier pushes tell the kind of physics and its parameters, and whether a network holds."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from sain_core.dataset import Transitions
from sain_core.errors import ConfigError
from sain_core.history import PushHistory
from sain_core.shapes.bodies import PAPER_DISKS
from sain_core.types import Pushes, Scenes
from sain_model.data.dataset import Part
from sain_model.dynamics.identify import believing_model
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.predictors import predict_with_history
from sain_model.identification import curves
from sain_model.identification.beliefs import Belief, usual_belief
from sain_model.identification.evidence import Known
from sain_model.identification.parameters import FRICTION, config_at, parameters_of, values_at
from sain_model.identification.posterior import Posterior, infer
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.friction import FrictionConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import AXES, TEXTBOOK, PlanarConfig

Draw = Callable[[int, int], tuple[Scenes, Pushes]]
AXES_FIRST, TEXTBOOK_SECOND = range(2)
COUNT = 6


@pytest.fixture
def belief() -> Belief:
    return usual_belief(AXES, FrictionConfig(noise=0.0003, noise_share=0.01))


@pytest.fixture
def sain() -> SainDynamics:
    torch.manual_seed(0)
    model = SainDynamics(
        InteractionNetwork(), PlanarPrior(AXES), "planar_axes", friction=FrictionConfig()
    )
    return believing_model(model)


def seen(draw: Draw, config: PlanarConfig, count: int = COUNT, seed: int = 5) -> PushHistory:
    """Return what a world of this physics shows, with errors of 0.1 mm."""
    scenes, pushes = draw(count, seed)
    after = PlanarPrior(config).step(scenes, pushes)
    after[..., :2] += np.random.default_rng(seed).normal(0, 1e-4, after[..., :2].shape)
    return PushHistory(scenes, pushes, after)


def told(belief: Belief, history: PushHistory) -> Posterior:
    return infer(belief, PAPER_DISKS, history, Known.everything(len(history)))


@pytest.mark.parametrize(("config", "kind"), [(AXES, AXES_FIRST), (TEXTBOOK, TEXTBOOK_SECOND)])
def test_pushes_tell_the_kind_of_physics_and_its_friction(
    belief: Belief, random_pushes: Draw, config: PlanarConfig, kind: int
) -> None:
    posterior = told(belief, seen(random_pushes, replace(config, friction=0.17)))
    assert posterior.structure.tolist() == [kind]
    assert not posterior.inferred[0]
    assert posterior.friction[0] == pytest.approx(0.17, rel=0.03)
    assert posterior.friction_log_std[0] < 0.05


def test_pushes_tell_parameters_that_are_unlike_the_usual_ones(
    belief: Belief, random_pushes: Draw
) -> None:
    truth = replace(TEXTBOOK, friction=0.2, tool_friction=0.3, disk_friction=0.05)
    posterior = told(belief, seen(random_pushes, truth, count=10))
    assert posterior.structure[0] == TEXTBOOK_SECOND
    assert posterior.inferred[0]
    config = belief.structures[TEXTBOOK_SECOND].config
    found = config_at(config, posterior.places[0])
    for column, parameter in enumerate(parameters_of(config)[:3]):
        known = np.log(getattr(found, parameter.name) / getattr(truth, parameter.name))
        spread = parameter.spread * posterior.spreads[0, column]
        assert abs(known) < 4 * spread + 0.05, parameter.name


def test_parameters_stay_inside_their_ranges() -> None:
    for far in (-50.0, 50.0):
        values = values_at(AXES, np.full((1, len(parameters_of(AXES))), far))[0]
        for parameter, value in zip(parameters_of(AXES), values, strict=True):
            assert parameter.least <= value <= parameter.most


def test_without_pushes_the_first_kind_and_the_nominal_friction_are_believed(
    belief: Belief, random_pushes: Draw
) -> None:
    history = seen(random_pushes, TEXTBOOK)
    posterior = infer(
        belief, PAPER_DISKS, history, Known.earlier(np.zeros(COUNT, np.int64), np.arange(COUNT))
    )
    assert posterior.structure[0] == AXES_FIRST
    assert posterior.friction[0] == belief.structures[0].config.friction
    assert posterior.pushes.tolist() == list(range(COUNT))


def test_a_row_knows_the_earlier_pushes_of_its_episode_alone() -> None:
    known = Known.earlier(np.array([7, 3, 7, 3, 7]), np.array([2, 1, 0, 0, 1]))
    pairs = {(int(row), int(push)) for row, push in zip(known.row, known.push, strict=True)}
    assert pairs == {(0, 2), (0, 4), (4, 2), (1, 3)}
    np.testing.assert_array_equal(known.counts, [2, 1, 0, 0, 1])
    values = np.array([1.0, 10.0, 100.0, 1000.0, 10000.0])
    np.testing.assert_array_equal(known.total(values), [10100, 1000, 0, 0, 100])


def test_a_history_and_a_row_of_many_tell_the_same(sain: SainDynamics, random_pushes: Draw) -> None:
    history = seen(random_pushes, replace(TEXTBOOK, friction=0.09))
    nothing = np.full_like(history.state, np.nan)
    data = Part(
        history.state, history.action, history.next_state, nothing, np.zeros(COUNT, np.int64),
        np.arange(COUNT), np.full(COUNT, np.nan), nothing,
    )  # fmt: skip
    rows = predict_with_history(sain, data)
    for push in range(COUNT):
        informed = sain.condition(history.select(slice(push)))
        one = informed.step(history.state[push : push + 1], history.action[push : push + 1])
        np.testing.assert_allclose(one[0], rows.mean[push], atol=1e-9)


def test_a_correction_that_pushes_contradict_is_dropped(
    sain: SainDynamics, random_pushes: Draw
) -> None:
    with torch.no_grad():
        for parameter in sain.network.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    wild = replace(sain)
    informed = wild.condition(seen(random_pushes, AXES))
    assert wild.corrects
    assert not informed.corrects
    scenes, pushes = random_pushes(3, 9)
    physics = informed.prior.step(scenes, pushes)
    np.testing.assert_array_equal(informed.step(scenes, pushes), physics)
    rollout = informed.rollout(scenes[0], pushes[None])
    np.testing.assert_array_equal(rollout[0, 0], informed.step(scenes[:1], pushes[:1])[0])


def test_a_past_push_is_simulated_once(
    sain: SainDynamics, random_pushes: Draw, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []
    compute = curves.curves_of

    def count(structure: object, bodies: object, pushes: Transitions) -> object:
        asked.append(len(pushes))
        return compute(structure, bodies, pushes)  # type: ignore[arg-type]

    monkeypatch.setattr(curves, "curves_of", count)
    history = seen(random_pushes, AXES)
    for pushes in range(1, COUNT + 1):
        informed = sain.condition(history.select(slice(pushes)))
    assert asked == [1, 1] * COUNT
    again = believing_model(replace(sain, belief=None)).condition(history)
    assert isinstance(again.prior, PlanarPrior)
    assert isinstance(informed.prior, PlanarPrior)
    assert again.prior.config == informed.prior.config


def test_a_model_that_infers_nothing_takes_no_belief(belief: Belief) -> None:
    deaf = SainDynamics(InteractionNetwork(), PlanarPrior(AXES), "planar_axes")
    with pytest.raises(ConfigError, match="infers nothing from pushes, and takes no belief"):
        deaf.with_prior_belief(belief)


def test_a_belief_is_for_the_prior_that_it_was_made_with(belief: Belief) -> None:
    other = SainDynamics(InteractionNetwork(), PlanarPrior(), "planar", friction=FrictionConfig())
    with pytest.raises(ConfigError, match="the belief is for a network on another prior"):
        other.with_prior_belief(belief)


def test_the_table_friction_is_the_first_parameter() -> None:
    assert parameters_of(AXES)[FRICTION].name == "friction"
