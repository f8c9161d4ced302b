"""A network that sees the world learns what is tied to places and headings; another cannot."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sain_core.errors import CheckpointError, DatasetError
from sain_core.model import load_dynamics
from sain_core.push import rotate_pushes
from sain_core.scene import POSITION, TARGET, rotate_scenes
from sain_core.shapes.bodies import PAPER_DISKS
from sain_core.types import Pushes, Scenes
from sain_model import commands
from sain_model.data.dataset import Dataset, limit_training, load_dataset, split_by_episode
from sain_model.dynamics.load import load_checkpoint
from sain_model.dynamics.residual import residual_model
from sain_model.evaluation.errors import position_errors
from sain_model.inference.kinds import friction_kind
from sain_model.network.feature_kernels import BODY_FEATURES
from sain_model.network.features import Features, network_inputs, push_frames
from sain_model.network.inputs import PLACE_FEATURES
from sain_model.network.relation_kernels import HEADINGS
from sain_model.network.settings import PUSH_FRAME, WORLD_FRAME, NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.training.settings import LossConfig, TrainingConfig
from tests.sain_model.conftest import make_trainer, read_card


def downhill(dataset: Path):
    """The dataset with targets that end 5 mm further along the world's x, wherever pushed."""
    data = load_dataset(dataset).alike
    after = data.state.copy()
    after[:] = PlanarPrior().step(data.state, data.action)
    after[:, TARGET, 0] += 0.005
    return split_by_episode(Dataset((replace(data, next_state=after),)), 0, 0.2, 0.2)


def features(scenes: Scenes, pushes: Pushes, after: Scenes, frame: str) -> Features:
    frames = push_frames(scenes, pushes, PAPER_DISKS)
    return network_inputs(NetworkConfig(features=frame), scenes, frames, after, PAPER_DISKS)


def test_only_the_frame_of_the_world_shows_how_a_scene_is_turned(random_pushes) -> None:
    scenes, pushes = random_pushes(20, 0)
    after = PlanarPrior().step(scenes, pushes)
    turn = [rotate_scenes(scenes, 2.0), rotate_pushes(pushes, 2.0), rotate_scenes(after, 2.0)]
    push, world = (features(scenes, pushes, after, f) for f in (PUSH_FRAME, WORLD_FRAME))
    turned_push, turned_world = (features(*turn, f) for f in (PUSH_FRAME, WORLD_FRAME))
    np.testing.assert_allclose(turned_push.bodies, push.bodies, atol=1e-5)
    assert world.bodies.shape[-1] == BODY_FEATURES + PLACE_FEATURES
    np.testing.assert_array_equal(world.bodies[..., :BODY_FEATURES], push.bodies)
    np.testing.assert_array_equal(world.relations[..., :HEADINGS], push.relations[..., :HEADINGS])
    changed = np.abs(turned_world.bodies - world.bodies).max(axis=(0, 1))
    assert (changed[BODY_FEATURES:-2] > 0.1).all()
    np.testing.assert_allclose(changed[-2:], 0.0, atol=1e-5)  # a disk's heading as the push sees it


def test_what_pulls_along_the_world_is_learned_in_its_frame_alone(dataset, tmp_path) -> None:
    split, prior, left = downhill(dataset), PlanarPrior(), {}
    test = split.test.alike
    for frame in (PUSH_FRAME, WORLD_FRAME):
        network = NetworkConfig(hidden=32, message=8, features=frame)
        config = TrainingConfig(
            epochs=60, batch=16, network=network, loss=LossConfig(position_scale=0.005)
        )
        trainer = make_trainer(split, prior, config, tmp_path / frame)
        trainer.run()
        sain = residual_model(trainer.network, friction_kind(prior, infers=False), "planar")
        predicted = sain.step(test.state, test.action)
        left[frame] = position_errors(predicted, test.next_state, TARGET).mean()
    assert left[WORLD_FRAME] < 2.0 and left[WORLD_FRAME] < 0.5 * left[PUSH_FRAME]


def test_a_checkpoint_knows_what_its_network_sees(dataset, tmp_path, random_pushes) -> None:
    arguments = [str(dataset), "--out", str(tmp_path), "--features", "world"]
    arguments += ["--epochs", "2", "--validation", "0.2", "--transitions", "40"]
    assert commands.train(arguments) == 0
    path = tmp_path / "sain.safetensors"
    network, card = load_checkpoint(path).network, read_card(path)
    assert network.module.config.features == "world" and card.data["transitions"]["train"] == 40
    scenes, pushes = random_pushes(5, 1)
    assert np.isfinite(load_dynamics(str(path)).step(scenes, pushes)[..., POSITION]).all()
    text = (tmp_path / "sain.json").read_text()
    (tmp_path / "sain.json").write_text(text.replace('"features": "world"', '"features": "push"'))
    with pytest.raises(CheckpointError, match=r"dynamics\.0\.weight has shape"):
        load_checkpoint(path)


def test_learning_from_fewer_keeps_what_is_held_out(dataset) -> None:
    split = split_by_episode(load_dataset(dataset), 0, 0.2, 0.2)
    part = limit_training(split, 24)
    assert len(part.train) == 24
    np.testing.assert_array_equal(part.train.alike.action, split.train.alike.action[:24])
    share = 24 / len(split.train)
    assert len(part.validation) == round(share * len(split.validation))
    assert part.test is split.test
    with pytest.raises(DatasetError, match="1000 transitions to train on are asked for; there are"):
        limit_training(split, 1000)
