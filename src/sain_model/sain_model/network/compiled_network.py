"""A trained network packed for the compiled kernels: how SAIN predicts on a CPU."""

from typing import Final

import numpy as np
from torch import Tensor, nn

from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Pushes, Scenes
from sain_model.compute.compiling import plain
from sain_model.compute.kernel_store import compile_visibly
from sain_model.compute.thread_pool import run_blocks
from sain_model.network.believed import network_beliefs
from sain_model.network.features import count_features, outline_table, push_frames
from sain_model.network.inputs import LANES
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.network_kernels import TILE, Weights
from sain_model.network.sain_kernels import correct_block
from sain_model.network.settings import WORLD_FRAME
from sain_model.physics.parameters import Values


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
