"""A checkpoint goes on learning: what stays and what moves, what is refused, what is told."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import CheckpointError, DatasetError
from sain_core.push import LOCATION
from sain_core.scene import unit
from sain_model import commands
from sain_model.cli.evaluate import unseen
from sain_model.data.dataset import load_dataset
from sain_model.dynamics.load import ModelCard, save_checkpoint
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.training.fit import Parent
from sain_model.training.trainer import Trainer
from tests.sain_model.conftest import read_card

SMALL = ("--hidden", "8", "--message", "4", "--members", "2")
LEARN = ("--epochs", "20", "--batch", "16", "--learning-rate", "0.01")


def run(*arguments: object) -> int:
    return commands.train([str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def parent(dataset, tmp_path_factory):
    """A small ensemble that has learned from the data set of all these tests."""
    out = tmp_path_factory.mktemp("parent")
    assert run(dataset, "--out", out, "--epochs", 5, *SMALL) == 0
    return out / "sain.safetensors"


@pytest.fixture(scope="module")
def world(dataset, tmp_path_factory):
    """Another world: the target goes further by 3 tenths, along the push; friction is unknown."""
    folder = tmp_path_factory.mktemp("world")
    for shard in sorted(dataset.glob("*.npz")):
        arrays = dict(np.load(shard))
        state, after = (arrays[name].reshape(-1, 2, 8) for name in ("state", "next_state"))
        way = np.linalg.norm((after - state)[:, 1, :2], axis=-1)
        after[:, 1, :2] += 0.3 * way[:, None] * unit(arrays["action"][:, LOCATION])
        del arrays["friction"], arrays["floor_next"]
        np.savez_compressed(folder / shard.name, **arrays)
    return folder


@pytest.fixture(scope="module")
def child(parent, world, tmp_path_factory):
    """What becomes of the parent in the other world."""
    out = tmp_path_factory.mktemp("child")
    assert run(world, "--from", parent, "--out", out, *LEARN) == 0
    return out / "sain.safetensors"


def test_it_errs_less_where_it_learned(child):
    gain = read_card(child).errors["fine_tuning"]
    ratio, low, high = gain["ratio"]
    assert gain["after"] == pytest.approx(ratio * gain["before"])
    assert low <= ratio <= high < 0.9
    training = read_card(child).training
    assert training["validation_loss"] < training["loss_before"]


def test_the_card_tells_where_it_came_from(parent, child, dataset):
    card, before = read_card(child), read_card(parent)
    family = list(card.lineage())
    assert [member.weights_sha256 for member in family] == [
        card.weights_sha256,
        before.weights_sha256,
    ]
    assert family[1] == replace(before, errors={})
    assert family[1].data["sha256"] == load_dataset(dataset).sha256
    assert list(before.lineage()) == [before]
    with pytest.raises(CheckpointError, match="parent on a card is no card"):
        list(replace(card, parent={"colour": "red"}).lineage())


def test_nothing_that_an_ancestor_learned_from_counts_as_held_out(parent, child, dataset, world):
    old, new = load_dataset(dataset), load_dataset(world)
    by_parent, by_child = unseen(old, read_card(parent)), unseen(old, read_card(child))
    assert 0 < len(by_child) < len(old)
    assert np.array_equal(by_child.alike.action, by_parent.alike.action)
    assert 0 < len(unseen(new, read_card(child))) < len(new)


def test_the_same_command_gives_the_same_bytes_also_after_a_stop(
    parent, child, world, tmp_path, monkeypatch
):
    command = (world, "--from", parent, "--out", tmp_path, *LEARN)
    whole = Trainer.run

    def stopped(self: Trainer, progress: Callable[..., None]) -> None:
        def stop(epoch: int, history: object) -> None:
            if epoch == 7:
                raise KeyboardInterrupt

        whole(self, stop)

    with monkeypatch.context() as patch:
        patch.setattr(Trainer, "run", stopped)
        assert run(*command) == 130
    assert not (tmp_path / "sain.safetensors").exists()
    assert run(*command) == 0
    assert (tmp_path / "sain.safetensors").read_bytes() == child.read_bytes()
    cards = [json.loads((folder / "sain.json").read_text()) for folder in (tmp_path, child.parent)]
    for part in ("intervals", "training", "errors", "parent"):
        assert cards[0][part] == cards[1][part]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--members", "5"], "--members is 5; {} has 2, and its weights fit nothing else"),
        (["--features", "world"], "--features is 'world'; {} has 'push'"),
        (["--prior", "planar_axes"], "--prior is 'planar_axes'; {} has 'planar'"),
        (["--history", "none"], "--history is 'none'; {} has 'episode'"),
        (["--preset", "paper"], "--preset paper is for new weights"),
        (["--steps-ahead", "3"], "--steps-ahead is for new weights"),
    ],
)
def test_what_contradicts_the_parent_is_refused(options, message, parent, world, tmp_path, capsys):
    assert run(world, "--from", parent, "--out", tmp_path / "out", *options) == 1
    told = "".join(capsys.readouterr().err.split())
    assert "".join(message.format(parent).split()) in told
    assert not (tmp_path / "out").exists()


def test_data_that_an_ancestor_has_seen_are_refused(parent, child, dataset, world):
    old, new = load_dataset(dataset), load_dataset(world)
    Parent.load(str(parent)).check_data(new)
    for checkpoint, data in ((parent, old), (child, old), (child, new)):
        with pytest.raises(DatasetError, match="has learned from this data set already"):
            Parent.load(str(checkpoint)).check_data(data)
    mixed = replace(new, sha256="of both", sources=("other", old.sha256))
    with pytest.raises(DatasetError, match="has learned from this data set already"):
        Parent.load(str(parent)).check_data(mixed)


def test_what_cannot_be_a_parent_is_refused(tmp_path):
    with pytest.raises(CheckpointError, match="--from is 'planar'; it must be sain, or the path"):
        Parent.load("planar")
    with pytest.raises(CheckpointError, match="does not exist"):
        Parent.load(str(tmp_path / "none.safetensors"))
    path = tmp_path / "other.safetensors"
    network = InteractionNetwork(NetworkConfig(hidden=8))
    save_checkpoint(path, network.weights, ModelCard("planar", {}, {}, kind="recurrent"))
    with pytest.raises(CheckpointError, match="was trained on rollouts"):
        Parent.load(str(path))
