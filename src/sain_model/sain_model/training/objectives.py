"""What a network learns: single pushes, Algorithm 1's phase II; or its own rollouts, equation 5.

Rollouts of a network on a prior that it can learn from: the paper's equations 3 and 4.

The prior is compiled and its contacts are not smooth: no automatic differentiation passes through
it. A loss on a later step reaches an earlier one by finite differences of prior and features
together (docs/explanation/rollouts.md). The prior goes on from the corrected scene.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, NamedTuple, Self

import numpy as np
import torch
from jaxtyping import Float, Int
from numpy import ndarray
from torch import Tensor
from torch.nn import functional

from sain_core.model import Model
from sain_core.push import LENGTH, LOCATION
from sain_core.scene import POSE, THETA, VELOCITY, unit, wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Pushes, Scenes
from sain_model.compute.threads import one_numba_thread, settle_threads
from sain_model.data.dataset import Dataset, Part, Split, Windows, make_windows
from sain_model.dynamics.sain import SainDynamics, trained_belief
from sain_model.evaluation.errors import inferred_rows
from sain_model.inference.evidence import Known, grid_values
from sain_model.inference.kinds import Belief, Kind
from sain_model.network.feature_kernels import GAP_AFTER, GAP_BEFORE, MIRRORED_RELATION
from sain_model.network.features import (
    mirrored_columns,
    network_inputs,
    push_frames,
    true_residual,
)
from sain_model.network.interaction_network import CHUNK, InteractionNetwork, as_tensors
from sain_model.network.settings import NetworkConfig
from sain_model.physics.parameters import Values
from sain_model.physics.planar import step_knowing
from sain_model.training.settings import TrainingConfig
from sain_model.training.trainer import LearningObjective

STEPS: Final = (2e-4, 2e-4, 2e-3)  # [m, m, rad], of the finite differences: well above rounding

Look = Callable[[Scenes, Pushes, ndarray], tuple[ndarray, ...]]
"""Returns what is seen in scenes with pushes, which are these rows of the batch."""


def roll(
    network: InteractionNetwork,
    windows: Windows,
    prior: Model,
    values: Values | None = None,
    bodies: Bodies = PAPER_DISKS,
) -> Float[Tensor, "W T N 3"]:
    """Return the poses that a network predicts over windows, fed with its own predictions.

    `values` (W, T) by name are those of the prior's parameters that differ from its settings.
    `prior` predicts these bodies.
    """
    pose = torch.from_numpy(windows.scenes[..., POSE])
    poses = []
    for step in range(windows.steps):
        pushes = windows.pushes[:, step]
        now = {name: value[:, step] for name, value in (values or {}).items()}
        look = partial(_look, prior, now, network.config, bodies)
        seen = see(pose, windows.scenes, pushes, look)
        settle_threads()
        residual = network(seen.bodies, seen.relations).double()
        moved = seen.moved + _into_world(residual, seen.heading)
        idle = torch.from_numpy(pushes[:, LENGTH] == 0.0)[:, None, None]
        pose = pose + moved.masked_fill(idle, 0.0)
        poses.append(pose)
    return torch.stack(poses, dim=1)


def _into_world(
    residual: Float[Tensor, "B N 3"], heading: Float[Tensor, "B 2"]
) -> Float[Tensor, "B N 3"]:
    """Turn residuals out of the frame of the push, given by cos and sin of its heading."""
    cos, sin = heading[:, :1], heading[:, 1:]
    x, y, turn = residual.unbind(-1)
    return torch.stack([cos * x - sin * y, sin * x + cos * y, turn], dim=-1)


class Seen(NamedTuple):
    """Network inputs and how the prior moves the disks, for B pushes."""

    bodies: Float[Tensor, "B N D"]
    relations: Float[Tensor, "B E R"]
    moved: Float[Tensor, "B N 3"]  # dx, dy [m], dtheta [rad], in the world
    heading: Float[Tensor, "B 2"]  # cos and sin of the frame of the push


def see(pose: Float[Tensor, "B N 3"], scenes: Scenes, pushes: Pushes, look: Look) -> Seen:
    """Return what the network sees in scenes with the poses of disks that were predicted so far.

    What is returned depends on the poses by derivatives, too. Those in the scenes do not count.
    """
    scenes = scenes.copy()
    scenes[..., POSE] = pose.detach().numpy()
    scenes[..., THETA] = wrap_angle(scenes[..., THETA])
    rows = np.arange(len(scenes))
    parts = look(scenes, pushes, rows)
    values = torch.from_numpy(_flat(parts))
    if pose.requires_grad:
        slopes = torch.from_numpy(_slopes(scenes, pushes, look, _flat(parts)))
        values = _Linearised.apply(pose, values, slopes)
    split = values.split([part[0].size for part in parts], dim=1)
    bodies, relations, moved, heading = (
        value.view(part.shape) for value, part in zip(split, parts, strict=True)
    )
    return Seen(bodies.float(), relations.float(), moved, heading)


def _look(
    prior: Model,
    values: Values,
    config: NetworkConfig,
    shapes: Bodies,
    scenes: Scenes,
    pushes: Pushes,
    rows: ndarray,
) -> tuple[ndarray, ...]:
    here = {name: value[rows] for name, value in values.items()}
    physics_next = step_knowing(prior, scenes, pushes, here)
    frames = push_frames(scenes, pushes, shapes)
    features = network_inputs(config, scenes, frames, physics_next, shapes)
    moved = physics_next[..., POSE] - scenes[..., POSE]
    moved[..., THETA] = wrap_angle(moved[..., THETA])
    return features.bodies, features.relations, moved, unit(frames[:, LOCATION])


def _flat(parts: tuple[ndarray, ...]) -> Float[ndarray, "B V"]:
    return np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1)


def _slopes(
    scenes: Scenes, pushes: Pushes, look: Look, values: Float[ndarray, "B V"]
) -> Float[ndarray, "B V P"]:
    """Return the derivative of all that is seen by each of the P = 3 N numbers of the poses."""
    batch, disks, _ = scenes.shape
    count = 3 * disks
    nudged = np.repeat(scenes[None], count, axis=0)  # (P, B, N, 8)
    for disk in range(disks):
        for column, step in enumerate(STEPS):
            nudged[3 * disk + column, :, disk, column] += step
    rows = np.tile(np.arange(batch), count)
    seen = _flat(look(nudged.reshape(-1, *scenes.shape[1:]), pushes[rows], rows)).reshape(
        count, batch, -1
    )
    steps = np.tile(STEPS, disks)[:, None, None]
    return np.ascontiguousarray(((seen - values) / steps).transpose(1, 2, 0))


class _Linearised(torch.autograd.Function):
    """Passes values on, and their gradients back by given slopes."""

    @staticmethod
    def forward(ctx: Any, pose: Tensor, values: Tensor, slopes: Tensor) -> Tensor:
        ctx.save_for_backward(slopes)
        ctx.shape = pose.shape
        return values.clone()

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None]:
        (slopes,) = ctx.saved_tensors
        return torch.einsum("bv,bvp->bp", gradient, slopes).view(ctx.shape), None, None


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
        receiver, sender = np.divmod(
            np.arange(bodies * bodies), bodies
        )  # the tool is the body itself
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
    return _examples_on(data, physics_next, values, network)


def _examples_as_used(data: Part, belief: Belief, network: NetworkConfig) -> Examples:
    """Return examples on the physics that the earlier pushes of each push's episode show."""
    model = SainDynamics(belief, bodies=data.bodies)
    rows = inferred_rows(model, data)
    physics_next = rows.step(data.bodies, data.state, data.action)
    return _examples_on(data, physics_next, rows.believed(), network)


