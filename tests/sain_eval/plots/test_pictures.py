"""What a person reads in the picture of an episode, beside the episode."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from sain_core.errors import OutputError
from sain_core.feasibility import Feasibility
from sain_core.push import tool_end, tool_start
from sain_core.scene import POSITION, RADIUS, TARGET
from sain_core.shapes.bodies import Bodies
from sain_core.view.figures import write_png
from sain_core.view.palette import PALETTE
from sain_eval.plots.axes import MARKS
from sain_eval.plots.pictures import describe_result, draw_episode, draw_overview


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def panel(figure: Figure, title: str):
    (found,) = [axes for axes in figure.axes if axes.get_title("left") == title]
    return found


def test_the_result_in_words(episode):
    assert describe_result(episode) == "reached in 2 pushes, 8.0 mm from the goal"
    short = replace(episode, pushes=episode.pushes[:1])
    assert describe_result(short) == "not reached in 1 push, 40 mm from the goal"


@pytest.mark.parametrize("change", ["as is", "cube", "no pushes", "no prediction", "physics"])
def test_every_kind_of_episode_has_a_picture(episode, change, tmp_path):
    pushes = {
        "no pushes": (),
        "no prediction": tuple(replace(push, predicted=None) for push in episode.pushes),
        "physics": tuple(replace(push, physics=push.before) for push in episode.pushes),
    }.get(change, episode.pushes)
    shapes = ("disk", "cube" if change == "cube" else "disk")
    record = replace(episode, pushes=pushes, start=episode.scenes[0], bodies=Bodies.named(shapes))
    path = write_png(draw_episode(record, "A title"), tmp_path / "episode.png")
    assert path.read_bytes().startswith(b"\x89PNG")
    assert path.stat().st_size > 20_000
    assert [file.name for file in tmp_path.iterdir()] == ["episode.png"]


def test_the_same_episode_gives_the_same_picture(episode, tmp_path):
    paths = [write_png(draw_episode(episode), tmp_path / f"{i}.png") for i in range(2)]
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_prediction_shows_in_the_picture(episode):
    axes = draw_episode(episode).axes[0]
    marks = [line for line in axes.lines if line.get_marker() == "D"]
    np.testing.assert_allclose(marks[0].get_xydata()[0], [0.663, 0.004])


def test_a_picture_that_cannot_be_written_is_an_error(episode, tmp_path):
    (tmp_path / "file").write_text("not a folder")
    with pytest.raises(OutputError, match="file"):
        write_png(draw_episode(episode), tmp_path / "file" / "episode.png")


def test_the_heading_says_how_it_ended(episode):
    figure = draw_episode(replace(episode, title="paper 4"))
    assert figure.get_suptitle() == "paper 4, tolerance 20 mm"
    assert figure.axes[0].get_title("left") == describe_result(episode)
    missed = draw_episode(replace(episode, goal=episode.goal.within(0.005, 1.0)))
    colours = [f.axes[0].title.axes._left_title.get_color() for f in (figure, missed)]
    assert colours == [PALETTE.success, PALETTE.alarm]


def test_every_axis_has_a_name_and_a_unit(episode):
    figure = draw_episode(episode)
    labels = [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]
    assert labels == [
        ("x [m]", "y [m]"),
        ("pushes", "distance [mm]"),
        ("x [mm]", "y [mm]"),
        ("push", "of body 1 [mm]"),
    ]


def test_the_legend_names_all_that_is_drawn_in_the_order_of_the_page(episode):
    physics = tuple(replace(push, physics=push.before) for push in episode.pushes)
    names = legend(draw_episode(replace(episode, pushes=physics)))
    assert names == [
        "table", "reachable area", "body 0", "body 1", "start", "goal and tolerance", "push",
        "predicted by physics", "predicted by the planner",
    ]  # fmt: skip
    assert names == [name for name in MARKS if name in names]
    assert "predicted by physics" not in legend(draw_episode(episode))
    still = replace(episode, pushes=(), start=episode.scenes[0])
    assert {"push", "predicted by the planner"}.isdisjoint(legend(draw_episode(still)))


def test_numbers_stand_where_the_tool_begins_and_arrows_where_it_ends(episode):
    axes, limits = draw_episode(episode).axes[0], Feasibility().limits
    badges = {text.get_text(): text.get_position() for text in axes.texts}
    assert set(badges) == {"arm", "1", "2"}
    ends = [patch._posA_posB for patch in axes.patches if hasattr(patch, "_posA_posB")]
    for number, (push, arrow) in enumerate(zip(episode.pushes, ends, strict=True), start=1):
        start = tool_start(push.before, push.push, limits)
        assert np.hypot(*(badges[str(number)] - start)) < 0.005
        np.testing.assert_allclose(arrow, [start, tool_end(push.before, push.push, limits)])


@pytest.mark.parametrize(("shape", "kind"), [("disk", Circle), ("cube", Polygon)])
def test_the_target_ends_where_the_record_has_it(episode, shape, kind):
    axes = draw_episode(replace(episode, bodies=Bodies.named(("disk", shape)))).axes[0]
    final = episode.scenes[-1][TARGET]
    (patch,) = [
        patch
        for patch in axes.patches
        if isinstance(patch, kind)
        and to_hex(patch.get_edgecolor()) == PALETTE.target
        and patch.get_linewidth() == 1.8
    ]
    box = patch.get_path().transformed(patch.get_patch_transform()).get_extents()
    centre, size = (box.min + box.max) / 2, box.max - box.min
    np.testing.assert_allclose(centre, final[POSITION], atol=1e-6)
    np.testing.assert_allclose(size, 2 * final[RADIUS], rtol=2e-3)


def test_bars_are_the_errors_physics_first(episode):
    pushes = tuple(replace(push, physics=push.before) for push in episode.pushes)
    axes = panel(draw_episode(replace(episode, pushes=pushes)), "Prediction error")
    physics, planner = axes.containers
    np.testing.assert_allclose([bar.get_height() for bar in physics], [160.0, 32.0])
    np.testing.assert_allclose([bar.get_height() for bar in planner], [5.0, 0.0], atol=1e-9)
    for bars, colour in ((physics, PALETTE.physics), (planner, PALETTE.predicted)):
        assert {to_hex(bar.get_facecolor()) for bar in bars} == {colour}
    for left, right in zip(physics, planner, strict=True):
        assert left.get_x() < right.get_x()


def test_distances_are_those_after_each_push(episode):
    (line, *_) = [
        line
        for line in panel(draw_episode(episode), "Bodies to poses").lines
        if line.get_color() == PALETTE.target
    ]
    np.testing.assert_allclose(line.get_ydata(), [200.0, 40.0, 8.0])
    np.testing.assert_allclose(line.get_xdata(), [0, 1, 2])


def test_nothing_is_cut_off_and_no_text_lies_on_another(episode):
    long = replace(episode, title="clutter_cube, scene 12, sain_history")
    named = replace(episode, title="clutter_cube 12", goal=episode.goal.within(0.005, 1.0))
    for figure in (draw_episode(long), draw_overview([named] * 4), draw_overview([named] * 3)):
        figure.canvas.draw()
        width, height = figure.canvas.get_width_height()
        for axes in figure.axes:
            texts = [axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label, *axes.texts]
            for text in texts:
                box = text.get_window_extent()
                assert box.x0 >= -1 and box.y0 >= -1, text
                assert box.x1 <= width + 1 and box.y1 <= height + 1, text
        heads = [text for axes in figure.axes for text in axes.texts if len(text.get_text()) > 3]
        boxes = [text.get_window_extent() for text in heads]
        for place, box in enumerate(boxes):
            assert not box.count_overlaps(boxes[:place]), heads[place]


def test_letters_are_legible_on_a_phone(episode):
    """A phone shows a picture 390 pixels wide; 7 of them are the least for a letter's height."""
    for figure in (draw_episode(episode), draw_overview([episode] * 4)):
        pixels = 390 / figure.get_figwidth() / 72
        texts = [text for axes in figure.axes for text in axes.texts if len(text.get_text()) > 3]
        texts += [*figure.legends[0].get_texts(), *(axes.xaxis.label for axes in figure.axes)]
        assert min(text.get_fontsize() for text in texts) * pixels >= 6.5


def test_the_overview_has_each_episode_with_its_result(episode):
    records = [replace(episode, title=f"paper {seed}") for seed in range(3)]
    figure = draw_overview(records)
    assert len(figure.axes) == 3
    for axes, record in zip(figure.axes, records, strict=True):
        texts = [text.get_text() for text in axes.texts]
        assert f"{record.title}, tolerance 20 mm" in texts and describe_result(record) in texts
    assert legend(figure)[:2] == ["table", "reachable area"]
