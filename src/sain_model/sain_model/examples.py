"""What a network learns from: its inputs and what it should say, for pushes on a prior."""

import functools
from dataclasses import dataclass
from typing import Self

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from sain_core.dynamics import Dynamics
from sain_core.scene import VELOCITY
from sain_core.types import Scalars
from sain_model.dataset import Transitions
from sain_model.features import PUSH_FRAME, make_features, true_residual
from sain_model.friction import FrictionFilter
from sain_model.planar import PlanarPrior


@dataclass(frozen=True)
class Examples:
    """Network inputs and what it should say, for M pushes."""

    disks: Float[Tensor, "M N D"]
    relations: Float[Tensor, "M E R"]
    residual: Float[Tensor, "M N 3"]
    velocity: Float[Tensor, "M N 3"]  # error of the prior's velocity, which no network changes

    def __len__(self) -> int:
        """Return the number of pushes M."""
        return len(self.disks)

    def and_then(self, others: Self) -> Self:
        """Return these examples and others."""
        return type(self)(
            torch.cat([self.disks, others.disks]),
            torch.cat([self.relations, others.relations]),
            torch.cat([self.residual, others.residual]),
            torch.cat([self.velocity, others.velocity]),
        )


def make_examples(
    data: Transitions, prior: Dynamics, friction: Scalars | None = None, frame: str = PUSH_FRAME
) -> Examples:
    """Return inputs and outputs for these transitions on a prior.

    Args:
        data: M pushes.
        prior: what is corrected.
        friction: what the planar prior is told (M,); None: the nominal one.
        frame: what the inputs know of the world (`sain_model.features`).
    """
    if friction is not None and isinstance(prior, PlanarPrior):
        physics_next = prior.step(data.scenes, data.pushes, friction)
    else:
        physics_next = prior.step(data.scenes, data.pushes)
    features = make_features(data.scenes, data.pushes, physics_next, frame)
    velocity = data.next_scenes[..., VELOCITY] - physics_next[..., VELOCITY]
    arrays = (
        features.disks,
        features.relations,
        true_residual(data.next_scenes, data.pushes, physics_next),
        velocity,
    )
    return Examples(*(torch.from_numpy(array.astype(np.float32)) for array in arrays))


def training_examples(
    data: Transitions,
    prior: Dynamics,
    friction: FrictionFilter | None,
    mirror: bool,
    random: np.random.Generator | None = None,
    frame: str = PUSH_FRAME,
) -> Examples:
    """Return what to learn from: the pushes and, if wanted, their mirror images.

    Args:
        data: M pushes.
        prior: what is corrected.
        friction: infers the friction that the prior is told; None: it is the nominal one.
        mirror: whether to add the mirror images.
        random: given, the prior is told what the latest few of the *earlier* pushes show, and
            this draws how many; else what all *other* pushes of the episode show.
        frame: what the inputs know of the world (`sain_model.features`).
    """
    views = [data, data.mirrored()] if mirror else [data]
    if friction is None:
        return _joined([make_examples(view, prior, None, frame) for view in views])
    likelihood = friction.log_likelihood(data.scenes, data.pushes, data.next_scenes)

    def told() -> Scalars:
        if random is None:
            return friction.others(likelihood, data.episodes).mean
        known = friction.earlier(likelihood, data.episodes, data.steps)
        fewer = random.integers(known.pushes + 1)
        return friction.earlier(likelihood, data.episodes, data.steps, fewer).mean

    return _joined([make_examples(view, prior, told(), frame) for view in views])


def _joined(examples: list[Examples]) -> Examples:
    return functools.reduce(Examples.and_then, examples)
