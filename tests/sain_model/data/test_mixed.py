import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from sain_core.errors import DatasetError
from sain_core.scene import STATE_SIZE, X, Y
from sain_model.commands import evaluate, train
from sain_model.data.dataset import Dataset, Part, Split, load_dataset, split_by_episode
from sain_model.data.examples import make_examples
from sain_model.inference.kinds import friction_kind
from sain_model.network.interaction_network import InteractionNetwork, new_network
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.training.objectives import SinglePushes
from sain_model.training.settings import TrainingConfig

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
def folders(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Path]:
    """Data with 2 disks, with 4, and with 2 again but other pushes."""
    root = tmp_path_factory.mktemp("mixed")
    shard = dataset / "shard-0.npz"
    with_more_disks(shard, 2, root / "four" / "a.npz")
    with_more_disks(shard, 0, root / "again" / "a.npz", shift=0.01)
    return dataset, root / "four", root / "again"


def test_numbers_of_disks_stay_apart_and_so_do_episodes_of_one_name(folders) -> None:
    data = load_dataset(*folders)
    assert [(part.disks, len(part)) for part in data.parts] == [(2, 180), (4, 60)]
    assert len(np.unique(data.episode)) == 20 + 10 + 10
    assert len(data.sources) == 3 and data.sha256 not in data.sources
    two, again = load_dataset(folders[0]).alike, load_dataset(folders[2]).alike
    np.testing.assert_array_equal(data.parts[0].state, np.concatenate([two.state, again.state]))


def test_several_folders_with_as_many_disks_are_one_data_set(folders) -> None:
    data = load_dataset(folders[0], folders[2])
    assert len(data.parts) == 1 and len(data) == 180
    assert data.sources == tuple(load_dataset(path).sha256 for path in folders[::2])


def test_a_folder_may_mix_numbers_of_disks(folders, tmp_path) -> None:
    for name, folder in (("a", folders[0]), ("b", folders[1])):
        shard = next(iter(sorted(folder.glob("*.npz"))))
        (tmp_path / f"{name}.npz").write_bytes(shard.read_bytes())
    data = load_dataset(tmp_path)
    assert [part.disks for part in data.parts] == [2, 4]
    assert not set(data.parts[0].episode) & set(data.parts[1].episode)


def test_the_same_push_in_two_data_sets_is_refused(folders, tmp_path) -> None:
    copy = tmp_path / "copy.npz"
    copy.write_bytes((folders[0] / "shard-1.npz").read_bytes())
    with pytest.raises(DatasetError, match=r"copy\.npz hold the same push; give each"):
        load_dataset(folders[0], copy)
    with pytest.raises(DatasetError, match="the same push"):
        load_dataset(folders[0], folders[0])


def single_rows(data: Dataset) -> list[Part]:
    """Each push by itself."""
    return [
        part.select(np.arange(len(part)) == row) for part in data.parts for row in range(len(part))
    ]


@pytest.mark.parametrize("shares", [(0.1, 0.0), (0.2, 0.0), (0.2, 0.3)])
def test_no_transition_of_a_training_episode_is_held_out(folders, shares) -> None:
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


def test_the_papers_splits_hold_nothing_out_for_a_test(dataset: Path) -> None:
    data = load_dataset(dataset)
    for share, count in ((0.1, 2), (0.2, 4)):
        split = split_by_episode(data, 0, share, 0.0)
        sizes = [len(np.unique(part.episode)) for part in (split.train, split.validation)]
        assert sizes == [20 - count, count] and len(split.test) == 0
    one = data.select(data.episode == 0)
    with pytest.raises(DatasetError, match="1 episodes are too few to train and validate"):
        split_by_episode(one, 0, 0.1, 0.0)


def test_disks_that_do_not_exist_change_nothing_of_those_that_do(folders) -> None:
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


def test_examples_of_all_parts_are_learned_from_and_then_their_images(folders) -> None:
    data = load_dataset(*folders)
    split, config = Split(data, data, data), TrainingConfig(network=NetworkConfig(hidden=8))
    pushes = SinglePushes(split, friction_kind(PlanarPrior()), config)
    np.testing.assert_array_equal(pushes.episodes, np.tile(data.episode, 2))
    network = new_network(config.network, 0)
    some = torch.arange(len(data))[None]
    np.testing.assert_allclose(  # a network that says nothing errs alike in a mirror
        pushes.losses(network, some).detach(), pushes.losses(network, some + len(data)).detach()
    )


def test_the_command_learns_from_all_of_them(folders, tmp_path, capsys) -> None:
    arguments = [*map(str, folders), "--out", str(tmp_path), "--epochs", "1", "--history", "none"]
    assert train(arguments) == 0
    card = (tmp_path / "sain.json").read_text()
    assert all(str(folder) in card for folder in folders)
    capsys.readouterr()


def test_fewer_transitions_are_first_episodes_of_all_parts(folders) -> None:
    data = load_dataset(*folders)
    whole, split = split_by_episode(data, 0, 0.1, 0.1), split_by_episode(data, 0, 0.1, 0.1, 20)
    assert [len(split.train), len(split.test)] == [20, len(whole.test)]
    first = sorted(set(whole.train.episode.tolist()))[: len(set(split.train.episode.tolist()))]
    assert set(split.train.episode.tolist()) == set(first)
    with pytest.raises(DatasetError, match="9999 transitions to train on are asked for"):
        split_by_episode(data, 0, 0.1, 0.1, 9999)


def test_a_select_keeps_the_order_of_the_parts(folders) -> None:
    data = load_dataset(*folders)
    rows = np.arange(len(data)) % 3 == 0
    picked = data.select(rows)
    np.testing.assert_array_equal(picked.episode, data.episode[rows])
    assert replace(picked, parts=picked.parts[:1]).select(np.zeros(60, bool)).parts == ()


def test_without_a_test_part_the_card_says_what_its_errors_are_of(
    dataset, tmp_path, capsys
) -> None:
    arguments = [str(dataset), "--out", str(tmp_path), "--epochs", "1", "--history", "none"]
    assert train([*arguments, "--validation", "0.2", "--test", "0"]) == 0
    card = json.loads((tmp_path / "sain.json").read_text())
    assert card["data"]["episodes"] == {"train": 16, "validation": 4, "test": 0}
    assert card["errors"]["held_out"] == "validation" and card["errors"]["episodes"] == 4
    capsys.readouterr()
    assert evaluate([str(dataset), "--checkpoint", str(tmp_path / "sain.safetensors")]) == 1
    assert "learned from all of this data" in "".join(capsys.readouterr())


def test_what_was_learned_from_among_others_is_not_evaluated_on(folders, tmp_path, capsys) -> None:
    arguments = [*map(str, folders), "--out", str(tmp_path), "--epochs", "1", "--history", "none"]
    assert train(arguments) == 0
    capsys.readouterr()
    checkpoint = ["--checkpoint", str(tmp_path / "sain.safetensors")]
    assert evaluate([str(folders[1]), *checkpoint]) == 1
    assert "learned from this data among others" in " ".join(capsys.readouterr().err.split())
