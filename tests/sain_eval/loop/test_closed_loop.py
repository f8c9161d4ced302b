# ruff: noqa: E501 - a case is a line
"""Episodes with the real arm world: to places and to poses, and why one ends short of them."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from sain_core.errors import ModelUnavailableError, SainError
from sain_core.goal import BodyPose, Goal
from sain_core.model import IdentityPrior
from sain_core.push import make_push
from sain_core.scene import MASS, MID, NOMINAL_MASS, TARGET, make_scene
from sain_core.view.figures import png_of
from sain_core.world import DivergedError
from sain_eval.cli.evaluate import EvaluateOptions
from sain_eval.episode import Tolerance
from sain_eval.loop.closed_loop import agent_maker, features_of, run_episode, version_of
from sain_eval.loop.evaluation import EpisodeJob, play_job
from sain_eval.loop.results import scene_records
from sain_eval.plots.pictures import draw_episode
from sain_eval.scenes.families import PoseScenario, ScenarioScene
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.agent.agent import Agent, AgentConfig
from sain_mppi.agent.events import PushDecision
from sain_mppi.agent.planning import Decider
from sain_sim.camera.camera import WorldCameraConfig
from sain_sim.world.truth import TruthConfig
from sain_sim.world.world import World
from tests.policies import LOADED, OfTwo

PAPER = SCENARIOS["paper"].scene(0)
ANYWHERE = SCENARIOS["anywhere"].scene(1)
PUSH_T = SCENARIOS["push_t"].scene(9)
POSE = Tolerance(0.02, 0.1)
ROW = np.stack([np.full(10, 0.45), np.linspace(-0.45, 0.45, 10)], axis=-1)


def scene_of(shapes, places, poses, roles=(), size=0.045) -> ScenarioScene:
    """Return a scene of bodies of one circumscribed radius [m], at headings of 0."""
    count = len(shapes)
    disks = make_scene(np.array(places), np.full(count, 8.0), np.full(count, size))
    roles = roles or ("pushable",) * count
    return ScenarioScene("test", 0, disks, 0.12, shapes, Goal(poses), 2, roles=roles)


def play(case, name, tolerance=0.02):
    return run_episode(case, agent_maker(name)(case), tolerance)


class Stubborn(Decider):
    """Wants the same push whatever happens."""

    def __init__(self, push):
        self.push = make_push(*push)

    def decide(self, job, generator):
        return PushDecision(job, self.push)


def play_stubborn(push, case=PAPER):
    return run_episode(case, Agent(Stubborn(push), AgentConfig()), 0.02)


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
    assert outcome.failure.startswith(
        f"NoPushError: {limit} pushes in a row were refused from this scene, the last: the "
    )
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
    assert np.mean(errors[True][1:3]) < 0.5 * np.mean(errors[False][1:3])


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


def test_planning_with_the_planar_prior_brings_a_t_to_its_pose():
    outcome = play(PUSH_T, "planar", POSE)
    record = outcome.record
    assert outcome.failure == "" and outcome.refusals == 0
    assert record.last.distance <= 0.02 and record.last.turn <= 0.1
    assert record.bodies.shapes[0].name == "t" and record.bodies.pushable == (0,)
    (judged,) = scene_records(PUSH_T, "planar", outcome, (POSE,))
    assert judged.success and judged.heading_tolerance == 0.1
    assert len(judged.turn_errors) == len(judged.target_errors) == judged.pushes
    assert max(judged.target_errors) < 0.03 and min(judged.plan_seconds) > 0.0


def test_goals_in_a_row_follow_each_other_without_a_reset_until_one_is_missed():
    case = PoseScenario("streak", "t", goals=2).scene(0)
    outcome = play(case, "planar", Tolerance(0.05, 0.5))
    first, second = outcome.records
    assert outcome.failure == ""
    np.testing.assert_array_equal(second.start, first.scenes[-1])
    (judged,) = scene_records(case, "planar", outcome, (Tolerance(0.05, 0.5),))
    assert judged.success and judged.goals == 2
    assert judged.pushes == len(first.pushes) + len(second.pushes)

    ended = play(replace(case, max_pushes=1), "planar", POSE)
    assert len(ended.records) == 1
    (judged,) = scene_records(case, "planar", ended, (0.02,))
    assert not judged.success and judged.goals == 0 and judged.pushes == 1


def test_a_body_that_was_pushed_off_the_table_is_the_reason():
    disks = make_scene(np.array([[0.25, 0.0]]), np.full(1, 8.0), np.full(1, 0.09), np.full(1, pi))
    goal = Goal((BodyPose(0, 0.5, 0.0, 0.0),))
    outcome = play_stubborn((0, 0, 0.128), ScenarioScene("test", 0, disks, 0.12, ("square",), goal))
    assert outcome.failure.startswith("push 1 moved body 0 off the table, to (0.")


@pytest.mark.parametrize("count", [1, 10])
def test_one_body_or_ten_are_played_and_drawn(count):
    shapes = ("t", "disk", "star", "l", "cube", "bar", "u", "plus", "hexagon", "arrow")[:count]
    poses = tuple(
        BodyPose(body, 0.56, ROW[body, 1], None if shape == "disk" else 0.3)
        for body, shape in enumerate(shapes)
    )
    outcome = play(scene_of(shapes, ROW[:count], poses, size=0.04), "random", POSE)
    assert len(outcome.record.pushes) == 2
    assert len(png_of(draw_episode(outcome.record, f"{count} bodies"))) > 20_000


@pytest.mark.parametrize(
    ("shapes", "roles", "poses", "message"),
    [
        (("disk",), (), (BodyPose(0, 0.5, 0.1, 1.0),), "heading 1.000 rad; it is a disk and has"),
        (("t", "l"), ("pushable", "fixed"), (BodyPose(0, 0.45, 0.22, 0.5),), "the goal of body 0 overlaps fixed body 1 by"),
        (("t", "l"), (), (BodyPose(0, 0.5, 0.0, 0.5), BodyPose(1, 0.51, 0.0, 0.5)), "the goal of body 1 overlaps goal of body 0 by"),
        (("t", "l"), ("pushable", "fixed"), (BodyPose(1, 0.5, 0.0, 0.5),), "body 1 is fixed; it cannot be moved to a goal"),
        (("t",), (), (BodyPose(1, 0.5, 0.0, 0.5),), "given for body 1; the scene has bodies 0 to 0"),
        (("t",), (), (BodyPose(0, 2.0, 0.0, 0.5),), "of body 0 is off the table; it covers"),
    ],
)  # fmt: skip
def test_a_goal_that_cannot_be_ends_the_episode_with_its_reason(shapes, roles, poses, message):
    places = [(0.4, 0.0), (0.45, 0.2)][: len(shapes)]
    outcome = play(scene_of(shapes, places, poses, roles), "planar", POSE)
    assert message in outcome.failure and outcome.record.pushes == ()


def play_seen(**camera):
    """Play what a camera shows; the truth is judged."""
    options = EvaluateOptions(camera=WorldCameraConfig(**camera))
    job = EpisodeJob("anywhere", 1, "planar", (0.01,), options.agent, camera=options.camera)
    return play_job(job)


def test_a_noisy_episode_reaches_the_goal_in_truth():
    outcome, again = (play_seen(noise="0.005,0.035", delay=0.1) for _ in range(2))
    assert outcome.failure == "" and outcome.record.last.distance <= 0.01
    assert again.final.tobytes() == outcome.final.tobytes()


def test_bodies_of_unknown_mass_are_pushed_too():
    unknown = play_seen(unknown="mass", bias="0.001,0.01")
    assert unknown.failure == "" and unknown.final[0, MASS] != NOMINAL_MASS


def test_versions_tell_apart_what_was_trained_or_written():
    assert version_of("null") == version_of("planar") == ""
    assert len(version_of("sain")) == len(version_of("policy:tests.policies:straight")) == 64


def test_a_policy_is_loaded_once():
    name = "policy:tests.policies:of_two"
    assert features_of(name) == OfTwo.features and not features_of("planar")
    assert version_of(name) and agent_maker(name)(PAPER) is not agent_maker(name)(PAPER)
    assert LOADED == ["tests.policies:of_two"]
