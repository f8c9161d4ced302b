"""``python -m sain_model.cli.kernels``: compile every kernel once, before others need it.

Numba keeps what it compiled on disk. Processes that start side by side would each compile the same
kernels: the set-up and the test session call this first.
"""

import sys
from time import perf_counter

import numpy as np
import torch
from rich.console import Console

from sain_core.push import PUSH_SIZE
from sain_core.scene import MASS, RADIUS, X
from sain_core.shapes.bodies import Bodies
from sain_model.compute.compiling import kernel_folder
from sain_model.identification.varied_pushes import step_varied
from sain_model.network.compiled_network import CompiledNetwork
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import ANY_SHAPE, NetworkConfig
from sain_model.network.shape_features import network_inputs, push_frames
from sain_model.physics.corrections import CORRECTIONS
from sain_model.physics.planar import PlanarPrior


def compile_kernels() -> None:
    """Run each kernel once with arguments of the types that this package calls it with.

    The types are those of arrays and settings, not of sizes: one network and an ensemble, and both
    kinds of features, run the same machine code.
    """
    scenes = np.zeros((1, 2, 8))
    scenes[..., MASS], scenes[..., RADIUS] = 8.0, 0.06
    scenes[:, 1, X] = 0.2
    pushes = np.full((1, PUSH_SIZE), 0.05)
    prior = PlanarPrior()
    predicted = prior.step(scenes, pushes)
    prior.step_conditioned(scenes, pushes, np.zeros((1, 2, CORRECTIONS)))
    shaped_bodies = Bodies.named(["cube", "disk"])
    prior.with_bodies(shaped_bodies).step(scenes, pushes)
    varied = np.full(1, prior.config.friction), np.array(prior.config.physics())[None]
    for bodies in (None, shaped_bodies):
        step_varied(prior.config, bodies, scenes, pushes, *varied)
    any_shape = NetworkConfig(bodies=ANY_SHAPE)
    with torch.random.fork_rng(devices=[]):  # the weights do not matter, nor may drawing them
        network = CompiledNetwork(InteractionNetwork())
        shaped = CompiledNetwork(InteractionNetwork(any_shape))
    network.correct(scenes, pushes, predicted)
    network.rollout(prior, scenes[0], pushes[:, None])
    shaped.correct(scenes, pushes, predicted)
    frames = push_frames(any_shape, scenes, pushes, None)
    network_inputs(any_shape, scenes, frames, predicted, None)  # of regions and of training


def main() -> int:
    """Compile all kernels and print where they are kept."""
    start = perf_counter()
    compile_kernels()
    Console().print(f"kernels are in {kernel_folder()} ({perf_counter() - start:.1f} s)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
