"""What a network learns: single pushes, Algorithm 1's phase II; or its own rollouts, equation 5."""

import functools
from dataclasses import dataclass
from typing import Final, Self

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn import functional

from sain_core.model import Model
from sain_core.scene import POSE, VELOCITY
from sain_model.compute.threads import one_numba_thread
from sain_model.data.dataset import Dataset, Part, Split
from sain_model.data.windows import Windows, make_windows
from sain_model.inference.evidence import Known, grid_values
from sain_model.inference.kinds import Kind
from sain_model.network.feature_kernels import GAP_AFTER, GAP_BEFORE, MIRRORED_RELATION
from sain_model.network.features import (
    mirrored_columns,
    network_inputs,
    push_frames,
    relation_ends,
    true_residual,
)
from sain_model.network.interaction_network import CHUNK, InteractionNetwork, as_tensors
from sain_model.network.settings import NetworkConfig
from sain_model.physics.parameters import Values
from sain_model.physics.planar import step_knowing
from sain_model.training.rollouts import roll
from sain_model.training.settings import TrainingConfig
from sain_model.training.trainer import LearningObjective

MIRRORED_MOTION: Final = (1, 2)  # across the push, and the turn


@dataclass(frozen=True)
class Examples:
    """Network inputs and what it should say, for M pushes."""

    bodies: Float[Tensor, "M N D"]
    relations: Float[Tensor, "M E R"]
    residual: Float[Tensor, "M N 3"]
    velocity: Float[Tensor, "M N 3"]  # error of the prior's velocity, which no network changes

    def __len__(self) -> int:
        return len(self.bodies)

    def padded(self, bodies: int) -> Self:
        """Return examples with so many bodies, those that are missing far from all others.

        A body that is far away tells others nothing, to the bit (`InteractionNetwork`): the
        network says the same of the bodies that exist. Of the others it should say zero.
        """
        count = self.bodies.shape[1]
        if count == bodies:
            return self
        receiver, sender = relation_ends(bodies)
        exist = torch.from_numpy((receiver < count) & (sender < count))
        relations = self.relations.new_zeros(len(self), len(exist), self.relations.shape[2])
        relations[..., [GAP_BEFORE, GAP_AFTER]] = 1.0
        relations[:, exist] = self.relations
        missing = (0, 0, 0, bodies - count)
        return type(self)(
            functional.pad(self.bodies, missing),
            relations,
            functional.pad(self.residual, missing),
            functional.pad(self.velocity, missing),
        )

    def mirrored(self, network: NetworkConfig = NetworkConfig()) -> Self:
        """Return the mirror images of examples for a network in the push frame: signs change."""
        flipped = {
            "bodies": mirrored_columns(network),
            "relations": MIRRORED_RELATION,
            "residual": MIRRORED_MOTION,
            "velocity": MIRRORED_MOTION,
        }
        tensors = {name: tensor.clone() for name, tensor in vars(self).items()}
        for name, columns in flipped.items():
            tensors[name][..., list(columns)] *= -1.0
        return type(self)(**tensors)

    def and_then(self, *others: Self) -> Self:
        """Return these examples and others."""
        joined = {
            name: torch.cat([tensor, *(getattr(other, name) for other in others)])
            for name, tensor in vars(self).items()
        }
        return type(self)(**joined)


def make_examples(
    data: Part, prior: Model, values: Values | None = None, network: NetworkConfig = NetworkConfig()
) -> Examples:
    """Return inputs and outputs for these transitions on a prior.

    `values` (M,) are those of the prior's parameters that differ from its settings. `network` says
    which features there are.
    """
    prior_here = prior.with_bodies(data.bodies)
    physics_next = step_knowing(prior_here, data.state, data.action, values)
    frames = push_frames(data.state, data.action, data.bodies)
    features = network_inputs(network, data.state, frames, physics_next, data.bodies, values)
    velocity = data.next_state[..., VELOCITY] - physics_next[..., VELOCITY]
    targets = (true_residual(data.next_state, frames, physics_next), velocity)
    labels = (torch.from_numpy(array.astype(np.float32)) for array in targets)
    return Examples(*as_tensors(features), *labels)


def inferred_values(data: Part, kind: Kind) -> Values:
    """Return values (M,) of a kind's parameters that all other pushes of an episode show, by name.

    Values that the data give are as given.
    """
    found = grid_values(kind, data.observed, Known.others(data.episode))
    return found | dict(data.given or {})


def _identity(split: Split, kind: Kind) -> str:
    return f"{split.train.sha256} {len(split.train)} {kind.identity}"


def _examples_of(
    data: Dataset, kind: Kind, config: TrainingConfig, mirror: bool = False
) -> Examples:
    """Return the examples of all parts together, padded to the most bodies."""
    network, most = config.network, max(part.disks for part in data.parts)
    examples = [
        make_examples(part, kind.prior, inferred_values(part, kind), network).padded(most)
        for part in data.parts
    ]
    images = [some.mirrored(network) for some in examples] if mirror else []
    return examples[0].and_then(*examples[1:], *images)


