"""The network of SAIN: what it adds to what the physics leaves, and regions about predictions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LENGTH, pushed_bodies
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.shape import BOTTOMS
from sain_core.types import Pushes, Scenes
from sain_model.compute.batch_checks import check_physics_next
from sain_model.compute.devices import CPU
from sain_model.compute.threads import settle_threads
from sain_model.dynamics.intervals import Intervals, Prediction
from sain_model.dynamics.sain import (
    LEARNED,
    RECURRENT,
    RESIDUAL,
    Again,
    Network,
    Origin,
    PhysicsPrediction,
    SainDynamics,
)
from sain_model.dynamics.settings import IDENTITY
from sain_model.inference.kinds import Kind, only
from sain_model.network.compiled_network import CompiledNetwork
from sain_model.network.features import elongations, network_inputs, push_frames
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.torch_network import TorchNetwork


@dataclass(frozen=True, eq=False)
class ResidualNetwork(Network):
    """f_theta of the paper's equation 2.

    Attributes:
        module: the trained weights.
        intervals: the regions of predictions; None: they were not fitted.
        device: what it runs on, ``cpu`` or ``cuda``.
        bottoms: of the bodies that it learned from.
    """

    module: InteractionNetwork
    intervals: Intervals | None = None
    device: str = CPU
    bottoms: tuple[str, ...] = BOTTOMS

    def __post_init__(self) -> None:
        """Stop whatever a network does in training alone."""
        self.module.eval()

    @cached_property
    def _forward(self) -> CompiledNetwork | TorchNetwork:
        """The network as it runs here; its weights are read at the first prediction."""
        if self.device == CPU:
            return CompiledNetwork(self.module)
        return TorchNetwork(self.module, self.device)

    def on(self, device: str) -> Self:
        """Return the network on a device, ``cpu`` or ``cuda``."""
        return self if device == self.device else replace(self, device=device)

    def correct(self, physics: PhysicsPrediction, again: Again) -> Scenes:
        """Add the residual; see `Network`."""
        check_physics_next(physics.scenes, physics.after)
        corrected = self._forward.correct(
            physics.scenes, physics.pushes, physics.after, physics.bodies, physics.values
        )
        if fixed := list(physics.bodies.fixed):
            corrected[:, fixed] = physics.after[:, fixed]
        return corrected

    def spread(self, physics: PhysicsPrediction) -> Float[ndarray, "B N"]:
        """Return the standard deviation of the members' places [m]; 0 for a lone network."""
        scenes, pushes = physics.scenes, physics.pushes
        if self.members == 1:
            return np.zeros(scenes.shape[:2])
        settle_threads()
        config, frames = self.module.config, push_frames(scenes, pushes, physics.bodies)
        features = network_inputs(
            config, scenes, frames, physics.after, physics.bodies, physics.values
        )
        with torch.inference_mode():
            module = self.module.to(self.device)
            each = module.each(*features.tensors(self.device))[..., :2]
        variance = each.double().var(dim=0).sum(dim=-1)  # (B, N), in any frame
        return np.where(pushes[:, LENGTH, None] == 0.0, 0.0, variance.sqrt().cpu().numpy())

    def with_regions(
        self, prediction: Prediction, scenes: Scenes, pushes: Pushes, bodies: Bodies
    ) -> Prediction:
        """Return a prediction with the regions of bodies; without, where none were fitted."""
        if self.intervals is None:
            return prediction
        long = elongations(bodies.fitted(scenes.shape[1]))
        return self.intervals.about(prediction, scenes, pushed_bodies(pushes), long)


def residual_model(
    module: InteractionNetwork,
    kind: Kind,
    prior_name: str,
    intervals: Intervals | None = None,
    recurrent: bool = False,
    bottoms: Sequence[str] = BOTTOMS,
) -> SainDynamics:
    """Return SAIN of a network that was trained on one kind of physics, and on such bodies."""
    name = RECURRENT if recurrent else RESIDUAL
    origin = Origin(LEARNED if prior_name == IDENTITY else name, prior_name)
    return SainDynamics(
        only(kind), ResidualNetwork(module, intervals, bottoms=tuple(bottoms)), origin
    )


def with_intervals(model: SainDynamics, intervals: Intervals) -> SainDynamics:
    """Return a model with regions about its predictions."""
    assert isinstance(model.network, ResidualNetwork)
    return replace(model, network=replace(model.network, intervals=intervals))


def module_of(model: SainDynamics) -> InteractionNetwork:
    """Return the weights of a model's network."""
    assert model.network is not None
    return model.network.module
