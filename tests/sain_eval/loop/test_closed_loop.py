"""Episodes with the real arm world."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import ModelUnavailableError, SainError
from sain_core.model import IdentityPrior
from sain_core.push import make_push
from sain_core.scene import MID, TARGET
from sain_core.world import DivergedError
from sain_eval.loop.closed_loop import agent_maker, run_episode
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.agent.agent import Agent, AgentConfig
from sain_mppi.agent.events import PushDecision
from sain_mppi.agent.planning import Decider
from sain_sim.world.truth import TruthConfig
from sain_sim.world.world import World

PAPER = SCENARIOS["paper"].scene(0)
ANYWHERE = SCENARIOS["anywhere"].scene(1)


def play(case, name, tolerance=0.02):
    return run_episode(case, agent_maker(name)(case), tolerance)


class Stubborn(Decider):
    """Wants the same push whatever happens."""

    def __init__(self, push):
        self.push = make_push(*push)

    def decide(self, job, generator):
        return PushDecision(job, self.push)


def play_stubborn(push):
    return run_episode(PAPER, Agent(Stubborn(push), AgentConfig()), 0.02)


@pytest.mark.parametrize("engine", ["bullet", "mujoco"])
def test_planning_with_the_planar_prior_brings_the_target_to_the_goal(engine):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    outcome = play(ANYWHERE.within(TruthConfig(engine=engine)), "planar")
    assert outcome.failure == ""
    assert outcome.record.last.distance <= 0.02
    for push in outcome.record.pushes:
        assert push.predicted is not None and push.error(TARGET) < 0.03
        assert push.planning_time > 0.0
    befores = [push.before for push in outcome.record.pushes[1:]]
    for push, before in zip(outcome.record.pushes, befores, strict=False):
        np.testing.assert_array_equal(push.after, before)


@pytest.mark.parametrize("name", ["oracle", "straight"])
def test_baselines_solve_the_papers_scene_the_same_way_twice(name):
    first, second = (play(PAPER, name, 0.05) for _ in range(2))
    assert first.failure == "" and 1 <= len(first.record.pushes) <= 4
    assert first.final.tobytes() == second.final.tobytes()


def test_random_pushes_end_with_the_pushes_that_are_allowed():
    outcome = play(replace(ANYWHERE, max_pushes=3), "random", 0.005)
    assert len(outcome.record.pushes) == 3
    assert outcome.failure.startswith("3 pushes left body 1")


def test_refused_pushes_are_counted_and_move_nothing():
    outcome = play_stubborn([3.0, 0.0, 0.1])  # through the target
    limit = AgentConfig().max_refusals
    assert outcome.refusals == limit and outcome.record.pushes == ()
    assert outcome.failure == f"NoPushError: {limit} pushes in a row were refused from this scene"
    np.testing.assert_allclose(outcome.final[MID], PAPER.disks[MID], atol=1e-6)


def test_a_model_that_does_not_exist_is_refused():
    for name in ("/nowhere/no_such_model.safetensors", "no_such_model"):
        with pytest.raises(SainError, match="no_such_model"):
            agent_maker(name)


def test_an_agent_learns_the_friction_of_its_episode_if_so_configured():
    """The error of its predictions falls: the planar prior's friction is off at first."""
    case = replace(ANYWHERE, friction=0.2, max_pushes=6)
    errors = {}
    for history in (True, False):
        agent = agent_maker("planar_axes", AgentConfig(history=history))(case)
        pushes = run_episode(case, agent, 0.001).record.pushes
        errors[history] = [push.error(TARGET) + push.error(MID) for push in pushes]
    assert errors[True][0] == errors[False][0]
    assert np.mean(errors[True][1:]) < 0.5 * np.mean(errors[False][1:])


def test_a_model_that_fails_leaves_physics_to_plan_and_is_counted(monkeypatch):
    def fail(self, scenes, pushes):
        raise ModelUnavailableError("gone")

    monkeypatch.setattr(IdentityPrior, "step", fail)
    outcome = play(PAPER, "identity", 0.05)
    assert outcome.failure == ""
    assert outcome.fallbacks == len(outcome.record.pushes) >= 1


def test_a_push_that_diverges_ends_the_episode_and_is_not_recorded(monkeypatch):
    def diverge(*_):
        raise DivergedError("no finite solution")

    monkeypatch.setattr(World, "push", diverge)
    outcome = play_stubborn((0.0, 0.0, 0.1))
    assert outcome.failure == "DivergedError: no finite solution"
    assert not outcome.record.pushes
