"""What an episode says about itself, and its picture."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.drawing.figures import write_png
from sain_core.errors import OutputError
from sain_core.scene import POSITION, TARGET, VX
from sain_eval.plots.pictures import describe_result, draw_episode


def test_it_knows_when_each_tolerance_was_met(episode):
    assert episode.pushes_to(0.05) == 1
    assert episode.pushes_to(0.02) == 2
    assert episode.pushes_to(0.005) is None
    assert episode.final_distance == pytest.approx(0.008)


def test_a_scene_that_moves_or_lost_a_disk_meets_nothing(episode):
    moving = episode.pushes[-1].after.copy()
    moving[TARGET, VX] = 0.1
    lost = episode.pushes[-1].after.copy()
    lost[0, POSITION] = [0.5, 0.9]
    for after in (moving, lost):
        last = replace(episode.pushes[-1], after=after)
        assert replace(episode, pushes=(episode.pushes[0], last)).pushes_to(0.02) is None


def test_prediction_errors_are_distances(episode):
    assert episode.pushes[0].target_error == pytest.approx(0.005)
    assert episode.pushes[0].mid_error == pytest.approx(0.0)
    assert replace(episode.pushes[0], predicted=None).target_error is None


def test_an_episode_without_pushes_needs_its_start(episode):
    empty = replace(episode, pushes=(), start=episode.scenes[0])
    assert len(empty.scenes) == 1
    with pytest.raises(ValueError, match="needs its start"):
        _ = replace(empty, start=None).scenes


def test_the_result_in_words(episode):
    assert describe_result(episode) == "reached within 2 cm in 2 pushes, 8.0 mm from the goal"
    short = replace(episode, pushes=episode.pushes[:1])
    assert describe_result(short) == "not within 2 cm after 1 push: 40 mm from the goal"


@pytest.mark.parametrize("change", ["as is", "cube", "no pushes", "no prediction", "physics"])
def test_every_kind_of_episode_has_a_picture(episode, change, tmp_path):
    pushes = {
        "no pushes": (),
        "no prediction": tuple(replace(push, predicted=None) for push in episode.pushes),
        "physics": tuple(replace(push, physics=push.before) for push in episode.pushes),
    }.get(change, episode.pushes)
    shapes = ("disk", "cube") if change == "cube" else ()
    record = replace(episode, pushes=pushes, start=episode.scenes[0], shapes=shapes)
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
