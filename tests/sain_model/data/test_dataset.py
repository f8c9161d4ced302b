# ruff: noqa: E501 - a case is a line
"""Data sets: read, checked, mixed, split by episode, and cut into windows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from sain_core.errors import DatasetError
from sain_core.scene import STATE_SIZE, X, Y
from sain_model.commands import evaluate, train
from sain_model.data.dataset import Dataset, Part, load_dataset, make_windows, split_by_episode
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.training.objectives import make_examples
from tests.sain_model.rolling import EPISODES, EVERY, PUSHES, load_episodes, whole_windows


def test_all_shards_are_read_in_order(dataset):
    data = load_dataset(dataset)
    assert len(data) == 120
    assert data.alike.state.shape == (120, 2, 8)
    assert (np.diff(data.episode) >= 0).all()
    one = load_dataset(dataset / "shard-0.npz")
    np.testing.assert_array_equal(one.alike.action, data.alike.action[:60])
    assert one.sha256 != data.sha256 == load_dataset(dataset).sha256


def in_grams(scenes: np.ndarray) -> np.ndarray:
    return scenes * np.tile([1, 1, 1, 1, 1, 1, 1000, 1], 2)


@pytest.mark.parametrize(
    ("key", "change", "message"),
    [
        ("state", None, "lacks state"),
        ("action", lambda a: a[:, :2], r"action cannot be: a push has 5 numbers .* not shape \(60, 2\)"),
        ("next_state", lambda a: a[:-1], r"next_state has shape \(59, 16\)"),
        ("state", lambda a: np.where(np.arange(60)[:, None] == 7, np.inf, a), "row 7 of state holds NaN or Inf"),
        ("state", lambda a: -a, r"row 0 of state has a mass or radius of -\S+; it must be positive"),
        ("state", lambda a: 1e3 * a, r"row 0 of state: x of body \d is \S+; allowed: -10 to 10; len"),
        ("state", in_grams, r"mass of body 0 is \d{4}\S*; allowed: 0.0001 to 100; .* kg"),
        (
            "next_state",
            lambda a: a * np.tile([1, 1, 1, 1, 1, 1, 1, 1.2], 2),
            "row 0: radius of body 0 differs by 20.0 % between state and next_state; allowed: 5 %",
        ),
        ("next_state", lambda a: -a, "row 0 of next_state has a mass or radius of"),
        ("masses", lambda a: np.full((60, 2), -0.5), "row 0 of masses has the value -0.5; it must be positive"),
        ("state", lambda a: a + 1j, "state is complex128; it should be real numbers"),
        ("action", lambda a: a.astype(str), "action is <U.*; it should be real numbers"),
        ("physics_next", lambda a: a > 0, "physics_next is bool; it should be real numbers"),
        ("moved", lambda a: np.zeros(60), "moved is float64; it should be true or false"),
        ("shapes", lambda a: np.zeros(60), "shapes is float64; it should be text"),
        ("roles", lambda a: np.array("movable"), r"roles has shape \(\); it should have 60 rows"),
        ("roles", lambda a: np.full(60, "king,movable"), "bad.npz: the bodies 'disk,disk' cannot"),
        ("episode", lambda a: a.astype(float), "episode is float64"),
        ("physics_next", lambda a: a[:, :8], r"physics_next has shape \(60, 8\); it should be \(60, 16\)"),
        ("friction", lambda a: a[:5], r"friction has shape \(5,\)"),
        ("action", lambda a: np.add(a, [7, 0, 0, 0, 0]), "row 0 pushes body 7; pushable are 0"),
    ],
)  # fmt: skip
def test_a_damaged_shard_is_refused(dataset, tmp_path, key, change, message):
    with np.load(dataset / "shard-0.npz") as shard:
        arrays = dict(shard)
    arrays[key] = change(arrays.get(key)) if change else None  # type: ignore[operator]
    path = tmp_path / "bad.npz"
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    with pytest.raises(DatasetError, match=message) as caught:
        load_dataset(path)
    assert str(path) in str(caught.value)


def test_what_is_no_shard_is_refused(dataset, tmp_path):
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


FAR = 0.45  # [m]


def with_more_disks(shard: Path, more: int, to: Path, shift: float = 0.0) -> Path:
    """Write a shard whose scenes have further disks, far off; its pushes start elsewhere."""
    with np.load(shard) as arrays:
        content = dict(arrays)
    count = len(content["action"])
    for key in ("state", "next_state", "physics_next", "floor_next"):
        scenes = content[key].reshape(count, -1, STATE_SIZE)
        scenes[..., X] += shift
        further = [scenes[:, 1].copy() for _ in range(more)]
        for place, disk in enumerate(further):
            disk[:, [X, Y]] = (0.3 + shift, FAR - 0.15 * place)
        content[key] = np.stack([*scenes.transpose(1, 0, 2), *further], axis=1).reshape(count, -1)
    to.parent.mkdir(exist_ok=True)
    np.savez(to, **content)
    return to


@pytest.fixture(scope="module")
def folders(dataset, tmp_path_factory):
    """Data with 2 disks, with 4, and with 2 again but other pushes."""
    root = tmp_path_factory.mktemp("mixed")
    shard = dataset / "shard-0.npz"
    with_more_disks(shard, 2, root / "four" / "a.npz")
    with_more_disks(shard, 0, root / "again" / "a.npz", shift=0.01)
    return dataset, root / "four", root / "again"


def test_numbers_of_disks_stay_apart_and_so_do_episodes_of_one_name(folders):
    data = load_dataset(*folders)
    assert [(part.disks, len(part)) for part in data.parts] == [(2, 180), (4, 60)]
    assert len(np.unique(data.episode)) == 20 + 10 + 10
    assert len(data.sources) == 3 and data.sha256 not in data.sources
    two, again = load_dataset(folders[0]).alike, load_dataset(folders[2]).alike
    np.testing.assert_array_equal(data.parts[0].state, np.concatenate([two.state, again.state]))


def test_scenes_of_different_bodies_are_not_alike(folders):
    mixed = load_dataset(*folders)
    with pytest.raises(DatasetError, match=r"same bodies are needed, not: .*; give one folder"):
        _ = mixed.alike


def single_rows(data: Dataset) -> list[Part]:
    """Each push by itself."""
    return [
        part.select(np.arange(len(part)) == row) for part in data.parts for row in range(len(part))
    ]


@pytest.mark.parametrize("shares", [(0.1, 0.0), (0.2, 0.0), (0.2, 0.3)])
def test_no_transition_of_a_training_episode_is_held_out(folders, shares):
    """By what happened in them, not by their labels: the label of an episode could be wrong."""
    data = load_dataset(*folders)
    split = split_by_episode(data, 1, *shares)
    parts = [split.train, split.validation, split.test]
    rows = [
        {(*row.state.ravel().tolist(), *row.action.ravel().tolist()) for row in single_rows(part)}
        for part in parts
    ]
    assert sum(map(len, rows)) == len(data) == len(set.union(*rows))
    labels = [set(part.episode.tolist()) if len(part) else set() for part in parts]
    assert [len(found) for found in labels[1:]] == [round(40 * share) for share in shares]
    assert sum(map(len, labels)) == 40 == len(set.union(*labels))


def test_disks_that_do_not_exist_change_nothing_of_those_that_do(folders):
    torch.manual_seed(0)
    network = InteractionNetwork(NetworkConfig())
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    for folder in folders[:2]:
        data = load_dataset(folder).alike
        examples = make_examples(data, PlanarPrior())
        padded = examples.padded(5)
        said = network(examples.bodies, examples.relations)
        of_five = network(padded.bodies, padded.relations)
        assert of_five.shape == (len(data), 5, 3)
        assert torch.allclose(of_five[:, : data.disks], said, rtol=1e-5, atol=1e-8)
        assert not padded.residual[:, data.disks :].any()
    assert examples.padded(4) is examples


def test_what_was_learned_from_among_others_is_not_evaluated_on(folders, tmp_path, capsys):
    arguments = [*map(str, folders), "--out", str(tmp_path), "--epochs", "1", "--history", "none"]
    assert train(arguments) == 0
    capsys.readouterr()
    checkpoint = ["--checkpoint", str(tmp_path / "sain.safetensors")]
    assert evaluate([str(folders[1]), *checkpoint]) == 1
    assert "learned from this data among others" in " ".join(capsys.readouterr().err.split())


def test_windows_never_cross_episodes_and_lose_no_push(tmp_path):
    shuffled = load_episodes(tmp_path, np.random.default_rng(0).permutation(EVERY))
    windows = make_windows(shuffled, 4)
    assert sorted(windows.rows[:, 0]) == list(range(len(EVERY)))
    for rows, episode, known in zip(windows.rows, windows.episodes, windows.known, strict=True):
        used = rows[known]
        assert (shuffled.episode[used] == episode).all()
        first = shuffled.step[rows[0]]
        length = min(4, PUSHES - first)
        np.testing.assert_array_equal(shuffled.step[used], np.arange(first, first + length))


def test_a_window_is_what_happened(tmp_path):
    data = load_episodes(tmp_path)
    windows = whole_windows(data, 3)
    assert len(windows) == EPISODES * (PUSHES - 2) and windows.known.all()
    np.testing.assert_array_equal(windows.scenes, data.state[windows.rows[:, 0]])
    np.testing.assert_array_equal(windows.next_scenes, data.next_state[windows.rows])
    np.testing.assert_array_equal(windows.pushes, data.action[windows.rows])
    later = data.state[windows.rows[:, 1:]]
    np.testing.assert_array_equal(windows.next_scenes[:, :-1], later)


def test_no_window_spans_a_gap(tmp_path):
    """Neither where a step is missing, nor where a scene is another than the push before left."""
    data = load_episodes(tmp_path / "gap", np.delete(EVERY, 2))
    windows = make_windows(data, PUSHES)
    assert windows.known[0].sum() == 2  # pushes 0 and 1 of episode 0; 3 to 5 stand by themselves
    assert windows.known[2].sum() == 3
    whole = load_episodes(tmp_path / "whole")
    scenes = whole.state.copy()
    scenes[3, 0, X] += 1e-6
    touched = make_windows(replace(whole, state=scenes), PUSHES)
    assert touched.known[0].sum() == 3
