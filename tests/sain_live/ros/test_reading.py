"""A bag as the page plays it, against what the report page has of the same bag."""

import numpy as np
import pytest

from sain_bags.reading.reader import Bag
from sain_bags.report.content import read_content
from sain_bags.rows.episodes import read_episodes
from sain_core.errors import DatasetError
from sain_core.scene import POSE
from sain_live.ros.reading import read_recording
from tests.sain_bags.conftest import resting_scene
from tests.sain_bags.driven import Drive, Parts


def distances(chapter):
    """Return the distance from the goal [m] at the start and after each push."""
    values = [chapter.at(time).values for time in chapter.rests]
    return [one["aim"].judge(*2 * [one["scene"].disks], one["bodies"]).distance for one in values]


def test_it_has_the_episodes_pushes_and_distances_of_the_report(episode_bag):
    episodes = read_content(Bag(episode_bag)).data["episodes"]
    recording = read_recording(episode_bag)
    assert recording.name == episode_bag.parent.name
    played = read_episodes(Bag(episode_bag))
    for chapter, episode, one in zip(recording.chapters, episodes, played, strict=True):
        assert chapter.title == episode["title"]
        assert chapter.pushes == episode["counts"]["executed"]
        done = [push for push in episode["pushes"] if push["outcome"] == "executed"]
        assert np.allclose(distances(chapter)[1:], [push["distance"][1] for push in done])
        for time, push in zip(chapter.rests[1:], one.executed, strict=True):
            scene = chapter.at(time).values["scene"].disks
            assert np.allclose(scene[:, POSE], push.after[:, POSE], atol=1e-5)


@pytest.mark.parametrize("named", [1, 0])  # `goal` gives goals that name no episode
def test_goals_in_a_row_are_chapters(named, record, tmp_path):
    recording = record()
    scenes = [resting_scene(x) for x in (0.4, 0.5, 0.6)]
    recording.scene(1, 1, scenes[0])
    for goal in (1, 2):
        poses = recording.messages.poses(0.1 * (4 + goal))
        recording.add("/sain/goal", "Goal", goal_id=goal, episode_id=named, poses=poses)
        recording.push(goal, 1, scenes[goal - 1], scenes[goal], goal_id=goal)
        recording.scene(1, 1 + goal, scenes[goal])
    recording.writer.close()
    chapters = read_recording(tmp_path / "bag").chapters
    titles = ["Episode 1 · goal 1 of 2", "Episode 1 · goal 2 of 2"]
    assert [chapter.title for chapter in chapters] == titles
    assert np.allclose([distances(one) for one in chapters], [(0.1, 0.0), (0.1, 0.0)])


def test_a_message_of_no_sense_is_told_and_the_rest_is_read(record, tmp_path):
    recording = record()
    recording.scene(1, 1, resting_scene(float("nan")))
    recording.scene(1, 1, resting_scene(0.4))
    recording.writer.close()
    found = read_recording(tmp_path / "bag")
    assert len(found.chapters[0].moments) == 1
    assert "a message on /sain/scene is ignored" in found.log[0].text


def test_scenes_are_taken_from_results_where_they_were_not_recorded(record, tmp_path):
    recording = record()
    Drive(recording, Parts(scenes=False)).episode(1, [5, 6])
    recording.writer.close()
    (chapter,) = read_recording(tmp_path / "bag").chapters
    assert chapter.pushes == 2
    assert len({chapter.at(time).values["scene"].disks[1, 0] for time in chapter.rests}) == 3


def test_a_bag_without_scenes_is_refused(record, tmp_path):
    recording = record()
    recording.add("/sain/goal", "Goal", goal_id=1)
    recording.writer.close()
    with pytest.raises(
        DatasetError, match="holds no scenes that can be shown; it is no recording of the graph"
    ):
        read_recording(tmp_path / "bag")
