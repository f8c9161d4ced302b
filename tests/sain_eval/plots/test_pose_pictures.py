"""What a person reads in the picture of an episode towards poses, beside the episode."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.patches import Polygon

from sain_core.feasibility import Feasibility
from sain_core.goal import BodyPose, Goal
from sain_core.push import make_push, strokes
from sain_core.scene import POSITION, THETA, make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import get_shape, shape_names
from sain_core.view.figures import write_png
from sain_core.view.palette import PALETTE
from sain_core.world import PushRecord
from sain_eval.episode import EpisodeRecord
from sain_eval.plots.axes import COLOURS, DASHED
from sain_eval.plots.library_picture import draw_library, main
from sain_eval.plots.pictures import describe_result, draw_episode, draw_overview

LIMITS = Feasibility().limits


def bodies_at(*poses):
    """Return a scene of bodies with radii of 0.09 m at poses (x, y, heading)."""
    places = np.array(poses, dtype=float)
    count = len(poses)
    return make_scene(places[:, :2], np.full(count, 8.0), np.full(count, 0.09), places[:, 2])


@pytest.fixture
def record():
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
        PushRecord(
            make_push(location, 0.1, 0.1, body=body), before, after, predicted, planning_time=0.2
        )
        for body, location, before, predicted, after in zip(
            (0.0, 1.0), (1.0, -2.0), scenes, expected, scenes[1:], strict=False
        )
    )
    goal = Goal((BodyPose(0, 0.51, -0.1, 0.75, 0.02, 0.1), BodyPose(1, 0.5, 0.21, 0.02, 0.02, 0.1)))
    return EpisodeRecord(goal, pushes, scenes[0], Bodies.named(("t", "bar"), ("pushable",) * 2))


def with_edge(axes, colour):
    found = [patch for patch in axes.patches if type(patch) is Polygon]
    return [patch.get_xy()[:-1] for patch in found if to_hex(patch.get_edgecolor()) == colour]


def is_among(outline, drawn):
    return any(len(one) == len(outline) and np.allclose(one, outline) for one in drawn)


def test_the_result_in_words_has_the_heading(record):
    assert describe_result(record) == "reached in 2 pushes, 10 mm and 0.050 rad from the goal"
    short = replace(record, pushes=record.pushes[:1])
    assert describe_result(short) == "not reached in 1 push, 100 mm and 0.050 rad from the goal"
    heading = draw_episode(replace(record, title="rearrange_2 0")).get_suptitle()
    assert heading == "rearrange_2 0, tolerance 20 mm, 0.1 rad"


def test_a_heading_counts_modulo_the_symmetry(record):
    """The bar ends at pi; its goal is 0.02."""
    assert record.last.turn == pytest.approx(0.05)


def test_bodies_end_where_the_record_has_them_and_goals_are_dashed(record):
    axes = draw_episode(record).axes[0]
    for body, shape in enumerate(record.bodies.shapes):
        outline = shape.placed(record.scenes[-1][body])
        assert is_among(outline, with_edge(axes, COLOURS[body]))
        wanted = record.goal.placed(record.start)[body]
        goal = shape.placed(wanted)
        assert is_among(goal, with_edge(axes, PALETTE.goal))
    dashed = [
        patch
        for patch in axes.patches
        if type(patch) is Polygon and to_hex(patch.get_edgecolor()) == PALETTE.goal
    ]
    assert len(dashed) == 2 and all(patch.get_linestyle() in ("--", DASHED) for patch in dashed)


def test_a_heading_has_its_mark_at_the_goal_and_at_the_end(record):
    axes = draw_episode(record).axes[0]
    bearings = []
    for line in axes.lines:
        points = line.get_xydata()
        if line.get_marker() == "None" and len(points) == 2 and line.get_linewidth() == 1.6:
            way = points[1] - points[0]
            bearings.append(np.arctan2(way[1], way[0]))
    assert np.allclose(sorted(np.abs(bearings)), [0.02, 0.75, 0.8, pi])


def test_a_ghost_is_drawn_where_a_prediction_was_visibly_off(record):
    axes = draw_episode(record).axes[0]
    (ghost,) = with_edge(axes, PALETTE.predicted)
    np.testing.assert_allclose(ghost, get_shape("t").placed(record.pushes[0].predicted[0]))
    exact = replace(record.pushes[0], predicted=record.pushes[0].after)
    axes = draw_episode(replace(record, pushes=(exact, record.pushes[1]))).axes[0]
    assert with_edge(axes, PALETTE.predicted) == []


def test_arrows_begin_at_the_contact_on_the_outline_of_the_pushed_body(record):
    axes = draw_episode(record).axes[0]
    ends = [patch._posA_posB for patch in axes.patches if hasattr(patch, "_posA_posB")]
    for push, (start, end) in zip(record.pushes, ends, strict=True):
        expected, heading = strokes(push.before, push.push, LIMITS, record.bodies)
        np.testing.assert_allclose(start, expected)
        way = 0.1 * np.array([np.cos(heading), np.sin(heading)])
        np.testing.assert_allclose(np.subtract(end, start), way, atol=1e-12)


def test_distances_and_headings_of_each_body_have_their_panels(record):
    figure = draw_episode(record)
    panels = {axes.get_title("left"): axes for axes in figure.axes}
    assert {"Bodies to poses", "Headings", "Prediction error"} <= set(panels)
    distances = [
        line.get_ydata() for line in panels["Bodies to poses"].lines if len(line.get_xdata()) == 3
    ]
    np.testing.assert_allclose(distances[0], [110.0, 10.0, 10.0])
    np.testing.assert_allclose(distances[1], [np.hypot(100, 10), np.hypot(100, 10), 10.0])
    turns = [line.get_ydata() for line in panels["Headings"].lines if len(line.get_xdata()) == 3]
    np.testing.assert_allclose(turns[0], [0.25, 0.05, 0.05])
    np.testing.assert_allclose(turns[1], [0.02, 0.02, 0.02], atol=1e-9)
    (bars,) = panels["Prediction error"].containers
    np.testing.assert_allclose([bar.get_height() for bar in bars], [5.0, 0.0], atol=1e-9)


def test_the_legend_names_each_body(record):
    texts = [text.get_text() for text in draw_episode(record).legends[0].get_texts()]
    assert {"body 0", "body 1", "goal and tolerance", "start", "push"} <= set(texts)


def test_a_place_to_be_reached_by_bodies_of_any_shape(record):
    indirect = replace(record, goal=Goal.place(0.5, 0.21), bodies=Bodies.named(("t", "bar")))
    figure = draw_episode(indirect)
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"body 0", "body 1", "goal and tolerance"} <= set(texts)


@pytest.mark.parametrize("change", ["no pushes", "no headings", "fixed", "overview"])
def test_every_kind_of_episode_has_a_picture(record, change, tmp_path):
    free = tuple(replace(pose, heading=None) for pose in record.goal.poses)
    one = {
        "no pushes": replace(record, pushes=()),
        "no headings": replace(record, goal=Goal(free)),
        "fixed": replace(record, bodies=Bodies.named(("t", "bar"), ("pushable", "fixed"))),
    }.get(change, record)
    figure = draw_overview([one] * 3) if change == "overview" else draw_episode(one)
    assert write_png(figure, tmp_path / "picture.png").stat().st_size > 20_000


def test_the_library_has_each_shape_with_its_feet_and_its_name():
    figure = draw_library()
    assert [axes.get_title() for axes in figure.axes] == shape_names()
    for axes in figure.axes:
        shape = get_shape(axes.get_title())
        feet, cross = (line.get_xydata() for line in axes.lines)
        np.testing.assert_allclose(feet, shape.supports(1.0 / shape.circumradius))
        np.testing.assert_array_equal(cross, [[0.0, 0.0]])


def test_the_command_writes_the_picture_or_says_why_not(tmp_path, capsys):
    assert main([str(tmp_path / "shapes.png")]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "shapes.png")
    assert main([]) == 2 and capsys.readouterr().err.startswith("usage: python -m sain_eval")
    (tmp_path / "file").write_text("")
    assert main([str(tmp_path / "file" / "shapes.png")]) == 1
    assert capsys.readouterr().err.startswith("library_picture: cannot")
