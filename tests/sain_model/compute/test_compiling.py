"""One call compiles all that predictions run."""

import numpy as np

from sain_core.push import make_push
from sain_core.shapes.bodies import PAPER_DISKS
from sain_core.types import PushSequences
from sain_model.compute.kernel_store import compile_kernels, kernels_are_ready
from sain_model.dynamics.sain import residual_model
from sain_model.inference.kinds import friction_kind
from sain_model.network import feature_kernels, network_kernels
from sain_model.network.features import network_inputs, push_frames
from sain_model.network.interaction_network import new_network
from sain_model.network.settings import NetworkConfig
from sain_model.physics import push_kernels
from sain_model.physics.planar import PlanarPrior

ENTRIES = (
    push_kernels.push_bodies_block,
    network_kernels.correct_block,
    feature_kernels.write_block,
)


def test_predictions_run_what_was_compiled():
    compile_kernels()
    assert kernels_are_ready()
    scenes = np.stack([make_scene(), make_scene()])
    scenes.setflags(write=False)
    pushes = np.tile(make_push(0.1, 0.2, 0.05), (2, 1))[::-1]
    pushes.setflags(write=False)
    for features, members in (("push", 1), ("world", 3)):
        network = new_network(NetworkConfig(features=features, members=members), 0)
        sain = residual_model(network.weights, friction_kind(PlanarPrior(), infers=False), "planar")
        sain.step(scenes, pushes, {"friction": np.broadcast_to(0.12, 2)})
        sain.rollout(scenes[0], sequences(pushes))
    frames = push_frames(scenes, pushes, PAPER_DISKS)
    network_inputs(NetworkConfig(), scenes, frames, scenes, PAPER_DISKS)
    for kernel in ENTRIES:
        assert sum(kernel.stats.cache_hits.values()) >= 1, kernel.__name__
        assert not kernel.stats.cache_misses, f"{kernel.__name__} was compiled again"


def make_scene() -> np.ndarray:
    scene = np.zeros((2, 8))
    scene[:, 0] = 0.4, 0.6
    scene[:, 6:] = (8.0, 0.08), (8.0, 0.06)
    return scene


def sequences(pushes: np.ndarray) -> PushSequences:
    return np.broadcast_to(pushes[:, None], (2, 3, 5))
