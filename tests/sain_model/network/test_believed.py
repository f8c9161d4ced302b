"""What a network sees of what is believed of the physics."""

import numpy as np
import pytest
import torch

from sain_core.push import make_push, mirror_pushes, rotate_pushes
from sain_core.scene import THETA, make_scene, mirror_scenes, rotate_scenes
from sain_core.shapes.bodies import PAPER_DISKS
from sain_model.network.believed import BELIEVED_FEATURES, MIRRORED_BELIEVED
from sain_model.network.compiled_network import CompiledNetwork
from sain_model.network.feature_kernels import BODY_FEATURES
from sain_model.network.features import network_inputs, push_frames
from sain_model.network.interaction_network import new_network
from sain_model.network.settings import NetworkConfig
from sain_model.network.torch_network import TorchNetwork
from sain_model.physics.parameters import Values

CONFIG = NetworkConfig(believed=True)
NAMES = (
    "tool_friction", "torsion", "pressure", "centre_x", "centre_y", "grain_x", "grain_y",
    "table_grain_x", "table_grain_y", "tip_x", "tip_y",
)  # fmt: skip
ODD = ("centre_y", "grain_y", "table_grain_y", "tip_y")  # in a mirror


def draw(count: int = 20) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    random = np.random.default_rng(0)
    scene = make_scene(np.array([(0.5, 0.0), (0.7, 0.03)]), np.full(2, 8.0), np.full(2, 0.08))
    scenes = np.repeat(scene[None], count, axis=0)
    scenes[..., THETA] = random.uniform(-3.0, 3.0, scenes.shape[:2])
    pushes = make_push(*random.uniform((-3.0, -0.7, 0.05), (3.0, 0.7, 0.15), (count, 3)).T)
    values = {name: random.uniform(0.01, 0.3, count) for name in NAMES}
    values["centre_x"] = random.uniform(-0.1, 0.1, (count, 2))  # of each body its own
    return scenes, pushes, values


def believed(scenes: np.ndarray, pushes: np.ndarray, values: Values) -> np.ndarray:
    frames = push_frames(scenes, pushes, PAPER_DISKS)
    features = network_inputs(CONFIG, scenes, frames, scenes, PAPER_DISKS, values)
    return features.bodies[..., BODY_FEATURES:]


def test_each_parameter_is_seen() -> None:
    scenes, pushes, values = draw()
    before = believed(scenes, pushes, values)
    assert before.shape == (20, 2, BELIEVED_FEATURES)
    for name in NAMES:
        after = believed(scenes, pushes, values | {name: values[name] + 0.1})
        assert (np.abs(after - before).max(axis=(1, 2)) > 0.01).all(), name


def test_a_turned_scene_looks_the_same() -> None:
    scenes, pushes, values = draw()
    before, angle = believed(scenes, pushes, values), 0.7
    turned = dict(values)
    for name, times in (("table_grain", 2.0), ("tip", 1.0)):
        x, y = values[f"{name}_x"], values[f"{name}_y"]
        cos, sin = np.cos(times * angle), np.sin(times * angle)
        turned |= {f"{name}_x": cos * x - sin * y, f"{name}_y": sin * x + cos * y}
    after = believed(rotate_scenes(scenes, angle), rotate_pushes(pushes, angle), turned)
    np.testing.assert_allclose(after, before, atol=1e-5)


def test_in_a_mirror_what_lies_across_the_push_changes_its_sign() -> None:
    scenes, pushes, values = draw()
    expected = believed(scenes, pushes, values)
    expected[..., list(MIRRORED_BELIEVED)] *= -1.0
    image = values | {name: -values[name] for name in ODD}
    after = believed(mirror_scenes(scenes), mirror_pushes(pushes), image)
    np.testing.assert_allclose(after, expected, atol=1e-5)


@pytest.mark.parametrize("frame", ["push", "world"])
def test_kernels_see_what_pytorch_sees(frame: str) -> None:
    scenes, pushes, values = draw()
    network = new_network(NetworkConfig(believed=True, features=frame, members=2), 0)
    with torch.no_grad():
        for weights in network.parameters():
            weights.add_(0.05 * torch.randn_like(weights))
    expected = TorchNetwork(network, "cpu").correct(scenes, pushes, scenes, PAPER_DISKS, values)
    found = CompiledNetwork(network).correct(scenes, pushes, scenes, PAPER_DISKS, values)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    other = CompiledNetwork(network).correct(scenes, pushes, scenes, PAPER_DISKS)
    assert np.abs(other - found).max() > 1e-5
