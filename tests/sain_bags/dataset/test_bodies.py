"""Recordings of bodies that are no disks, and recordings from before there were such."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sain_bags.dataset.conversion import convert
from sain_bags.dataset.formats.stored_rows import goal_distance, reached
from sain_bags.dataset.rows import ConversionConfig
from sain_bags.reading.reader import Bag
from sain_bags.report.content import read_content
from sain_bags.rows.episodes import read_episodes
from sain_core.errors import DatasetError
from sain_core.push import BODY, make_push
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import get_shape
from sain_core.transitions import Column, row_bodies
from sain_model.physics.planar import PlanarPrior
from tests.sain_bags.dataset.conftest import read_npz

POSE = (0.52, 0.01, 0.3)
KEPT = ConversionConfig(keep_unsettled=True)


def scene(x: float, heading: float) -> np.ndarray:
    """A T and a disk that nothing moves."""
    places = np.array([(x, 0.0), (0.62, 0.25)])
    return make_scene(places, np.full(2, 8.0), np.array([0.09, 0.05]), np.array([heading, 0.0]))


def add_bodies(recording: Any, episode: int, names: tuple[str, ...] = ("t", "disk")) -> None:
    make = recording.messages.make
    bodies = []
    for name, radius, role in zip(names, (0.09, 0.05), ("pushable", "fixed"), strict=True):
        parts = []
        for part in get_shape(name).parts(radius):
            points = [make("geometry_msgs/msg/Point32", x=x, y=y, z=0.0) for x, y in part.tolist()]
            polygon = make("geometry_msgs/msg/Polygon", points=points)
            kind = {"type": 5, "dimensions": np.array([0.04]), "polygon": polygon}
            if name == "disk":
                kind = {"type": 3, "dimensions": np.array([0.04, radius])}
            parts.append(make("shape_msgs/msg/SolidPrimitive", **kind))
        feet = [
            make("geometry_msgs/msg/Point", x=x, y=y, z=0.0)
            for x, y in get_shape(name).supports(radius).tolist()
        ]
        about = {"name": name, "role": role, "radius": radius, "parts": parts, "supports": feet}
        bodies.append(make("sain_interfaces/msg/Body", **about))
    recording.add("/sain/shapes", "Bodies", episode_id=episode, bodies=bodies)


def add_pose_goal(recording: Any, goal_id: int, episode: int, **keep: Any) -> None:
    x, y, heading = POSE
    turn = {"heading": heading, "has_heading": True, "heading_tolerance": 0.1}
    about = {"poses": recording.messages.poses(x, y, body=0, **turn), **keep}
    recording.add("/sain/goal", "Goal", goal_id=goal_id, episode_id=episode, **about)


STATES = (scene(0.45, 0.0), scene(0.48, 0.1), scene(0.515, 0.35))


@pytest.fixture
def shaped_bag(record: Callable[..., Any], tmp_path: Path) -> Path:
    recording = record("shaped")
    add_bodies(recording, 2)
    recording.scene(2, 1, STATES[0])
    add_pose_goal(recording, 77, 2)
    for number in (1, 2):
        recording.push(number, 2, STATES[number - 1], STATES[number])
    recording.writer.close()
    return tmp_path / "shaped"


def test_rows_have_shapes_roles_body_and_poses(shaped_bag: Path, tmp_path: Path) -> None:
    convert([shaped_bag], tmp_path / "npz", KEPT)
    rows = read_npz(tmp_path / "npz")
    assert row_bodies(rows) == [Bodies.named(["t", "disk"], ["pushable", "fixed"])] * 2
    assert rows[Column.ACTION][:, BODY].tolist() == [0, 0]
    np.testing.assert_array_equal(rows[Column.GOAL_POSES][0], [*POSE, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(rows[Column.GOAL_TOLERANCES][0], [0.02, 0.1, np.nan, np.nan])
    np.testing.assert_allclose(goal_distance(rows), np.hypot([0.04, 0.005], 0.01))
    assert reached(rows).tolist() == [False, True]
    card = json.loads((tmp_path / "npz" / "card.json").read_text())
    assert card["shapes"] == {"t,disk": 2}
    assert card["roles"] == {"pushable,fixed": 2}


def keeping_bag(record: Callable[..., Any], moved: float, **keep: Any) -> Bag:
    """A push brings the T to its pose and moves the disk beside it, which is to be kept."""
    recording = record(f"keeping{moved}{len(keep)}")
    add_bodies(recording, 2)
    recording.scene(2, 1, STATES[1])
    add_pose_goal(recording, 77, 2, **keep)
    after = STATES[2].copy()
    after[1, 0] += moved
    recording.push(1, 2, STATES[1], after)
    recording.writer.close()
    return Bag(recording.writer.folder)


def test_bodies_to_be_kept_are_in_rows_page_and_result(
    record: Callable[..., Any], tmp_path: Path
) -> None:
    keep = {"keep": np.array([1], np.uint32), "keep_tolerance": 0.01}
    for moved, success in ((0.009, True), (0.011, False)):
        bag = keeping_bag(record, moved, **keep)
        (episode,) = read_episodes(bag)
        assert episode.success is success
        assert (episode.goal.keep, episode.goal.keep_tolerance) == ((1,), 0.01)
        (shown,) = read_content(bag).data["episodes"]
        assert shown["keep"] == [{"body": 1, "tolerance": 0.01, "moved": pytest.approx(moved)}]
        assert shown["outcome"] == ("reached" if success else "not reached")
    convert([bag.path], tmp_path / "npz", KEPT)
    rows = read_npz(tmp_path / "npz")
    np.testing.assert_array_equal(rows[Column.GOAL_KEEP][0], [np.nan, 0.01])
    import pyarrow.parquet

    convert([bag.path], tmp_path / "parquet", replace(KEPT, format="parquet"))
    table = pyarrow.parquet.read_table(next((tmp_path / "parquet").glob("*.parquet"))).to_pydict()
    assert table["goal_keep"][0][1] == 0.01


def test_a_push_without_a_prediction_is_predicted_with_its_shape(
    record: Callable[..., Any], tmp_path: Path
) -> None:
    recording = record("bare")
    add_bodies(recording, 2)
    make, disks = recording.messages.make, recording.messages.disks
    push = make("sain_interfaces/msg/Push", push_id=1, location=0.7, length=0.06, episode_id=2)
    before, after = (make("sain_interfaces/msg/Scene", disks=disks(s)) for s in STATES[:2])
    before.settled = after.settled = True
    recording.add(
        "/sain/push_result", "PushResult",
        push_id=1, episode_id=2, error_code=1, push=push, before=before, after=after,
    )  # fmt: skip
    recording.writer.close()
    convert([tmp_path / "bare"], tmp_path / "npz")
    rows = read_npz(tmp_path / "npz")
    prior = PlanarPrior().with_bodies(row_bodies(rows)[0])
    expected = prior.step(STATES[0][None], make_push(0.7, 0.0, 0.06)[None])
    np.testing.assert_array_equal(rows[Column.PHYSICS_NEXT], expected.reshape(1, -1))
    assert np.abs(expected[0] - STATES[0]).max() > 0.01


def test_shapes_that_change_within_an_episode_are_named(
    record: Callable[..., Any], tmp_path: Path
) -> None:
    recording = record("torn")
    add_bodies(recording, 2)
    add_bodies(recording, 2, ("l", "disk"))
    recording.push(1, 2, *STATES[:2])
    recording.writer.close()
    with pytest.raises(DatasetError, match=r"episode 2 change within it: first t, .*, then l"):
        convert([tmp_path / "torn"], tmp_path / "npz")


def test_episodes_and_the_page_have_bodies_and_poses(shaped_bag: Path) -> None:
    (episode,) = read_episodes(Bag(shaped_bag))
    assert episode.success
    judged = episode.judge(episode.final)
    assert judged.distances == pytest.approx([np.hypot(0.005, 0.01)])
    assert judged.turns == pytest.approx([0.05])
    content = read_content(Bag(shaped_bag)).data
    (shown,) = content["episodes"]
    assert [disk["name"] for disk in shown["disks"]] == ["t", "disk"]
    assert shown["disks"][1]["role"] == "fixed"
    np.testing.assert_allclose(
        shown["disks"][0]["outline"], get_shape("t").outline(0.09), atol=1e-5
    )
    assert shown["poses"] == [{"body": 0, "x": 0.52, "y": 0.01}]
    assert [push["body"] for push in shown["pushes"]] == [0, 0]
    assert shown["pushes"][0]["moved"] == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("poses", "said"),
    [
        ({"x": float("nan")}, "x of the goal of body 1 is nan; it must be finite"),
        ({"x": 0.5, "tolerance": -1.0}, "tolerance of body 1 is -1.0 m; allowed: above 0"),
        ({"x": 0.5, "body": 40}, "a goal is given for body 40; at most 32"),
        (None, "the goal has no poses; give one or more"),
    ],
)
def test_pushes_towards_a_goal_that_cannot_be_are_left_out(
    poses: dict[str, Any] | None, said: str, record: Callable[..., Any], tmp_path: Path
) -> None:
    recording = record("bag")
    asked = recording.messages.poses(**poses) if poses else []
    for episode, goal in ((1, recording.messages.poses(0.5)), (2, asked)):
        recording.add("/sain/goal", "Goal", goal_id=episode, episode_id=episode, poses=goal)
        recording.push(episode, episode, *STATES[:2])
    recording.writer.close()
    done = convert([tmp_path / "bag"], tmp_path / "npz", KEPT)
    assert (done.transitions, done.dropped) == (1, {"makes no sense": 1})
    assert said in done.left_out[0]


def test_bodies_that_come_after_the_first_push_hold_for_the_episode(
    record: Callable[..., Any], tmp_path: Path
) -> None:
    recording = record("bag")
    recording.push(1, 1, *STATES[:2])
    recording.push(2, 2, *STATES[:2])
    add_bodies(recording, 2)
    recording.push(3, 2, *STATES[1:])
    recording.push(4, 3, *STATES[:2])
    recording.writer.close()
    convert([tmp_path / "bag"], tmp_path / "npz", KEPT)
    shapes = read_npz(tmp_path / "npz")[Column.SHAPES].tolist()
    assert shapes == ["disk,disk", "t,disk", "t,disk", "disk,disk"]


def test_a_goal_of_the_target_is_for_the_only_body(
    record: Callable[..., Any], tmp_path: Path
) -> None:
    recording = record("bag")
    poses = recording.messages.poses(0.5, 0.1)
    recording.add("/sain/goal", "Goal", goal_id=1, episode_id=1, poses=poses)
    recording.push(1, 1, *(state[1:] for state in STATES[:2]))
    recording.writer.close()
    convert([tmp_path / "bag"], tmp_path / "npz", KEPT)
    rows = read_npz(tmp_path / "npz")
    np.testing.assert_array_equal(rows[Column.GOAL_POSES], [[0.5, 0.1, np.nan]])
