"""The network of SAIN, run compiled or by PyTorch: what it adds to what the physics leaves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Self

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor, nn

from sain_core.push import LENGTH, pushed_bodies
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.shapes.shape import BOTTOMS
from sain_core.types import Pushes, Scenes
from sain_model.compute.compiling import plain
from sain_model.compute.kernel_store import compile_visibly
from sain_model.compute.threads import run_blocks, settle_threads
from sain_model.dynamics.intervals import Intervals, Prediction
from sain_model.dynamics.sain import (
    LEARNED,
    RECURRENT,
    RESIDUAL,
    Network,
    Origin,
    PhysicsPrediction,
    SainDynamics,
)
from sain_model.inference.kinds import Kind, only
from sain_model.network.feature_kernels import LANES
from sain_model.network.features import (
    apply_residual,
    count_features,
    elongations,
    network_beliefs,
    network_inputs,
    outline_table,
    push_frames,
)
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.network_kernels import TILE, Weights, correct_block
from sain_model.network.settings import CPU, IDENTITY, WORLD_FRAME
from sain_model.physics.parameters import Values, check_physics_next


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


class CompiledNetwork:
    """What a network predicts, by kernels that run on all of Numba's threads.

    It agrees with PyTorch's forward pass to single precision, and with itself to the bit: on any
    number of threads, and for a push alone or in any batch.
    """

    def __init__(self, network: InteractionNetwork) -> None:
        """Take the weights as they are now."""
        compile_visibly()
        config = network.config
        relation, relation_widths = pack(network.relation)
        dynamics, dynamics_widths = pack(network.dynamics)
        unit = network.unit
        assert isinstance(unit, Tensor)
        self._config: Final = config
        self.weights: Final = Weights(
            relation,
            relation_widths,
            dynamics,
            dynamics_widths,
            int(max(relation_widths.max(), dynamics_widths.max())),
            config.message,
            count_features(config)[0],
            unit.detach().cpu().numpy().astype(np.float64),
        )

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
        corrected = np.array(physics_next, dtype=np.float64, order="C")
        frames = push_frames(scenes, pushes, bodies)
        rows = plain(scenes), plain(frames)
        believed = plain(network_beliefs(self._config, scenes, frames, values or {}))
        places = self._config.features == WORLD_FRAME
        table = outline_table(bodies.fitted(scenes.shape[1]))

        def work(first: int) -> None:
            correct_block(first, *rows, corrected, believed, table, places, self.weights)

        run_blocks(work, len(scenes), LANES)
        return corrected


def pack(layers: nn.Module) -> tuple[np.ndarray, np.ndarray]:
    """Return a perceptron as `Weights` has it: the weights (M, ...) and the widths of its layers.

    Its linear layers have weights (outputs, inputs), or (M, outputs, inputs) in an ensemble.
    """
    packed: list[np.ndarray] = []
    widths: list[int] = []
    for layer in layers.children():
        state = layer.state_dict()
        if not state:
            continue  # an activation
        weight, bias = _members(state["weight"], 2), _members(state["bias"], 1)
        members, outputs, inputs = weight.shape
        rows, columns = _padded(outputs), _padded(inputs)
        full = np.zeros((members, rows, columns), np.float32)
        full[:, :outputs, :inputs] = weight
        tiles = full.reshape(members, rows // TILE, TILE, columns // TILE, TILE)
        packed.append(tiles.transpose(0, 1, 3, 2, 4).reshape(members, -1))
        packed.append(np.pad(bias, ((0, 0), (0, rows - outputs))))
        widths += [rows] if widths else [columns, rows]
    return np.ascontiguousarray(np.concatenate(packed, axis=1)), np.array(widths)


def _members(values: Tensor, dimensions: int) -> np.ndarray:
    """Return weights or biases as (M, ...): M = 1 where there is but one network."""
    array = values.detach().cpu().numpy().astype(np.float32)
    return array if array.ndim > dimensions else array[None]


def _padded(width: int) -> int:
    return -(-width // TILE) * TILE


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

    def correct(self, physics: PhysicsPrediction) -> Scenes:
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
