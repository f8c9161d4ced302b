from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sain_core.errors import DatasetError
from sain_core.push import SPEED, START_X, TIP_RADIUS, PushLimits, as_strokes
from sain_core.scene import Y
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_model.data.dataset import load_dataset, split_by_episode
from sain_model.data.examples import inferred_values
from sain_model.data.recordings import load_recording
from sain_model.data.windows import make_windows
from sain_model.inference.kinds import friction_kind
from sain_model.physics.planar import PlanarPrior


def test_all_shards_are_read_in_order(dataset: Path) -> None:
    data = load_dataset(dataset)
    assert len(data) == 120
    assert data.alike.state.shape == (120, 2, 8)
    assert (np.diff(data.episode) >= 0).all()
    one = load_dataset(dataset / "shard-0.npz")
    np.testing.assert_array_equal(one.alike.action, data.alike.action[:60])
    assert one.sha256 != data.sha256 == load_dataset(dataset).sha256


def test_no_episode_is_in_two_parts(dataset: Path) -> None:
    data = load_dataset(dataset)
    split = split_by_episode(data, seed=5, validation=0.2, test=0.3)
    parts = [set(part.episode.tolist()) for part in (split.train, split.validation, split.test)]
    assert [len(part) for part in parts] == [10, 4, 6]
    assert set.union(*parts) == set(range(20))
    assert sum(len(part) for part in (split.train, split.validation, split.test)) == len(data)
    again = split_by_episode(data, seed=5, validation=0.2, test=0.3)
    np.testing.assert_array_equal(again.test.episode, split.test.episode)
    other = split_by_episode(data, seed=6, validation=0.2, test=0.3)
    assert set(other.test.episode.tolist()) != parts[2]


def test_too_few_episodes_cannot_be_split(dataset: Path) -> None:
    data = load_dataset(dataset)
    with pytest.raises(DatasetError, match="2 episodes are too few"):
        split_by_episode(data.select(data.episode < 2), 0, 0.1, 0.1)


def test_the_mirror_of_a_mirror_is_the_data(dataset: Path) -> None:
    data = load_dataset(dataset).alike
    twice = data.mirrored().mirrored()
    np.testing.assert_allclose(twice.state, data.state, atol=1e-12)
    np.testing.assert_allclose(twice.action, data.action, atol=1e-12)
    np.testing.assert_array_equal(data.mirrored().next_state[..., Y], -data.next_state[..., Y])


@pytest.mark.parametrize(
    ("key", "change", "message"),
    [
        ("state", None, "lacks state"),
        (
            "action",
            lambda a: a[:, :2],
            r"action cannot be: a push has 5 numbers .* not shape \(60, 2\)",
        ),
        ("next_state", lambda a: a[:-1], r"next_state has shape \(59, 16\)"),
        (
            "state",
            lambda a: np.where(np.arange(60)[:, None] == 7, np.inf, a),
            "row 7 of state holds NaN or Inf",
        ),
        (
            "state",
            lambda a: -a,
            r"row 0 of state has a mass or radius of -\S+; it must be positive",
        ),
        ("next_state", lambda a: -a, "row 0 of next_state has a mass or radius of"),
        (
            "masses",
            lambda a: np.full((60, 2), -0.5),
            "row 0 of masses has the value -0.5; it must be positive",
        ),
        ("state", lambda a: a + 1j, "state is complex128; it should be real numbers"),
        ("action", lambda a: a.astype(str), "action is <U.*; it should be real numbers"),
        ("physics_next", lambda a: a > 0, "physics_next is bool; it should be real numbers"),
        ("moved", lambda a: np.zeros(60), "moved is float64; it should be true or false"),
        ("shapes", lambda a: np.zeros(60), "shapes is float64; it should be text"),
        ("roles", lambda a: np.array("movable"), r"roles has shape \(\); it should have 60 rows"),
        ("roles", lambda a: np.full(60, "king,movable"), "bad.npz: the bodies 'disk,disk' cannot"),
        ("episode", lambda a: a.astype(float), "episode is float64"),
        (
            "physics_next",
            lambda a: a[:, :8],
            r"physics_next has shape \(60, 8\); it should be \(60, 16\)",
        ),
        ("friction", lambda a: a[:5], r"friction has shape \(5,\)"),
    ],
)
def test_a_damaged_shard_is_refused(
    dataset: Path, tmp_path: Path, key: str, change: object, message: str
) -> None:
    with np.load(dataset / "shard-0.npz") as shard:
        arrays = dict(shard)
    arrays[key] = change(arrays.get(key)) if change else None  # type: ignore[operator]
    path = tmp_path / "bad.npz"
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    with pytest.raises(DatasetError, match=message) as caught:
        load_dataset(path)
    assert str(path) in str(caught.value)


def test_what_is_no_shard_is_refused(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="holds no shards"):
        load_dataset(tmp_path)
    with pytest.raises(DatasetError, match="does not exist"):
        load_dataset(tmp_path / "none.npz")
    cut = tmp_path / "cut.npz"
    cut.write_bytes((dataset / "shard-0.npz").read_bytes()[:2000])
    with pytest.raises(DatasetError, match="is not a whole"):
        load_dataset(cut)
    cut.write_text("hello")
    with pytest.raises(DatasetError, match="is not a whole"):
        load_dataset(cut)


