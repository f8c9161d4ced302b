"""Episodes with the real arm world."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import ConfigError, SainError
from sain_core.scene import MID, POSITION
from sain_eval.loop.closed_loop import MAX_REFUSALS, run_episode
from sain_eval.loop.controllers import Decision, controller_maker
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.search.config import PlannerConfig

PAPER = SCENARIOS["paper"].scene(0)
ANYWHERE = SCENARIOS["anywhere"].scene(1)
QUICK = PlannerConfig(samples=512)


def play(case, name, tolerance=0.02):
    return run_episode(case, controller_maker(name, QUICK)(case), tolerance)


class Stubborn:
    """Wants the same push whatever happens, and counts how often it was refused."""

    def __init__(self, push):
        self.push, self.refusals = np.array(push), 0

    def decide(self, scene, goal, random):
        return Decision(self.push)

    def refused(self, push):
        self.refusals += 1

    def observed(self, scene, push, next_scene):
        pass


@pytest.mark.parametrize("case", [PAPER, ANYWHERE], ids=["paper", "anywhere"])
def test_planning_with_the_planar_prior_brings_the_target_to_the_goal(case):
    outcome = play(case, "planar")
    assert outcome.failure == "" and not outcome.fallen
    assert outcome.record.final_distance <= 0.02
    for push in outcome.record.pushes:
        assert push.predicted is not None and push.target_error < 0.03
        assert push.planning_time > 0.0
    befores = [push.before for push in outcome.record.pushes[1:]]
    for push, before in zip(outcome.record.pushes, befores, strict=False):
        np.testing.assert_array_equal(push.after, before)


def test_the_same_scene_is_played_the_same_way_twice():
    first, second = (play(ANYWHERE, "planar", 0.05) for _ in range(2))
    assert first.final.tobytes() == second.final.tobytes()


def test_the_oracle_knows_the_friction_and_solves_it_too():
    assert play(PAPER, "oracle").failure == ""


def test_doing_nothing_leaves_the_scene_as_it_was():
    outcome = play(PAPER, "null")
    assert outcome.failure == "the controller stopped"
    assert outcome.record.pushes == ()
    np.testing.assert_allclose(outcome.final, PAPER.disks, atol=1e-6)


def test_pushing_straight_solves_the_papers_scene():
    outcome = play(PAPER, "straight", 0.05)
    assert outcome.failure == "" and 1 <= len(outcome.record.pushes) <= 4


def test_random_pushes_end_with_the_pushes_that_are_allowed():
    outcome = play(replace(ANYWHERE, max_pushes=3), "random", 0.005)
    assert len(outcome.record.pushes) == 3
    assert outcome.failure.startswith("3 pushes left the target")


def test_a_goal_that_is_reached_already_needs_no_push():
    case = replace(PAPER, goal=PAPER.disks[1, POSITION].copy())
    outcome = play(case, "planar")
    assert outcome.failure == "" and outcome.record.pushes == ()


def test_refused_pushes_are_counted_and_move_nothing():
    out_of_reach = Stubborn([3.0, 0.0, 0.1])  # through the target
    outcome = run_episode(PAPER, out_of_reach, 0.02)
    assert outcome.refusals == out_of_reach.refusals == MAX_REFUSALS
    assert outcome.failure == f"{MAX_REFUSALS} pushes in a row were refused"
    np.testing.assert_allclose(outcome.final[MID], PAPER.disks[MID], atol=1e-6)


def test_a_push_outside_the_limits_ends_the_episode_with_its_reason():
    outcome = run_episode(PAPER, Stubborn([0.0, 0.0, 0.5]), 0.02)
    assert outcome.failure == ("OutOfRangeError: push length is 0.5000 m; allowed: [0, 0.15] m")


def test_a_controller_without_a_name_is_refused():
    with pytest.raises(ConfigError, match="needs a name"):
        controller_maker("")


def test_a_checkpoint_that_is_not_there_is_refused():
    with pytest.raises(SainError, match="no_such_model"):
        controller_maker("/nowhere/no_such_model.safetensors")


def test_a_planning_controller_learns_the_friction_of_its_episode():
    controller = controller_maker("planar_axes", QUICK)(ANYWHERE)
    usual = controller.model.dynamics.config.friction
    outcome = run_episode(ANYWHERE, controller, 0.005)
    assert len(controller.history) == len(outcome.record.pushes)
    learned = controller.planner.planner.model.dynamics.config.friction
    assert abs(learned - ANYWHERE.friction) < 0.5 * abs(usual - ANYWHERE.friction)
    assert controller.model.dynamics.config.friction == usual


def test_each_episode_begins_without_a_past_and_one_that_must_not_learn_has_none():
    maker = controller_maker("planar", QUICK)
    run_episode(ANYWHERE, maker(ANYWHERE), 0.02)
    assert maker(ANYWHERE).history is None
    deaf = controller_maker("planar", QUICK, learns=False)(ANYWHERE)
    run_episode(ANYWHERE, deaf, 0.02)
    assert deaf.history is None
    assert deaf.planner.planner.model is deaf.model
