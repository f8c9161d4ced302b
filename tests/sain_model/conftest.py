from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from sain_core.model import Model
from sain_core.push import BODY, LENGTH, LOCATION, SPEED, PushLimits
from sain_core.scene import MASS, POSITION, THETA, make_scene, turned, unit, wrap_angle
from sain_core.types import Pushes, Scenes
from sain_model.data.dataset import Part, Split
from sain_model.dynamics.load import ModelCard, card_path, parse_card
from sain_model.inference.kinds import friction_kind
from sain_model.network.interaction_network import InteractionNetwork, new_network
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.training.objectives import SinglePushes
from sain_model.training.settings import TrainingConfig
from sain_model.training.trainer import Trainer
from tests.sain_model.rolling import write_shard

EPISODES, PUSHES = 20, 6
SCENE = make_scene(
    np.array([(0.40, 0.0), (0.541, 0.0)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)


def random_network(scale: float, seed: int = 0, **size: object) -> InteractionNetwork:
    """Return a network whose weights are moved at random, so that a law that fails shows."""
    torch.manual_seed(seed)
    network = InteractionNetwork(NetworkConfig(**size))  # type: ignore[arg-type]
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(scale * torch.randn_like(parameter))
    return network.eval()


def apply_residual(physics: Scenes, frames: Pushes, residual: np.ndarray) -> Scenes:
    """Return predictions corrected by residuals (B, N, 3) that are given in the push frame."""
    corrected = physics.copy()
    corrected[..., POSITION] += turned(residual[..., :2], frames[:, LOCATION, None])
    corrected[..., THETA] = wrap_angle(physics[..., THETA] + residual[..., 2])
    return corrected


def make_part(
    scenes: Scenes, pushes: Pushes, after: Scenes, episode: np.ndarray, **about: Any
) -> Part:
    """Return pushes of which no more is stated than `about`."""
    columns = {"state": scenes, "action": pushes, "next_state": after, "physics_next": scenes}
    columns |= {"floor_next": np.full_like(scenes, np.nan), "step": np.arange(len(pushes))}
    columns |= {"friction": np.full(len(pushes), np.nan), "episode": episode}
    return Part(**(columns | about))


def read_card(path: Path) -> ModelCard:
    """Return the card beside these weights."""
    return parse_card(card_path(path), card_path(path).read_text())


def make_trainer(split: Split, prior: Model, config: TrainingConfig, folder: Path) -> Trainer:
    """Return a trainer of new weights on single pushes."""
    network = new_network(config.network, config.seed)
    pushes = SinglePushes(split, friction_kind(prior, infers=False), config)
    return Trainer(network, pushes, config, folder / "training.pt")


@pytest.fixture(autouse=True)
def one_torch_thread():
    torch.set_num_threads(1)


def draw_pushes(batch: int, seed: int) -> tuple[Scenes, Pushes]:
    """Draw scenes of two touching disks and pushes of any kind."""
    random = np.random.default_rng(seed)
    bearings = random.uniform(-np.pi, np.pi, batch)
    scenes = np.stack(
        [
            make_scene(
                np.array([[0.45, 0.0], [0.45, 0.0] + 0.141 * unit(np.array(bearing))]),
                random.uniform(7.0, 9.0, 2),
                np.array([0.08, 0.06]),
                random.uniform(-3.0, 3.0, 2),
            )
            for bearing in bearings
        ]
    )
    return scenes, PushLimits().sample(random, batch)


def push_two_bodies(count: int, seed: int = 0) -> tuple[Scenes, Pushes]:
    """Return one scene of two bodies so many times, and pushes of any kind against either."""
    random = np.random.default_rng(seed)
    places = np.array([(0.45, 0.0), (0.58, 0.02)])
    scene = make_scene(places, np.array([8.0, 7.5]), np.array([0.07, 0.06]), np.array([0.3, 1.0]))
    pushes = PushLimits().sample(random, count)
    pushes[:, BODY] = random.integers(2, size=count)
    pushes[:, SPEED] = random.uniform(0.05, 0.3, count)
    return np.repeat(scene[None], count, axis=0), pushes


@pytest.fixture
def random_pushes():
    """Return `draw_pushes`: (batch, seed) -> scenes, pushes."""
    return draw_pushes


@pytest.fixture(scope="session")
def dataset(tmp_path_factory):
    """A folder of two shards, see `write_dataset`."""
    return write_dataset(tmp_path_factory.mktemp("dataset"), EPISODES)


def write_dataset(folder: Path, episodes: int) -> Path:
    """Write two shards whose truth is the planar prior plus a residual to be learned.

    The target goes further by 4 mm for every kilogram that the mid disk is heavier than 8 kg,
    along the push, when it moves at all.
    """
    scenes, pushes = draw_pushes(episodes * PUSHES, seed=3)
    physics = PlanarPrior().step(scenes, pushes)
    truth = physics.copy()
    moved = np.linalg.norm((physics - scenes)[:, 1, POSITION], axis=-1) > 1e-3
    further = 0.004 * (scenes[:, 0, MASS] - 8.0) * moved
    truth[:, 1, POSITION] += further[:, None] * unit(pushes[:, LOCATION])
    labels = np.repeat(np.arange(episodes), PUSHES)
    for shard, rows in enumerate(np.array_split(np.arange(len(pushes)), 2)):
        floor = truth[rows].reshape(len(rows), -1) + 1e-4
        about = {"episode": labels[rows], "friction": np.full(len(rows), 0.12)}
        some = scenes[rows], pushes[rows], truth[rows], physics[rows]
        write_shard(folder, *some, number=shard, floor_next=floor, **about)
    assert (pushes[:, LENGTH] > 0).all()
    return folder
