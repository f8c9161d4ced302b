"""Episodes are put together by ids, in whatever order their messages came."""

from collections.abc import Callable
from io import StringIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from sain_bags.cli.info import show
from sain_bags.dataset.conversion import convert
from sain_bags.dataset.rows import ConversionConfig
from sain_bags.reading.reader import Bag
from sain_bags.report.content import read_content
from sain_bags.rows.episodes import read_episodes
from sain_bags.rows.topics import namespaces
from sain_core.errors import DatasetError
from sain_core.goal import Goal
from sain_core.push import LOCATION
from sain_core.scene import make_scene
from tests.sain_bags.conftest import resting_scene
from tests.sain_bags.independent import shards


def test_pushes_carry_plan_outcome_and_prediction(episode_bag: Path) -> None:
    first, _ = read_episodes(Bag(episode_bag))
    assert first.episode_id == 2
    assert [push.push_id for push in first.pushes] == [1, 2, 3]
    last = first.pushes[-1]
    assert last.after is not None
    assert last.physics is not None
    assert last.predicted is not None
    np.testing.assert_allclose(last.physics, last.after + 0.003)
    np.testing.assert_allclose(last.predicted, last.after + 0.001)
    assert last.physics_model == "bullet_nominal"
    assert last.plan is not None
    assert last.plan.planning_time == 0.25
    np.testing.assert_allclose(last.push, [0.0, 0.3, 0.0, 0.1, 0.2])


def test_a_refused_push_is_kept_apart_even_one_of_nan(episode_bag: Path) -> None:
    first, _ = read_episodes(Bag(episode_bag))
    refused = first.pushes[1]
    assert not refused.executed
    assert refused.message == "blocked"
    assert refused.physics is None
    assert np.isnan(refused.push[LOCATION])
    assert [push.push_id for push in first.executed] == [1, 3]


def test_goal_start_end_and_success(episode_bag: Path) -> None:
    first, second = read_episodes(Bag(episode_bag))
    assert (first.goal, first.max_pushes) == (Goal.place(0.80, 0.0, 0.02), 15)
    assert first.start[1, 0] == 0.45
    assert first.distance(first.final) == pytest.approx(0.01)
    assert first.success
    assert second.distance(second.final) == pytest.approx(0.35)
    assert not second.success
    assert not second.pushes
    assert first.interval[1] < second.interval[0]


def give_goal(recording: Any, goal_id: int, x: float) -> None:
    poses = recording.messages.poses(x)
    recording.add("/sain/goal", "Goal", goal_id=goal_id, episode_id=2, poses=poses)


@pytest.fixture
def goals_in_a_row(record: Callable[..., Any]) -> Bag:
    """One episode with three goals: two are reached, the second of them given twice."""
    recording, places = record(), (0.45, 0.60, 0.79, 0.70)
    scenes = [resting_scene(x) for x in places]
    recording.scene(2, 1, scenes[0])
    for number, (goal_id, x) in enumerate(((7, 0.60), (8, 0.80), (9, 0.40)), start=1):
        give_goal(recording, goal_id, x)
        if goal_id == 8:
            give_goal(recording, goal_id, x)
        before, after = scenes[number - 1 : number + 1]
        recording.push(number, 2, before, after, goal_id=goal_id)
        recording.scene(2, number + 1, after)
    recording.writer.close()
    return Bag(recording.writer.folder)


def test_each_goal_of_a_row_has_its_own_part(goals_in_a_row: Bag) -> None:
    (episode,) = read_episodes(goals_in_a_row)
    assert len(episode.pushes) == 3 and not episode.success
    assert [part.goal.poses[0].x for part in episode.by_goal] == [0.60, 0.80, 0.40]
    assert [[push.push_id for push in part.pushes] for part in episode.by_goal] == [[1], [2], [3]]
    assert [part.success for part in episode.by_goal] == [True, True, False]
    assert episode.in_a_row == 2
    for before, after in pairwise(episode.by_goal):
        np.testing.assert_array_equal(before.final, after.start)
        assert before.interval[1] < after.interval[0]
    np.testing.assert_array_equal(episode.by_goal[0].start, episode.start)


def test_a_message_that_makes_no_sense_is_named(record: Callable[..., Any]) -> None:
    recording, scene = (
        record(),
        make_scene(np.array([[0.3, 0], [0.5, 0]]), np.ones(2), np.full(2, 0.05)),
    )
    recording.scene(1, 1, scene * np.nan)
    recording.writer.close()
    with pytest.raises(DatasetError, match="makes no sense: scene: x of disk 0 is nan"):
        read_episodes(Bag(recording.writer.folder))


def test_a_result_that_a_crashed_simulator_told_again_counts_once(
    record: Callable[..., Any],
) -> None:
    recording, start, there = record(), resting_scene(0.45), resting_scene(0.60)
    recording.scene(1, 1, start)
    for _ in range(2):
        recording.push(5, 1, start, there)
    recording.push(6, 1, there, start)
    recording.writer.close()
    (episode,) = read_episodes(Bag(recording.writer.folder))
    assert [push.push_id for push in episode.executed] == [5, 6]


