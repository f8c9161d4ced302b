"""The picture of a plan, read as a person reads it: by what is where."""

from io import BytesIO

import numpy as np
from PIL import Image

from sain_core.goal import BodyPose, Goal
from sain_core.randomness import generator
from sain_core.scene import POSITION, THETA, make_scene
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.view.figures import DOTS_PER_INCH, new_figure
from sain_eval.plots.axes import draw_legend
from sain_eval.plots.pictures import draw_plan
from sain_model.physics.planar import PlanarPrior
from sain_mppi.config import PlannerConfig
from sain_mppi.objective.problem import Problem
from sain_mppi.planner import Planner

BLUE, GREEN = (47, 111, 168), (26, 158, 102)
BARE = (230, 237, 242)  # the part of the table in reach
PLANNER = PlannerConfig(samples=64, horizon=2, rounds=1)


def scene_of(count):
    places = np.array([(0.45, 0.0), (0.62, 0.0), (0.45, 0.30)])[:count]
    return make_scene(places, np.full(count, 8.0), np.full(count, 0.08))


def picture_of(scene, goal, bodies=PAPER_DISKS):
    """Return a plan, what its legend names, and a function: place [m] -> colour (3,)."""
    plan = Planner(PlanarPrior(), PLANNER).plan(
        Problem.of(scene, goal, bodies), generator(0, "plan")
    )
    figure = new_figure(6.6, 7.2)
    axes = figure.subplots()
    names = draw_plan(axes, scene, goal, plan, bodies=bodies)
    draw_legend(figure, names, columns=3)
    memory = BytesIO()
    figure.savefig(memory, format="png", dpi=DOTS_PER_INCH)
    pixels = np.array(Image.open(memory).convert("RGB")).astype(int)

    def colour(place):
        x, y = axes.transData.transform(place) * DOTS_PER_INCH / figure.dpi
        return pixels[round(pixels.shape[0] - y), round(x)]

    shown = [text.get_text() for text in figure.legends[0].get_texts()]
    return plan, shown, colour, axes


def test_a_body_that_is_no_disk_has_its_outline():
    scene = scene_of(1)
    bodies = Bodies.named(("t",), ("pushable",))
    goal = Goal((BodyPose(0, 0.40, 0.30, 0.5),))
    plan, shown, colour, axes = picture_of(scene, goal, bodies)
    assert "body 0" in shown and "goal and tolerance" in shown
    outlines = [
        patch.get_xy()[:-1] for patch in axes.patches if hasattr(patch, "get_xy")
        and np.shape(patch.get_xy()) == (9, 2)
    ]  # fmt: skip
    wanted = scene[0].copy()
    wanted[POSITION], wanted[THETA] = (0.40, 0.30), 0.5
    for state in (scene[0], *plan.predicted[:, 0], wanted):
        placed = bodies.shapes[0].placed(state)
        assert any(np.allclose(placed, outline) for outline in outlines)
    # Beside its stem there is table, where the picture of a disk would be blue.
    stem, notch = colour((0.44, -0.055)), colour((0.505, -0.045))
    assert np.abs(stem - BARE).sum() > 100 and stem[2] > stem[0] + 30
    assert np.abs(notch - BARE).sum() < 40


def test_bodies_with_poses_have_their_own_colours_and_outlines_to_reach():
    goal = Goal((BodyPose(0, 0.40, -0.2, 0.5), BodyPose(1, 0.60, 0.2, 1.0)))
    bodies = Bodies.named(("l", "box_2x1", "star"), ("pushable", "pushable", "fixed"))
    _, shown, colour, axes = picture_of(scene_of(3), goal, bodies)
    assert {"body 0", "body 1", "other body"} < set(shown)
    red, _, blue = colour((0.665, 0.015))
    assert red > blue + 30  # orange
    hatched = [patch for patch in axes.patches if patch.get_hatch()]
    assert len(hatched) == 1  # the star, which is fixed and is nowhere else


def test_without_bodies_all_are_disks():
    scene, goal = scene_of(2), Goal.place(0.65, 0.2)
    _, shown, colour, _ = picture_of(scene, goal)
    assert {"body 0", "body 1", "goal and tolerance"} < set(shown)
    for corner in (scene[0, POSITION] + 0.05, scene[0, POSITION] - 0.05):
        assert np.abs(colour(corner) - BLUE).sum() < 300
    assert np.abs(colour((0.65, 0.22)) - GREEN).sum() < 60


def test_the_push_begins_at_the_outline():
    """The arrow of a T starts beside the T, not on the circle about it."""
    bodies = Bodies.named(("t",), ("pushable",))
    goal = Goal((BodyPose(0, 0.40, 0.30, 0.5),))
    *_, axes = picture_of(scene_of(1), goal, bodies)
    (arrow,) = (patch for patch in axes.patches if hasattr(patch, "get_arrowstyle"))
    start = np.array(arrow._posA_posB[0])
    from shapely import Point, Polygon

    outline = Polygon(bodies.shapes[0].placed(scene_of(1)[0]))
    assert 0.005 < outline.distance(Point(start)) < 0.03
