"""A trained network run by PyTorch: how SAIN predicts on a GPU, and what the kernels must match."""

import numpy as np
import torch

from sain_core.push import LENGTH
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Pushes, Scenes
from sain_model.compute.threads import settle_threads
from sain_model.network.features import apply_residual, network_inputs, push_frames
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.parameters import Values


class TorchNetwork:
    """What a network predicts on a device of PyTorch's. Features are computed on the CPU."""

    def __init__(self, network: InteractionNetwork, device: str) -> None:
        """Move the network there, for good."""
        self._device = device
        self._network = network.to(device).eval()

    def correct(
        self,
        scenes: Scenes,
        pushes: Pushes,
        physics_next: Scenes,
        bodies: Bodies = PAPER_DISKS,
        values: Values | None = None,
    ) -> Scenes:
        """Return predictions (B, N, 8) of a prior for pushes (B, 5 or 8) from scenes, corrected.

        `values` are what is believed of the physics, by name.
        """
        config = self._network.config
        frames = push_frames(scenes, pushes, bodies)
        features = network_inputs(config, scenes, frames, physics_next, bodies, values)
        settle_threads()
        with torch.inference_mode():
            output = self._network(*features.tensors(self._device))
        residual = output.cpu().numpy().astype(np.float64)
        corrected = apply_residual(physics_next, frames, residual)
        idle = pushes[:, LENGTH] == 0.0
        corrected[idle] = physics_next[idle]
        return corrected