class SinglePushes(LearningObjective):
    """Algorithm 1's loss of single pushes, each member on rows of its own."""

    def __init__(self, split: Split, kind: Kind, config: TrainingConfig) -> None:
        self.identity, self.members = _identity(split, kind), config.network.members
        self._config = config
        self._train = _examples_of(split.train, kind, config, config.mirrors)
        self._validation = _examples_of(split.validation, kind, config)
        copies = len(self._train) // len(split.train)  # with mirror images two
        self.episodes = np.tile(split.train.episode, copies)

    def losses(self, network: InteractionNetwork, rows: Int[Tensor, "M b"]) -> Float[Tensor, "M"]:
        """Return every member's loss."""
        data = self._train
        predicted = network.each(data.bodies[rows], data.relations[rows])
        return mixed_loss(predicted, data, rows, self._config)

    def validate(self, network: InteractionNetwork) -> float:
        """Return the loss of the members' mean."""
        data = self._validation
        parts = zip(data.bodies.split(CHUNK), data.relations.split(CHUNK), strict=True)
        said = torch.cat([network.each(*part).mean(dim=0) for part in parts])
        return mixed_loss(said, data, torch.arange(len(data)), self._config).item()


class Rollouts(LearningObjective):
    """Algorithm 1's loss of rollouts of the network's own predictions."""

    def __init__(self, split: Split, kind: Kind, config: TrainingConfig) -> None:
        """Prepare the windows.

        Raises:
            DatasetError: scenes with different bodies.
        """
        self.identity = _identity(split, kind)
        train, validation = split.train.alike, split.validation.alike
        self._bodies, self._config = train.bodies, config
        self._prior = kind.prior.with_bodies(train.bodies)
        self._train = make_windows(train, config.steps_ahead)
        if config.mirrors and train.bodies.all_round:
            image = make_windows(train.mirrored(), config.steps_ahead)
            self._train = self._train.and_then(image)
        self._validation = make_windows(validation, config.steps_ahead)
        self._values = [inferred_values(part, kind) for part in (train, validation)]
        self.episodes = self._train.episodes

    def losses(self, network: InteractionNetwork, rows: Int[Tensor, "M b"]) -> Tensor:
        """Return the loss of the members' mean."""
        windows = self._train.select(rows[0].numpy())
        return self._rollout_loss(network, windows, self._values[0])

    def validate(self, network: InteractionNetwork) -> float:
        """Return the loss of the members' mean."""
        return self._rollout_loss(network, self._validation, self._values[1]).item()

    def _rollout_loss(
        self, network: InteractionNetwork, windows: Windows, values: Values
    ) -> Tensor:
        # Behind a window's end nothing is pushed: any values will do.
        given = {name: value[windows.rows] for name, value in values.items()}
        with one_numba_thread():
            poses = roll(network, windows, self._prior, given, self._bodies)
        return rollout_loss(poses, windows, self._config)


# --- the loss of Algorithm 1, line 17, and its sum over rollouts, equation 5 ----------------------


def mixed_loss(
    predicted: Float[Tensor, "*M B N 3"], examples: Examples, rows: Tensor, config: TrainingConfig
) -> Float[Tensor, "*M"]:
    """Return Algorithm 1's loss of batches: position, velocity, sine and cosine of the heading.

    It is a function of what is left of the residual alone: distances do not depend on the frame,
    and |sin a - sin b|^2 + |cos a - cos b|^2 = 2 - 2 cos(a - b).
    """
    missing = examples.residual[rows] - predicted
    position, heading = _pose_squares(missing, config)
    velocity = (examples.velocity[rows] / config.velocity_scale).square().sum(-1)
    squares = [position, velocity, heading]
    return _total(squares, config).mean(dim=(-2, -1))


def rollout_loss(
    poses: Float[Tensor, "W T N 3"], windows: Windows, config: TrainingConfig
) -> Tensor:
    """Return Algorithm 1's loss, a mean over all pushes of the windows: equation 5's sum.

    Velocities are left out: scenes are settled, and no network changes them.
    """
    missing = torch.from_numpy(windows.next_scenes[..., POSE]) - poses
    known = torch.from_numpy(windows.known)
    return _total(_pose_squares(missing, config), config).mean(dim=-1)[known].mean()


def _pose_squares(missing: Float[Tensor, "*B 3"], config: TrainingConfig) -> list[Tensor]:
    return [
        (missing[..., :2] / config.position_scale).square().sum(-1),
        (2.0 - 2.0 * torch.cos(missing[..., 2])) / config.heading_scale**2,
    ]


def _total(squares: list[Tensor], config: TrainingConfig) -> Tensor:
    if config.robust:
        squares = [2.0 * (torch.sqrt(1.0 + square) - 1.0) for square in squares]
    return functools.reduce(torch.add, squares)
