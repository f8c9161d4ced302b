"""What a push tells of the physics, and which one tells most: laws of the Gaussian update."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import NoPushError
from sain_core.feasibility import Feasibility
from sain_core.push import LENGTH, PushLimits
from sain_core.scene import POSITION, make_scene
from sain_core.shapes.bodies import PAPER_DISKS
from sain_core.transitions import PushHistory
from sain_eval.scenes.scenarios import draw_scene
from sain_lab.exploration.session import (
    Certainty,
    InformativeDecider,
    Work,
    answers,
    expected_error,
    gains,
    imagined_work,
    stays_in_reach,
    variance_of,
)
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.kinds import ACROSS, LABORATORY, Kind, only
from sain_model.physics.parameters import TEXTBOOK
from sain_model.physics.planar import PlanarPrior
from sain_mppi.agent.agent import Agent, AgentConfig, act
from sain_mppi.agent.events import EpisodeBegun, GoalGiven, SceneObserved, Stop, Task

NAMES = (*LABORATORY, ACROSS)
KIND = Kind("textbook", PlanarPrior(TEXTBOOK), NAMES, np.eye(len(NAMES)), corrected=True)
MODEL = SainDynamics(only(KIND))
SCENE = make_scene(
    np.array([(0.45, 0.0), (0.60, 0.02)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)


@pytest.fixture(scope="module")
def pushes():
    drawn = PushLimits().sample(np.random.default_rng(0), 24)
    drawn[:, LENGTH] += 0.02
    return drawn


@pytest.fixture(scope="module")
def scenes(pushes):
    return np.repeat(SCENE[None], len(pushes), axis=0)


@pytest.fixture(scope="module")
def work(scenes, pushes):
    return Work(PAPER_DISKS, scenes[12:], pushes[12:])


def certainty():
    return Certainty.of(MODEL, PAPER_DISKS, PushHistory.empty(2))


def test_the_gain_is_what_the_update_takes_from_the_expected_error(scenes, pushes, work):
    before = certainty()
    found = answers(before, PAPER_DISKS, scenes, pushes)
    variance = variance_of(before, PAPER_DISKS, scenes, pushes, found.after)
    needs = work.needs(before)
    gained = gains(found, variance, needs, before.root)
    for push, gain in enumerate(gained):
        slopes = found.slopes[push] @ np.linalg.inv(before.root)  # along z
        noise = np.diag(variance[push] + found.curvature[push])
        information = slopes.T @ np.linalg.solve(noise, slopes)
        precision = np.linalg.inv(before.covariance) + information
        after = replace(before, covariance=np.linalg.inv(precision))
        left = expected_error(before, needs) ** 2 - expected_error(after, needs) ** 2
        assert gain == pytest.approx(left, rel=1e-6, abs=1e-15)
    assert (gained >= 0.0).all() and gained.max() > 3.0 * np.median(gained)


def test_what_an_episode_has_of_its_own_is_worth_nothing(work):
    needs = work.needs(certainty())
    own = KIND.of_episode
    assert own.any() and not needs[own].any() and not needs[:, own].any()
    assert needs[~own][:, ~own].any()


def test_as_many_pushes_more_leave_less_but_never_nothing(scenes, pushes, work):
    before = certainty()
    history = PushHistory(scenes[:6], pushes[:6], MODEL.step(scenes[:6], pushes[:6]))
    after = Certainty.of(MODEL, PAPER_DISKS, history)
    needs = work.needs(after)
    errors = [expected_error(one, needs) for one in (before, after, after.doubled(before))]
    assert errors[0] > errors[1] > errors[2] > 0.0
    assert errors[2] > errors[1] / 2


def test_the_spread_that_is_stated_holds_the_truth(scenes, pushes):
    truth = replace(TEXTBOOK, tool_friction=0.2, disk_friction=0.08)
    after = PlanarPrior(truth).step(scenes, pushes)
    found = Certainty.of(MODEL, PAPER_DISKS, PushHistory(scenes, pushes, after)).named
    for name in ("tool_friction", "disk_friction"):
        value, spread = found[name]
        assert abs(np.log(value / getattr(truth, name))) < 3.0 * spread < 0.5


def test_no_push_is_chosen_that_may_leave_the_reach(scenes, pushes):
    found = answers(certainty(), PAPER_DISKS, scenes, pushes)
    everywhere = stays_in_reach(SCENE, found, Feasibility())
    ends = found.extremes[..., POSITION]
    assert everywhere.all() == bool((np.hypot(*np.moveaxis(ends, -1, 0)) < 0.74).all())
    away = SCENE.copy()
    away[:, 0] += 0.22  # the target is at the limit of the reach
    far = np.repeat(away[None], len(pushes), axis=0)
    safe = stays_in_reach(away, answers(certainty(), PAPER_DISKS, far, pushes), Feasibility())
    assert 0 < safe.sum() < len(safe)


def decide(scene, **config):
    goal = draw_scene("anywhere", 1).goal
    work = Work(PAPER_DISKS, scene[None], PushLimits().sample(np.random.default_rng(1), 1))
    agent = Agent(InformativeDecider(lambda: MODEL, work, **config), AgentConfig())
    events = EpisodeBegun(1, PAPER_DISKS), GoalGiven(Task(1, 0, goal, 5))
    return act(agent, *events, SceneObserved(scene, 1, 1))


def test_a_teacher_sends_a_permitted_push_and_says_where_there_is_none():
    decision = decide(SCENE)
    assert decision.job.problem.permitted(decision.push[None]).all()
    stuck = SCENE.copy()
    stuck[0, :2] = 1.0, 0.3  # out of reach
    stop = decide(stuck)
    assert isinstance(stop, Stop) and isinstance(stop.error, NoPushError)


def test_work_is_imagined_where_the_model_is_true():
    case = draw_scene("anywhere", 3)
    config = AgentConfig()
    work = imagined_work(
        [case], MODEL, replace(config, planner=replace(config.planner, samples=64))
    )
    assert work.bodies == case.bodies and len(work.pushes) >= 1
    np.testing.assert_array_equal(work.scenes[0], case.disks)