ENDS = ("  reached", "goal 2: reached", "  reached", "goal 2: not reached")  # of lines of `info`
GIVEN = {1: 0.60, 2: 0.80, 4: 0.40}  # goal by the push before which it was given


@pytest.fixture(params=[True, False], ids=["planned", "by hand"])
def open_goals(record: Callable[..., Any], request: Any) -> Bag:
    """Goals that name no episode, as `goal` gives them: two, a reset, and a third."""
    recording, goal = record(), 0
    poses = recording.messages.poses
    ways = ((1, 0.45, 0.60), (1, 0.60, 0.79), (2, 0.45, 0.79), (2, 0.79, 0.60))
    for push, (episode, before, after) in enumerate(ways, start=1):
        recording.scene(episode, push, resting_scene(before))
        for _ in range(2 if push in GIVEN else 0):  # the first message of a split is a repeated one
            goal = push
            recording.add("/sain/goal", "Goal", goal_id=push, poses=poses(GIVEN[push]))
        scenes = resting_scene(before), resting_scene(after)
        recording.push(push, episode, *scenes, goal_id=goal, planned=request.param)
        recording.scene(episode, push + 1, resting_scene(after))
    recording.writer.close()
    return Bag(recording.writer.folder)


def test_each_push_is_judged_by_the_goal_that_held(open_goals: Bag, tmp_path: Path) -> None:
    parts = [part for episode in read_episodes(open_goals) for part in episode.by_goal]
    assert [part.episode_id for part in parts] == [1, 1, 2, 2]
    assert [part.goal.poses[0].x for part in parts] == [0.60, 0.80, 0.80, 0.40]
    assert [[push.push_id for push in part.pushes] for part in parts] == [[1], [2], [3], [4]]
    assert [part.success for part in parts] == [True, True, True, False]
    convert([open_goals.path], tmp_path / "out", ConversionConfig(keep_unsettled=True))
    rows = shards(tmp_path / "out")
    assert rows["goal_poses"][:, 3].tolist() == [0.60, 0.80, 0.80, 0.40]


def test_info_report_and_view_state_each_goal(open_goals: Bag) -> None:
    console = Console(width=200, file=StringIO())
    show(open_goals.path, console)
    shown = [line.rstrip() for line in console.file.getvalue().splitlines() if " mm " in line]
    for row, start, end in zip(shown, "1122", ENDS, strict=True):
        assert row.split()[0] == start and row.endswith(end)
    assert "3 of 4 goals reached" in console.file.getvalue()
    data = read_content(open_goals).data
    assert [(one["title"], one["outcome"]) for one in data["episodes"]] == [
        ("Episode 1 · goal 1 of 2", "reached"),
        ("Episode 1 · goal 2 of 2", "reached"),
        ("Episode 2 · goal 1 of 2", "reached"),
        ("Episode 2 · goal 2 of 2", "not reached"),
    ]
    assert (data["totals"]["withGoal"], data["totals"]["reached"]) == (4, 3)
    distances = [push["distance"][1] for one in data["episodes"] for push in one["pushes"]]
    np.testing.assert_allclose(distances, [0.0, 0.01, 0.01, 0.2], atol=1e-9)


def test_a_push_before_the_first_goal_belongs_to_none(record: Callable[..., Any]) -> None:
    recording, start, there = record(), resting_scene(0.45), resting_scene(0.60)
    recording.scene(1, 1, start)
    recording.push(1, 1, start, there, planned=False)
    recording.add("/sain/goal", "Goal", goal_id=1, poses=recording.messages.poses(0.45))
    recording.push(2, 1, there, start, goal_id=1)
    recording.writer.close()
    bag = Bag(recording.writer.folder)
    (episode,) = read_episodes(bag)
    assert [part.goal is None for part in episode.by_goal] == [True, False]
    assert [part.success for part in episode.by_goal] == [False, True] and episode.in_a_row == 1
    shown = read_content(bag).data["episodes"]
    assert [one["title"] for one in shown] == ["Episode 1 · no goal yet", "Episode 1"]
    assert [one["outcome"] for one in shown] == ["no goal", "reached"]


def test_several_graphs_in_one_bag_must_be_told_apart(record: Callable[..., Any]) -> None:
    recording, scene = (
        record(),
        make_scene(np.array([[0.3, 0], [0.5, 0]]), np.ones(2), np.full(2, 0.05)),
    )
    disks = recording.messages.disks(scene)
    for namespace, episode in (("/left", 1), ("/right", 2)):
        recording.add(f"{namespace}/scene", "Scene", episode_id=episode, settled=True, disks=disks)
    recording.writer.close()
    bag = Bag(recording.writer.folder)
    assert namespaces(bag) == ("/left", "/right")
    with pytest.raises(DatasetError, match="choose one of /left, /right"):
        read_episodes(bag)
    assert [episode.episode_id for episode in read_episodes(bag, "/right")] == [2]
    with pytest.raises(DatasetError, match="no graph '/up'"):
        read_episodes(bag, "/up")
