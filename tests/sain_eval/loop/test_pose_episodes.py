# ruff: noqa: E501 - a case is a line
"""Episodes towards poses with the real arm world, and what a person reads where one cannot be."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from sain_core.goal import BodyPose, Goal
from sain_core.push import make_push
from sain_core.scene import make_scene
from sain_core.view.figures import write_png
from sain_eval.episode import Tolerance
from sain_eval.loop.closed_loop import agent_maker, run_episode
from sain_eval.loop.results import scene_records
from sain_eval.plots.pictures import draw_episode
from sain_eval.scenes.families import PoseScenario, ScenarioScene
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.agent.agent import Agent, AgentConfig
from sain_mppi.agent.events import PushDecision
from sain_mppi.agent.planning import Decider

PUSH_T = SCENARIOS["push_t"].scene(9)
ROW = np.stack([np.full(10, 0.45), np.linspace(-0.45, 0.45, 10)], axis=-1)


def scene_of(shapes, places, poses, roles=(), size=0.045) -> ScenarioScene:
    """Return a scene of bodies of one circumscribed radius [m], at headings of 0."""
    count = len(shapes)
    disks = make_scene(np.array(places), np.full(count, 8.0), np.full(count, size))
    return ScenarioScene(
        "test", 0, disks, 0.12, shapes, Goal(poses), 2, roles=roles or ("pushable",) * count
    )


def play(case, name="planar", tolerance=Tolerance(0.02, 0.1)):
    return run_episode(case, agent_maker(name)(case), tolerance)


def test_planning_with_the_planar_prior_brings_a_t_to_its_pose():
    outcome = play(PUSH_T)
    record = outcome.record
    assert outcome.failure == "" and outcome.refusals == 0
    assert record.last.distance <= 0.02 and record.last.turn <= 0.1
    assert record.bodies.shapes[0].name == "t" and record.bodies.pushable == (0,)
    (judged,) = scene_records(PUSH_T, "planar", outcome, (Tolerance(0.02, 0.1),))
    assert judged.success and judged.heading_tolerance == 0.1
    assert len(judged.turn_errors) == len(judged.target_errors) == judged.pushes
    assert max(judged.target_errors) < 0.03 and min(judged.plan_seconds) > 0.0


def test_goals_in_a_row_follow_each_other_without_a_reset_until_one_is_missed():
    case = PoseScenario("streak", "t", goals=2).scene(0)
    outcome = play(case, tolerance=Tolerance(0.05, 0.5))
    first, second = outcome.records
    assert outcome.failure == ""
    np.testing.assert_array_equal(second.start, first.scenes[-1])
    (judged,) = scene_records(case, "planar", outcome, (Tolerance(0.05, 0.5),))
    assert judged.success and judged.goals == 2
    assert judged.pushes == len(first.pushes) + len(second.pushes)

    ended = play(replace(case, max_pushes=1))
    assert len(ended.records) == 1
    (judged,) = scene_records(case, "planar", ended, (0.02,))
    assert not judged.success and judged.goals == 0 and judged.pushes == 1


class Fixed(Decider):
    """Makes the same push, whatever the scene."""

    def decide(self, job, generator):
        return PushDecision(job, make_push(0.0, 0.0, 0.128))


def test_a_body_that_was_pushed_off_the_table_is_the_reason():
    disks = make_scene(np.array([[0.25, 0.0]]), np.full(1, 8.0), np.full(1, 0.09), np.full(1, pi))
    case = ScenarioScene(
        "test", 0, disks, 0.12, ("square",), Goal((BodyPose(0, 0.5, 0.0, 0.0),)), 5
    )
    outcome = run_episode(case, Agent(Fixed(), AgentConfig()), 0.02)
    assert outcome.failure.startswith("push 1 moved body 0 off the table, to (0.")


@pytest.mark.parametrize("count", [1, 10])
def test_one_body_or_ten_are_played_and_drawn(count, tmp_path):
    shapes = ("t", "disk", "star", "l", "cube", "bar", "u", "plus", "hexagon", "arrow")[:count]
    poses = tuple(
        BodyPose(body, 0.56, ROW[body, 1], None if shape == "disk" else 0.3)
        for body, shape in enumerate(shapes)
    )
    outcome = play(scene_of(shapes, ROW[:count], poses, size=0.04), "random")
    assert len(outcome.record.pushes) == 2
    path = write_png(draw_episode(outcome.record, f"{count} bodies"), tmp_path / "episode.png")
    assert path.stat().st_size > 20_000


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
    outcome = play(scene_of(shapes, places, poses, roles))
    assert message in outcome.failure and outcome.record.pushes == ()
