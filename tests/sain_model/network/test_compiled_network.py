"""The compiled network: PyTorch's answers, to the bit whatever the batch and the threads."""

import multiprocessing

import numba
import numpy as np
import pytest
import torch

from sain_core.push import LENGTH, PushLimits
from sain_core.scene import POSITION, THETA, make_scene, wrap_angle
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.residual import CompiledNetwork
from sain_model.dynamics.sain import residual_model
from sain_model.inference.kinds import friction_kind
from sain_model.network.interaction_network import InteractionNetwork, TorchNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.physics.parameters import PlanarConfig
from sain_model.physics.planar import PlanarPrior

PLACES = np.array([(0.45, 0.0), (0.591, 0.0), (0.5, 0.14), (0.5, -0.15), (0.72, 0.1)])
RADII = np.array([0.08, 0.06, 0.06, 0.06, 0.055])


def network(seed: int = 0, **size: object) -> InteractionNetwork:
    """Return a network whose residuals are of a centimetre or so."""
    torch.manual_seed(seed)
    made = InteractionNetwork(NetworkConfig(**size))  # type: ignore[arg-type]
    with torch.no_grad():
        for parameter in made.parameters():
            parameter.add_(0.2 * torch.randn_like(parameter))
    return made


def batch(disks: int, count: int, seed: int = 0) -> tuple[Scenes, Pushes]:
    random = np.random.default_rng(seed)
    scenes = np.stack(
        [
            make_scene(
                PLACES[:disks],
                random.uniform(7, 9, disks),
                RADII[:disks],
                random.uniform(-3, 3, disks),
            )
            for _ in range(count)
        ]
    )
    pushes = PushLimits().sample(random, count)
    pushes[::7, LENGTH] = 0.0
    return scenes, pushes


@pytest.mark.parametrize("disks", [2, 5])
@pytest.mark.parametrize(
    "size",
    [
        {},
        {"hidden": 9, "message": 5, "layers": 1},
        {"hidden": 13, "message": 1, "layers": 3, "features": "world"},
    ],
)
def test_the_kernels_and_pytorch_agree(disks, size):
    scenes, pushes = batch(disks, 150)
    physics = PlanarPrior().step(scenes, pushes)
    made = network(**size)
    expected = TorchNetwork(made.weights, "cpu").correct(scenes, pushes, physics)
    found = CompiledNetwork(made.weights).correct(scenes, pushes, physics)
    assert np.abs(expected - physics)[..., POSITION].max() > 1e-3
    np.testing.assert_allclose(found[..., POSITION], expected[..., POSITION], rtol=0, atol=1e-7)
    np.testing.assert_allclose(wrap_angle(found - expected)[..., THETA], 0, atol=1e-5)
    np.testing.assert_array_equal(found[..., THETA + 1 :], expected[..., THETA + 1 :])


def test_a_batch_is_a_loop_to_the_bit():
    scenes, pushes = batch(3, 300)
    sain = residual_model(network().weights, friction_kind(PlanarPrior(), infers=False), "planar")
    together = sain.step(scenes, pushes)
    for index in (0, 1, 127, 128, 299):
        alone = sain.step(scenes[index : index + 1], pushes[index : index + 1])
        assert alone[0].tobytes() == together[index].tobytes()


@pytest.mark.parametrize("disks", [2, 4])
def test_a_rollout_is_step_after_step_to_the_bit_on_any_number_of_threads(disks):
    sain = residual_model(
        network(1).weights,
        friction_kind(PlanarPrior(PlanarConfig(friction=0.15)), infers=False),
        "planar",
    )
    scenes, pushes = batch(disks, 4 * 300, seed=2)
    sequences = pushes.reshape(300, 4, 5)
    stepwise = sain.rollout(scenes[0], sequences)
    before = numba.get_num_threads()
    try:
        for threads in range(1, numba.config.NUMBA_NUM_THREADS + 1):
            numba.set_num_threads(threads)
            assert sain.rollout(scenes[0], sequences).tobytes() == stepwise.tobytes()
    finally:
        numba.set_num_threads(before)


def predict_in_child(queue: "multiprocessing.Queue[bytes]") -> None:
    scenes, pushes = batch(2, 300)
    queue.put(CompiledNetwork(network().weights).correct(scenes, pushes, scenes).tobytes())


def test_a_forked_process_predicts_the_same():
    scenes, pushes = batch(2, 300)
    here = CompiledNetwork(network().weights).correct(scenes, pushes, scenes).tobytes()
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=predict_in_child, args=(queue,))
    child.start()
    there = queue.get(timeout=60)
    child.join(timeout=60)
    assert there == here
