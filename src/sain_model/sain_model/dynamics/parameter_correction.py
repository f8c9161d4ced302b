"""SAIN whose network corrects physical parameters: physics computes the consequences.

    s' = f_p(s, a, c) + f_theta,   (c, f_theta) = network(f_p(s, a), s, a)

The paper's equation 2 adds a residual to what physics predicts. Here the network first corrects
parameters of physics (`network.corrections`), so that physics computes what a slope or a mass off
the middle does to this push. The network adds a residual to that.
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, Self

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray

from sain_core.history import PushHistory
from sain_core.model import Model
from sain_core.push import LENGTH
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Pushes, Scenes
from sain_model.compute.devices import CPU
from sain_model.compute.threads import settle_threads
from sain_model.dynamics.physics_gradient import moves
from sain_model.network.corrections import Corrections, corrected_values
from sain_model.network.features import Strokes, apply_residual, network_inputs, push_frames
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.physics.friction import FrictionConfig, FrictionFilter
from sain_model.physics.parameters import Values
from sain_model.physics.planar import PlanarPrior

PARAMETER_CORRECTION: Final = "parameter_correction"


@dataclass(frozen=True, eq=False)
class ParameterCorrection(Model):
    """A network, or the members of an ensemble, on one prior.

    What members predict is averaged. Attributes are called as those of `SainDynamics`.
    """

    network: InteractionNetwork
    prior: PlanarPrior
    prior_name: str = ""
    model_hash: str = ""
    card: str = ""
    friction: FrictionConfig | None = None
    bodies: Bodies = PAPER_DISKS
    kind: ClassVar[str] = PARAMETER_CORRECTION
    device: ClassVar[str] = CPU  # it is small, and its prior runs nowhere else

    def __post_init__(self) -> None:
        """Stop whatever networks do in training alone."""
        self.network.eval()

    @property
    def filter(self) -> FrictionFilter | None:
        """What infers the friction that the prior is told; None: this model learns nothing."""
        return None if self.friction is None else self.prior.filter(self.friction)

    def condition(self, history: PushHistory) -> Self:
        """Return this model on the friction that an episode's earlier pushes tell of.

        It is the model itself without pushes, and where it was not trained to learn from them.
        """
        friction = self.filter
        if friction is None or len(history) == 0:
            return self
        return replace(self, prior=self.prior.at(friction.infer(history).mean))

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the model of scenes of these bodies."""
        return replace(self, prior=self.prior.with_bodies(bodies), bodies=bodies)

    def step(self, scenes: Scenes, pushes: Pushes, values: Values | None = None) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, 3 or 4) from scenes (B, N, 8).

        A push of length 0 leaves the scene unchanged, bit for bit; so do fixed bodies. `values`
        are those of the prior's parameters that differ from its settings.
        """
        values = values or {}
        physics_next = self.prior.step(scenes, pushes, values)
        frames = push_frames(scenes, pushes, self.bodies)
        plain = moves(scenes, frames, physics_next)
        change = np.zeros_like(plain)
        for corrections, residual in self.corrections(scenes, frames, physics_next):
            corrected = corrected_values(corrections, pushes, self.prior.config)
            told = self.prior.step(scenes, pushes, {**values, **corrected})
            change += moves(scenes, frames, told) - plain + residual
        predicted = apply_residual(physics_next, frames, change / self.network.config.members)
        idle = pushes[:, LENGTH] == 0.0
        predicted[idle] = physics_next[idle]
        fixed = list(self.bodies.fixed)
        predicted[:, fixed] = physics_next[:, fixed]
        return predicted

    def corrections(
        self, scenes: Scenes, frames: Strokes, physics_next: Scenes
    ) -> list[tuple[Corrections, Float[ndarray, "B N 3"]]]:
        """Return what each network corrects, and what it adds to the prediction.

        `frames` are those of the pushes, `physics_next` is what the uncorrected prior predicts.
        """
        config = self.network.config
        features = network_inputs(config, scenes, frames, physics_next, self.bodies)
        settle_threads()
        with torch.inference_mode():
            residual, corrections = self.network.heads(*features.tensors())
        outputs = zip(corrections.double().numpy(), residual.double().numpy(), strict=True)
        return list(outputs)
