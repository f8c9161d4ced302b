"""SAIN whose network corrects physical parameters: physics computes the consequences.

    s' = f_p(s, a, c) + f_theta,   (c, f_theta) = network(f_p(s, a), s, a)

The paper's equation 2 adds a residual to what physics predicts. Here the network first corrects
parameters of physics (`physics.corrections`), so that physics computes what a slope or a mass off
the middle does to this push. The network adds a residual to that.
"""

from typing import Final

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LENGTH
from sain_core.types import Pushes, Scenes
from sain_model.compute.devices import CPU
from sain_model.compute.threads import settle_threads
from sain_model.dynamics.correction_network import CorrectionEnsemble
from sain_model.dynamics.physics_gradient import moves
from sain_model.network.features import apply_residual, make_features
from sain_model.network.settings import WORLD_FRAME
from sain_model.physics.corrections import Corrections
from sain_model.physics.planar import PlanarPrior

PARAMETER_CORRECTION: Final = "parameter_correction"


class ParameterCorrection:
    """Several networks, trained alike from different seeds, on one prior. A `Dynamics`.

    What they predict is averaged. Attributes are called as those of `SainDynamics`.
    """

    kind: Final = PARAMETER_CORRECTION
    device: Final = CPU  # it is small, and its prior runs nowhere else

    def __init__(
        self,
        networks: CorrectionEnsemble,
        prior: PlanarPrior,
        prior_name: str = "",
        model_hash: str = "",
        card: str = "",
    ) -> None:
        """Let these networks correct this prior."""
        self.networks = networks.eval()
        self.prior = prior
        self.prior_name = prior_name
        self.model_hash = model_hash
        self.card = card

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, 3) from scenes (B, N, 8).

        A push of length 0 leaves the scene unchanged, bit for bit.
        """
        physics_next = self.prior.step(scenes, pushes)
        plain = moves(scenes, pushes, physics_next)
        change = np.zeros_like(plain)
        for corrections, residual in self.corrections(scenes, pushes, physics_next):
            told = self.prior.step_conditioned(scenes, pushes, corrections)
            change += moves(scenes, pushes, told) - plain + residual
        predicted = apply_residual(physics_next, pushes, change / len(self.networks))
        idle = pushes[:, LENGTH] == 0.0
        predicted[idle] = physics_next[idle]
        return predicted

    def corrections(
        self, scenes: Scenes, pushes: Pushes, physics_next: Scenes
    ) -> list[tuple[Corrections, Float[ndarray, "B N 3"]]]:
        """Return what each network corrects, and what it adds to the prediction.

        `physics_next` is what the uncorrected prior predicts.
        """
        features = make_features(scenes, pushes, physics_next, WORLD_FRAME)
        settle_threads()
        with torch.inference_mode():
            outputs = [network(*features.tensors()) for network in self.networks]
        return [
            (told.numpy().astype(np.float64), residual.numpy().astype(np.float64))
            for told, residual in outputs
        ]
