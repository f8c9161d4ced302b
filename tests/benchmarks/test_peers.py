"""Optimizers of others plan in our loop: pushes that help, the same ones for the same seed."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.peer_optimizers import PYTORCH, PeerSettings, PushBox
from benchmarks.peer_planning import PeerDecider, TimedDecider
from benchmarks.peers import PEERS, ours_with
from sain_core.errors import ConfigError
from sain_core.push import LENGTH, PushLimits
from sain_eval.scenes.scenarios import SCENARIOS
from sain_model.physics.planar import PlanarPrior
from sain_mppi.agent.agent import Agent, AgentConfig, act
from sain_mppi.agent.events import GoalGiven, PushDecision, SceneObserved, Task
from sain_mppi.algorithms.config import MPPI, MPPI_ROUNDS, PlannerConfig

CASE = SCENARIOS["anywhere"].scene(3)
GOAL = CASE.goal.within(0.005, 0.1)


@pytest.fixture(params=PEERS)
def peer(request: pytest.FixtureRequest) -> PeerSettings:
    if request.param != PYTORCH:
        pytest.importorskip("judo", reason="judo is optional: see benchmarks.peers")
    return replace(PEERS[request.param], samples=128)


def first_plan(peer: PeerSettings) -> PushDecision:
    model = PlanarPrior()
    config = AgentConfig(planner=PlannerConfig(ahead=False))
    decider = TimedDecider(PeerDecider(model, model, config, peer))
    agent = Agent(decider, config)
    decision = act(agent, GoalGiven(Task(1, 1, GOAL, 15)), SceneObserved(CASE.disks, 1, 1))
    assert isinstance(decision, PushDecision)
    assert len(decider.seconds) == 1
    return decision


@pytest.mark.parametrize("cheapest", [False, True])
def test_each_optimizer_finds_a_permitted_plan_better_than_rest(peer, cheapest):
    plan = first_plan(replace(peer, cheapest=cheapest)).plan
    assert plan is not None
    assert plan.cost < plan.rest_cost
    assert AgentConfig().feasibility.mask(CASE.disks[None], plan.push[None]).all()


def test_same_seed_same_push(peer):
    np.testing.assert_array_equal(first_plan(peer).push, first_plan(peer).push)


def test_a_missing_judo_is_named_with_its_installation(monkeypatch):
    monkeypatch.setitem(sys.modules, "judo.optimizers", None)
    monkeypatch.setitem(sys.modules, "judo", None)
    model, config = PlanarPrior(), AgentConfig()
    agent = Agent(PeerDecider(model, model, config, PeerSettings("judo cem")), config)
    stop = act(agent, GoalGiven(Task(1, 1, GOAL, 15)), SceneObserved(CASE.disks, 1, 1))
    assert isinstance(stop.error, ConfigError)
    assert "pip install --no-deps judo-rai" in stop.failure


def test_numbers_name_all_pushes_and_no_others():
    limits, draw = PushLimits(), np.random.default_rng(0)
    box = PushBox(limits)
    pushes = limits.sample(draw, 100)
    np.testing.assert_allclose(box.pushes(box.numbers(pushes)), pushes, atol=1e-12)
    far = box.pushes(box.bounded(draw.normal(0.0, 5.0, (100, 3))))
    assert all(limits.check(push) is push for push in far)
    assert box.pushes(box.rest)[LENGTH] == 0.0


@pytest.mark.parametrize("samples", [16, 64, 100, 1024])
def test_iterations_divide_the_samples(samples):
    settings = PeerSettings(PYTORCH, samples=samples, iterations=8)
    assert settings.rounds * settings.each <= samples < settings.rounds * (settings.each + 1)


@pytest.mark.parametrize("algorithm", [MPPI, MPPI_ROUNDS])
def test_our_rounds_have_as_many_samples_together(algorithm):
    config = ours_with(1024, algorithm)
    rounds = 1 if algorithm == MPPI else config.rounds
    assert sum(map(config.samples_in, range(rounds))) == pytest.approx(1024, abs=3)
