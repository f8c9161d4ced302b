"""The trained weights of a network as NumPy arrays: what a model predicts with, without PyTorch."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
import safetensors.numpy
from jaxtyping import Float32
from numpy import ndarray
from safetensors import SafetensorError

from sain_core.errors import CheckpointError
from sain_model.network.dense_kernels import TILE
from sain_model.network.feature_kernels import TURN_SCALE
from sain_model.network.features import count_features
from sain_model.network.network_kernels import OUTPUTS, PackedWeights
from sain_model.network.settings import NetworkConfig

POSITION_UNIT: Final = 0.005  # [m], an output of 1; dtheta counts in TURN_SCALE
UNIT: Final = (POSITION_UNIT, POSITION_UNIT, TURN_SCALE)
RELATION: Final = "relation"  # f_rel
DYNAMICS: Final = "dynamics"  # f_dyn
# of a kernel, which takes the place of both: the features of its pushes, their scales, and outputs
CENTRES, SCALES, OUTPUTS_OF = "centres", "scales", "outputs"
TURN_ARM: Final = 0.04  # [m], on which a kernel's turn counts as a way

Tensors = dict[str, Float32[ndarray, "..."]]


@dataclass(frozen=True, eq=False)
class NetworkWeights:
    """A trained network: its size, and its weights by name."""

    config: NetworkConfig  # its size, and what it sees
    # of the linear layers of f_rel and f_dyn, named as PyTorch names them: ``relation.0.weight``
    # (outputs, inputs) and ``relation.0.bias`` (outputs,); those of an ensemble of M members have M
    # in front. Those of a kernel: ``centres`` (C, F) with all features of bodies and relations,
    # ``scales`` (F,) of these, ``outputs`` (C, 3)
    tensors: Tensors

    @property
    def centres(self) -> int:
        """The number of pushes that a kernel is about; 0: these are a network's weights."""
        return len(self.tensors.get(CENTRES, ()))

    @classmethod
    def parse(cls, config: NetworkConfig, content: bytes) -> "NetworkWeights":
        """Return the weights in the content of a safetensors file.

        Raises `CheckpointError`: they are not safetensors, of other names or shapes, or not finite.
        """
        try:
            tensors = safetensors.numpy.load(content)
        except SafetensorError as error:
            raise CheckpointError(f"it is not a safetensors file: {error}") from error
        except KeyError as error:  # a type that NumPy does not have
            kind = error.args[0]
            raise CheckpointError(f"a tensor is of type {kind}; it must be float32") from error
        expected = tensor_shapes(
            config, sum(tensors[CENTRES].shape[:1]) if CENTRES in tensors else 0
        )
        for name in sorted(expected.keys() | tensors.keys()):
            found = tuple(tensors[name].shape) if name in tensors else None
            if found != expected.get(name):
                raise CheckpointError(
                    f"tensor {name} has shape {found}; the network on its card needs"
                    f" {expected.get(name)}"
                )
            if tensors[name].dtype != np.float32:
                raise CheckpointError(
                    f"tensor {name} is of type {tensors[name].dtype}; it must be float32"
                )
            if not np.isfinite(tensors[name]).all():
                raise CheckpointError(f"tensor {name} holds NaN or Inf; it must be finite")
        return cls(config, tensors)

    def serialize(self) -> bytes:
        """Return the content of a safetensors file."""
        return safetensors.numpy.save(self.tensors)

    def member(self, number: int) -> "NetworkWeights":
        """Return the weights of one network of an ensemble."""
        tensors = {name: array[number] for name, array in self.tensors.items()}
        return NetworkWeights(replace(self.config, members=1), tensors)

    def pack(self) -> PackedWeights:
        """Return them as the kernels take them."""
        if self.centres:
            return self._packed_kernel
        relation, relation_widths = self._pack(RELATION)
        dynamics, dynamics_widths = self._pack(DYNAMICS)
        none = np.zeros((0, OUTPUTS), np.float32)
        return PackedWeights(
            relation,
            relation_widths,
            dynamics,
            dynamics_widths,
            int(max(relation_widths.max(), dynamics_widths.max())),
            self.config.message,
            count_features(self.config)[0],
            np.array(UNIT, np.float32).astype(np.float64),
            np.zeros(0, np.int64),
            none[:, 0],
            none,
            none,
        )

    @property
    def _packed_kernel(self) -> PackedWeights:
        scales, (of_body, of_relation) = self.tensors[SCALES], count_features(self.config)
        columns, nothing = np.flatnonzero(scales), np.zeros((1, 0), np.float32)
        used = np.ascontiguousarray((scales * self.tensors[CENTRES])[:, columns])
        widths = (np.array([_padded(count)]) for count in (of_relation, of_body))
        relation, body = widths
        unit = np.array([1.0, 1.0, 1.0 / TURN_ARM])
        outputs = self.tensors[OUTPUTS_OF]
        return PackedWeights(
            *(nothing, relation, nothing, body, 1, 0, of_body, unit),
            *(columns, scales[columns], used, outputs),
        )

    def _pack(self, perceptron: str) -> tuple[ndarray, ndarray]:
        """Return the weights (M, ...) of a perceptron in tiles, and the widths of its layers."""
        packed: list[ndarray] = []
        widths: list[int] = []
        for layer in range(self.config.layers + 1):
            name = f"{perceptron}.{2 * layer}"
            weight, bias = self._of_members(f"{name}.weight"), self._of_members(f"{name}.bias")
            members, outputs, inputs = weight.shape
            rows, columns = _padded(outputs), _padded(inputs)
            full = np.zeros((members, rows, columns), np.float32)
            full[:, :outputs, :inputs] = weight
            tiles = full.reshape(members, rows // TILE, TILE, columns // TILE, TILE)
            packed.append(tiles.transpose(0, 1, 3, 2, 4).reshape(members, -1))
            packed.append(np.pad(bias, ((0, 0), (0, rows - outputs))))
            widths += [rows] if widths else [columns, rows]
        return np.ascontiguousarray(np.concatenate(packed, axis=1)), np.array(widths)

    def _of_members(self, name: str) -> ndarray:
        """Return a tensor as (M, ...): M = 1 where there is but one network."""
        array = self.tensors[name]
        return array if self.config.members > 1 else array[None]


def tensor_shapes(config: NetworkConfig, centres: int = 0) -> dict[str, tuple[int, ...]]:
    """Return the shape of each tensor of a network, or of a kernel on so many pushes, by name."""
    of_body, of_relation = count_features(config)
    if centres:
        size = of_body + of_relation
        return {CENTRES: (centres, size), SCALES: (size,), OUTPUTS_OF: (centres, OUTPUTS)}
    hidden = [config.hidden] * config.layers
    widths = {
        RELATION: [of_relation, *hidden, config.message],
        DYNAMICS: [of_body + config.message, *hidden, OUTPUTS],
    }
    of_members = () if config.members == 1 else (config.members,)
    shapes: dict[str, tuple[int, ...]] = {}
    for perceptron, row in widths.items():
        for layer, (inputs, outputs) in enumerate(pairwise(row)):
            shapes[f"{perceptron}.{2 * layer}.weight"] = (*of_members, outputs, inputs)
            shapes[f"{perceptron}.{2 * layer}.bias"] = (*of_members, outputs)
    return shapes


def untrained(config: NetworkConfig) -> NetworkWeights:
    """Return weights of zero: a network that leaves the physics as it is."""
    shapes = tensor_shapes(config).items()
    return NetworkWeights(config, {name: np.zeros(shape, np.float32) for name, shape in shapes})


def _padded(width: int) -> int:
    return -(-width // TILE) * TILE