def test_shards_with_other_numbers_of_disks_do_not_mix(dataset: Path, tmp_path: Path) -> None:
    with np.load(dataset / "shard-0.npz") as shard:
        arrays = dict(shard)
    np.savez(tmp_path / "a.npz", **arrays)
    for key in ("state", "next_state", "physics_next", "floor_next"):
        arrays[key] = np.hstack([arrays[key], arrays[key][:, 8:]])
    np.savez(tmp_path / "b.npz", **arrays)
    with pytest.raises(DatasetError, match="scenes with the same bodies are needed"):
        _ = load_dataset(tmp_path).alike


def test_the_order_of_an_episode_is_that_of_its_steps(dataset: Path, tmp_path: Path) -> None:
    arrays = dict(np.load(dataset / "shard-0.npz"))
    count = len(arrays["episode"])
    np.savez(tmp_path / "a.npz", **arrays)
    np.testing.assert_array_equal(load_dataset(tmp_path / "a.npz").alike.step, np.arange(count))
    steps = np.arange(count)[::-1] % 6
    np.savez(tmp_path / "b.npz", **arrays, step=steps)
    np.testing.assert_array_equal(load_dataset(tmp_path / "b.npz").alike.step, steps)
    np.savez(tmp_path / "c.npz", **arrays, step=steps // 2)
    with pytest.raises(DatasetError, match="episode 0 has two pushes with step"):
        load_dataset(tmp_path / "c.npz")


def test_what_is_believed_of_the_physics_is_given_for_each_push(dataset: Path) -> None:
    part = load_dataset(dataset).parts[0]
    friction = np.linspace(0.1, 0.2, len(part))
    believed = replace(part, given={"friction": friction}).select(np.array([3, 1]))
    np.testing.assert_array_equal(believed.given["friction"], friction[[3, 1]])
    np.testing.assert_array_equal(believed.observed.given["friction"], friction[[3, 1]])
    kind = friction_kind(PlanarPrior())
    np.testing.assert_array_equal(inferred_values(believed, kind)["friction"], friction[[3, 1]])
    assert part.select(np.array([3, 1])).given is None


def test_rows_name_their_bodies(dataset: Path, tmp_path: Path) -> None:
    arrays = dict(np.load(dataset / "shard-0.npz"))
    shapes, rows = np.array(["t,disk"] * 60), tmp_path / "shard-0.npz"
    np.savez(rows, **arrays, shapes=shapes)  # roles are optional
    assert load_dataset(rows).alike.bodies == Bodies.named(["t", "disk"], ["pushable", "movable"])
    np.savez(rows, **arrays, shapes=shapes, roles=np.array(["pushable,pushable"] * 60))
    assert load_dataset(rows).alike.bodies == Bodies.named(["t", "disk"], ["pushable", "pushable"])


def as_stroke_rows(dataset: Path, shard: str) -> dict[str, np.ndarray]:
    """Return the arrays of a shard with its pushes as strokes, of other episodes."""
    with np.load(dataset / shard) as arrays:
        rows = dict(arrays)
    scenes = rows["state"].reshape(len(rows["state"]), 2, 8)
    rows["action"] = as_strokes(scenes, rows["action"], PushLimits())
    rows["episode"] = rows["episode"] + 100
    return rows


def test_strokes_are_a_part_of_their_own(dataset: Path, tmp_path: Path) -> None:
    rows = as_stroke_rows(dataset, "shard-0.npz")
    np.savez(tmp_path / "shard-0.npz", **rows)
    data = load_dataset(tmp_path).alike
    assert data.action.shape == (60, 8)
    np.testing.assert_allclose(data.mirrored().mirrored().action, data.action, atol=1e-12)
    windows = make_windows(data, 3)
    np.testing.assert_array_equal(windows.pushes[:, 0], data.action)
    assert windows.pushes.shape == (60, 3, 8) and (windows.pushes[~windows.known, 3] == 0.0).all()
    assert load_recording(tmp_path)[0].action.shape == (60, 8)
    both = load_dataset(dataset, tmp_path)
    assert [part.action.shape for part in both.parts] == [(120, 5), (60, 8)]
    assert len(split_by_episode(both, 0, 0.1, 0.1).train) > 100
    with pytest.raises(DatasetError, match=r"disk, disk as pushes and as strokes; give one folder"):
        both.alike  # noqa: B018
    history = PushHistory(data.state[:2], data.action[:2], data.next_state[:2])
    assert len(history.then(data.state[2], data.action[2], data.next_state[2])) == 3


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        (SPEED, 5.0, r"speed of push \(3,\) is 5.0; allowed: 0.001 to 2"),
        (TIP_RADIUS, -0.1, r"tip_radius of push \(3,\) is -0.1; allowed: 0.001 to 0.05"),
        (START_X, np.inf, "row 3 of action holds NaN or Inf"),
    ],
)
def test_a_stroke_that_cannot_be_is_refused(
    dataset: Path, tmp_path: Path, column: int, value: float, message: str
) -> None:
    rows = as_stroke_rows(dataset, "shard-0.npz")
    rows["action"][3, column] = value
    np.savez(tmp_path / "shard-0.npz", **rows)
    with pytest.raises(DatasetError, match=message):
        load_dataset(tmp_path)