def _examples_on(
    data: Part, physics_next: Scenes, values: Values | None, network: NetworkConfig
) -> Examples:
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
    found = grid_values(kind, data, Known.others(data.episode))
    return found | dict(data.given or {})


def examples_of(
    data: Dataset, kind: Kind, config: TrainingConfig, mirror: bool = False
) -> Examples:
    """Return the examples of all parts together, padded to the most bodies."""
    network, most = config.network, max(part.disks for part in data.parts)
    belief = trained_belief(kind, config.history)
    examples = [
        (
            _examples_as_used(part, belief, network)
            if len(belief.kinds) > 1
            else make_examples(part, kind.prior, inferred_values(part, kind), network)
        ).padded(most)
        for part in data.parts
    ]
    images = [some.mirrored(network) for some in examples] if mirror else []
    return examples[0].and_then(*examples[1:], *images)


class SinglePushes(LearningObjective):
    """Algorithm 1's loss of single pushes, each member on rows of its own."""

    def __init__(self, split: Split, kind: Kind, config: TrainingConfig) -> None:
        self.members = config.network.members
        self.identity = f"{split.train.sha256} {len(split.train)} {kind.identity}"
        self._config = config
        self._train = examples_of(split.train, kind, config, config.mirrors)
        self._validation = examples_of(split.validation, kind, config)
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

    max_grad_norm = 1.0

    def __init__(self, split: Split, kind: Kind, config: TrainingConfig) -> None:
        """Prepare the windows; raises `DatasetError`: scenes with different bodies."""
        self.identity = f"{split.train.sha256} {len(split.train)} {kind.identity}"
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
