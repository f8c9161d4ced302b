"""What a person reads in the pictures of episodes, of a plan and of the shapes.

Where things are drawn is tested for all that draws (`tests.workspace.test_drawing`).
"""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from sain_core.goal import BodyPose, Goal
from sain_core.push import make_push
from sain_core.randomness import generator
from sain_core.scene import POSITION, THETA, make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.view.figures import new_figure, png_of
from sain_core.view.palette import PALETTE
from sain_core.world import PushRecord
from sain_eval.episode import EpisodeRecord
from sain_eval.plots.axes import draw_legend
from sain_eval.plots.pictures import describe_result, draw_episode, draw_plan
from sain_model.physics.planar import PlanarPrior
from sain_mppi.config import PlannerConfig
from sain_mppi.objective.problem import Problem
from sain_mppi.planner import Planner

PLANNER = PlannerConfig(samples=64, horizon=2, rounds=1)


def bodies_at(*poses):
    """Return a scene of bodies with radii of 0.09 m at poses (x, y, heading)."""
    places, count = np.array(poses, dtype=float), len(poses)
    return make_scene(places[:, :2], np.full(count, 8.0), np.full(count, 0.09), places[:, 2])


@pytest.fixture
def posed():
    """A T and a bar; one push each, the first predicted 5 mm and 0.2 rad off."""
    scenes = [
        bodies_at((0.4, -0.1, 0.5), (0.4, 0.2, 0.0)),
        bodies_at((0.5, -0.1, 0.8), (0.4, 0.2, 0.0)),
        bodies_at((0.5, -0.1, 0.8), (0.5, 0.2, pi)),
    ]
    expected = [scene.copy() for scene in scenes[1:]]
    expected[0][0, POSITION] += (0.003, 0.004)
    expected[0][0, THETA] += 0.2
    pushes = tuple(
        PushRecord(make_push(where, 0.1, 0.1, body=body), *scenes[body : body + 2], expected[body])
        for body, where in enumerate((1.0, -2.0))
    )
    goal = Goal((BodyPose(0, 0.51, -0.1, 0.75, 0.02, 0.1), BodyPose(1, 0.5, 0.21, 0.02, 0.02, 0.1)))
    return EpisodeRecord(goal, pushes, scenes[0], Bodies.named(("t", "bar"), ("pushable",) * 2))


@pytest.fixture
def physics(episode):
    pushes = tuple(replace(push, physics=push.before) for push in episode.pushes)
    return replace(episode, pushes=pushes, title="paper 4")


def legend(figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def panel(figure, title):
    (found,) = [axes for axes in figure.axes if axes.get_title("left") == title]
    return found


def test_the_result_in_words(episode, posed):
    assert describe_result(episode) == "reached in 2 pushes, 8.0 mm from the goal"
    assert describe_result(posed) == "reached in 2 pushes, 10 mm and 0.050 rad from the goal"
    short = replace(episode, pushes=episode.pushes[:1])
    assert describe_result(short) == "not reached in 1 push, 40 mm from the goal"
    figures = draw_episode(replace(posed, title="rearrange_2 0")), draw_episode(short)
    assert figures[0].get_suptitle() == "rearrange_2 0, tolerance 20 mm, 0.1 rad"
    assert figures[0].axes[0].get_title("left") == describe_result(posed)
    colours = [figure.axes[0]._left_title.get_color() for figure in figures]
    assert colours == [PALETTE.success, PALETTE.alarm]


def test_the_panels_have_units_and_the_numbers_of_the_episode(physics, posed):
    figure = draw_episode(physics)
    assert [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes] == [
        ("x [m]", "y [m]"), ("pushes", "distance [mm]"), ("x [mm]", "y [mm]"),
        ("push", "of body 1 [mm]"),
    ]  # fmt: skip
    lines = panel(figure, "Bodies to poses").lines
    assert any(np.allclose(line.get_ydata(), [200.0, 40.0, 8.0]) for line in lines[1:])
    by_physics, by_planner = panel(figure, "Prediction error").containers
    np.testing.assert_allclose([bar.get_height() for bar in by_physics], [160.0, 32.0])
    np.testing.assert_allclose([bar.get_height() for bar in by_planner], [5.0, 0.0], atol=1e-9)
    turns = [line.get_ydata() for line in panel(draw_episode(posed), "Headings").lines]
    turns = [line for line in turns if len(line) == 3]
    np.testing.assert_allclose(turns, [[0.25, 0.05, 0.05], [0.02] * 3], atol=1e-9)


def test_the_legend_names_all_that_is_drawn_and_nothing_else(physics):
    assert legend(draw_episode(physics)) == [
        "table", "reachable area", "body 0", "body 1", "start", "goal and tolerance", "push",
        "predicted by physics", "predicted by the planner",
    ]  # fmt: skip
    still = legend(draw_episode(replace(physics, pushes=())))
    assert {"push", "predicted by the planner", "predicted by physics"}.isdisjoint(still)


def test_every_kind_of_episode_has_a_picture_and_always_the_same(posed):
    free = Goal(tuple(replace(pose, heading=None) for pose in posed.goal.poses))
    fixed = Bodies.named(("t", "bar"), ("pushable", "fixed"))
    placed = replace(posed, goal=free, bodies=fixed)
    drawn = [png_of(draw_episode(one)) for one in (replace(posed, pushes=()), placed, placed)]
    assert min(map(len, drawn)) > 20_000 and drawn[1] == drawn[2]


def test_nothing_is_cut_off_no_text_lies_on_another_and_letters_are_legible(episode):
    """A phone shows a picture 390 pixels wide; 6.5 of them are the least for a letter."""
    long = replace(episode, title="clutter_cube, scene 12, sain_history")
    figure = draw_episode(long)
    figure.canvas.draw()
    width, height = figure.canvas.get_width_height()
    labels = [*figure.legends[0].get_texts()]
    for axes in figure.axes:
        titles = [axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label]
        for text in [*titles, *axes.texts]:
            box = text.get_window_extent()
            assert box.x0 >= -1 and box.y0 >= -1, text
            assert box.x1 <= width + 1 and box.y1 <= height + 1, text
        labels += [axes.xaxis.label, *(one for one in axes.texts if len(one.get_text()) > 3)]
    smallest = min(text.get_fontsize() for text in labels)
    assert smallest * 390 / figure.get_figwidth() / 72 >= 6.5
    heads = [one for axes in figure.axes for one in axes.texts if len(one.get_text()) > 3]
    boxes = [text.get_window_extent() for text in heads]
    for place, box in enumerate(boxes):
        assert not box.count_overlaps(boxes[:place]), heads[place]


def test_a_plan_is_explained(posed):
    bodies = Bodies.named(("t", "bar"), ("pushable", "fixed"))
    goal = Goal(posed.goal.poses[:1])
    problem = Problem.of(posed.start, goal, bodies)
    plan = Planner(PlanarPrior(), PLANNER).plan(problem, generator(0, "plan"))
    plan = replace(plan, regions=np.full((2, 2), 0.02))
    figure = new_figure(6.6, 7.2)
    names = draw_plan(figure.subplots(), posed.start, goal, plan, bodies=bodies)
    draw_legend(figure, names, columns=3)
    assert legend(figure) == [
        "table", "reachable area", "body 0", "other body", "goal and tolerance", "push",
        "90 % region", "other sequence, cheapest", "other sequence, dearest",
    ]  # fmt: skip
    (fixed,) = [patch for patch in figure.axes[0].patches if patch.get_hatch()]
    np.testing.assert_allclose(fixed.get_xy()[:-1], bodies.shapes[1].placed(posed.start[1]))
