"""SAIN whose network corrects physical parameters: physics computes the consequences.

    s' = f_p(s, a, c) + f_theta,   (c, f_theta) = network(f_p(s, a), s, a)

The paper's equation 2 adds a residual to what physics predicts. Here the network first corrects
parameters of physics (`network.corrections`), so that physics computes what a slope or a mass off
the middle does to this push. The network adds a residual to that.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LENGTH
from sain_core.types import Scenes
from sain_model.compute.threads import settle_threads
from sain_model.dynamics.physics_gradient import moves
from sain_model.dynamics.sain import (
    PARAMETER_CORRECTION,
    Again,
    Network,
    Origin,
    PhysicsPrediction,
    SainDynamics,
)
from sain_model.inference.kinds import Kind, only
from sain_model.network.corrections import Corrections, corrected_values
from sain_model.network.features import Strokes, apply_residual, network_inputs, push_frames
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.planar_config import PlanarConfig


@dataclass(frozen=True, eq=False)
class CorrectionNetwork(Network):
    """A network, or the members of an ensemble. What members predict is averaged.

    Attributes:
        module: the trained weights.
        config: of the prior that it corrects.
    """

    module: InteractionNetwork
    config: PlanarConfig

    def __post_init__(self) -> None:
        """Stop whatever networks do in training alone."""
        self.module.eval()

    def correct(self, physics: PhysicsPrediction, again: Again) -> Scenes:
        """Predict again with corrected parameters, and add the residual; see `Network`."""
        scenes, pushes, physics_next = physics.scenes, physics.pushes, physics.after
        frames = push_frames(scenes, pushes, physics.bodies)
        plain = moves(scenes, frames, physics_next)
        change = np.zeros_like(plain)
        for corrections, residual in self.corrections(physics, frames):
            corrected = again(corrected_values(corrections, pushes, self.config))
            change += moves(scenes, frames, corrected) - plain + residual
        predicted = apply_residual(physics_next, frames, change / self.members)
        idle = pushes[:, LENGTH] == 0.0
        predicted[idle] = physics_next[idle]
        fixed = list(physics.bodies.fixed)
        predicted[:, fixed] = physics_next[:, fixed]
        return predicted

    def corrections(
        self, physics: PhysicsPrediction, frames: Strokes
    ) -> list[tuple[Corrections, Float[ndarray, "B N 3"]]]:
        """Return what each member corrects, and what it adds to the prediction.

        `frames` are those of the pushes, `physics` is without corrections.
        """
        features = network_inputs(
            self.module.config,
            physics.scenes,
            frames,
            physics.after,
            physics.bodies,
            physics.values,
        )
        settle_threads()
        with torch.inference_mode():
            residual, corrections = self.module.heads(*features.tensors())
        outputs = zip(corrections.double().numpy(), residual.double().numpy(), strict=True)
        return list(outputs)


def correcting_model(module: InteractionNetwork, kind: Kind, prior_name: str = "") -> SainDynamics:
    """Return SAIN of a network on one kind of physics."""
    origin = Origin(PARAMETER_CORRECTION, prior_name)
    return SainDynamics(only(kind), CorrectionNetwork(module, kind.config), origin)
