"""SAIN whose network corrects physical parameters: physics computes the consequences.

    s' = f_p(s, a, c) + f_theta,   (c, f_theta) = network(f_p(s, a), s, a)

The paper's equation 2 adds a residual to what physics predicts. Here the network first corrects
parameters of physics, so that physics computes what a slope or a mass off the middle does to this
push. The network adds a residual to that.

To learn that, the planar prior is a step of the network: forward it simulates, backward it
simulates variations. Contacts begin and end, so a push has no derivative everywhere. A difference
over a tenth of a correction's unit has one: how the push answers to a correction that large.
"""

from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Self

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor

from sain_core.push import LENGTH, pushed_bodies
from sain_core.types import Indices, Pushes, Scenes
from sain_model.compute.threads import settle_threads
from sain_model.dynamics.sain import (
    PARAMETER_CORRECTION,
    Again,
    Network,
    Origin,
    PhysicsPrediction,
    SainDynamics,
)
from sain_model.inference.kinds import Kind, only
from sain_model.network.feature_kernels import TURN_SCALE
from sain_model.network.features import (
    Strokes,
    apply_residual,
    network_inputs,
    push_frames,
    true_residual,
)
from sain_model.network.interaction_network import (
    CORRECTIONS,
    OF_DISKS,
    Corrections,
    InteractionNetwork,
    corrected_values,
)
from sain_model.physics.parameters import PlanarConfig, Values
from sain_model.physics.planar import PlanarPrior

VARIATION: Final = 0.1  # of a correction, in its unit
STEEPEST: Final = np.array([0.1, 0.1, 20 * TURN_SCALE])  # [m, m, rad] a unit; more is a miss


class ToldPushes(NamedTuple):
    """Pushes on a prior, as corrections change them.

    Attributes:
        prior: told the bodies.
        scenes: before the pushes.
        pushes: one a scene.
        frames: of the pushes, as `network.features.push_frames` makes them.
        values: of the prior's parameters that differ from its settings, (B,) by name.
    """

    prior: PlanarPrior
    scenes: Scenes
    pushes: Pushes
    frames: Strokes
    values: Values

    def moves(self, corrections: Corrections) -> Float[ndarray, "B N 3"]:
        """Return the moves that the prior predicts when told corrections (B, N, C)."""
        corrected = corrected_values(corrections, self.pushes, self.prior.config)
        values = {**self.values, **corrected}
        return moves(self.scenes, self.frames, self.prior.step(self.scenes, self.pushes, values))

    def repeated(self, times: int) -> Self:
        """Return the pushes so many times, one after the other."""
        rows = np.tile(np.arange(len(self.pushes)), times)
        return self.select(rows)

    def select(self, rows: Indices) -> Self:
        """Return the pushes in these rows."""
        values = {name: value[rows] for name, value in self.values.items()}
        arrays = self.scenes[rows], self.pushes[rows], self.frames[rows]
        return type(self)(self.prior, *arrays, values)


def moves(scenes: Scenes, frames: Strokes, after: Scenes) -> Float[ndarray, "B N 3"]:
    """Return how far each body goes along the push and across it [m], and turns [rad]."""
    return true_residual(after, frames, scenes)  # that of a prior in which nothing moves


def conditioned_moves(
    corrections: Float[Tensor, "B N C"], pushes: ToldPushes
) -> Float[Tensor, "B N 3"]:
    """Return the moves that a prior predicts when told corrections; gradients flow to those."""
    result: Tensor = _ConditionedMoves.apply(corrections, pushes)
    return result


class _ConditionedMoves(torch.autograd.Function):
    """`conditioned_moves`, forward and backward."""

    @staticmethod
    def forward(context: Any, corrections: Tensor, pushes: ToldPushes) -> Tensor:
        told = corrections.detach().numpy().astype(np.float64)
        after = pushes.moves(told)
        context.push = (told, pushes, after)
        return torch.from_numpy(after.astype(np.float32))

    @staticmethod
    def backward(context: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        slopes = variations(*context.push)
        total = np.einsum("bncdm,bdm->bnc", slopes, gradients[0].numpy())
        return torch.from_numpy(total.astype(np.float32)), None


def variations(
    told: Corrections, pushes: ToldPushes, after: Float[ndarray, "B N 3"]
) -> Float[ndarray, "B N C N 3"]:
    """Return by how much the moves of all bodies change with each correction of each body."""
    batch, count, _ = pushes.scenes.shape
    rows, pushed = np.arange(batch), pushed_bodies(pushes.pushes)
    which = [(np.full(batch, body), c) for body in range(count) for c in range(OF_DISKS)]
    which += [(pushed, c) for c in range(OF_DISKS, CORRECTIONS)]
    many = len(which)
    varied = np.repeat(told[None], many, axis=0)
    for row, (bodies, column) in enumerate(which):
        varied[row, rows, bodies, column] += VARIATION
    ends = pushes.repeated(many).moves(varied.reshape(many * batch, count, CORRECTIONS))
    change = (ends.reshape(many, batch, count, 3) - after) / VARIATION
    slopes = np.zeros((batch, count, CORRECTIONS, count, 3))
    for row, (bodies, column) in enumerate(which):
        slopes[rows, bodies, column] = np.clip(change[row], -STEEPEST, STEEPEST)
    return slopes


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
