"""The one contract of everything that predicts a push, and its rollouts.

The four kinds of the paper's Fig. 1 all are a `Dynamics`; planner, evaluation and service take
any of them. One step is one whole push, from settled scene to settled scene.
"""

from math import log
from typing import Final, Protocol, Self, runtime_checkable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import ConfigError
from sain_core.push import LENGTH
from sain_core.shapes.bodies import Bodies
from sain_core.types import PredictedScenes, Pushes, PushSequences, Scene, Scenes

Radii = Float[ndarray, "K H N"]

REGION_STD: Final = (-2.0 * log(0.1)) ** 0.5  # radius over standard deviation of a 90 % circle


@runtime_checkable
class Dynamics(Protocol):
    """Predicts where whole pushes lead. Pure: the same input gives the same output."""

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, 3) from scenes (B, N, 8)."""
        ...


@runtime_checkable
class RolloutModel(Protocol):
    """Predicts whole sequences of pushes from one scene: what a sampling planner needs."""

    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        """Predict scenes (K, H, N, 8) for push sequences (K, H, 3) from one scene (N, 8).

        Entry ``[k, h]`` is the scene *after* push h of sequence k.
        """
        ...


@runtime_checkable
class RegionModel(Protocol):
    """A model that can tell how sure its rollouts are."""

    def regions(
        self, scene: Scene, pushes: PushSequences, predicted: PredictedScenes
    ) -> Radii | None:
        """Return the radius [m] of the region that should hold each disk after each push.

        Each push is looked at by itself: as if the scene that it was predicted to start from were
        right.

        Args:
            scene: (N, 8), before the first push.
            pushes: (K, H, 3).
            predicted: (K, H, N, 8), what this model predicted for them.

        Returns:
            (K, H, N), or None where the model cannot tell.
        """
        ...


@runtime_checkable
class ShapedDynamics(Protocol):
    """A `Dynamics` that can predict bodies of other shapes and roles than the paper's disks."""

    def with_bodies(self, bodies: Bodies) -> Dynamics:
        """Return the dynamics for these bodies. Pure: `self` stays as it is.

        Raises:
            ConfigError: it cannot predict such bodies.
        """
        ...


@runtime_checkable
class ShapedRollout(Protocol):
    """A `RolloutModel` that can predict bodies of other shapes and roles."""

    def with_bodies(self, bodies: Bodies) -> RolloutModel:
        """Return the model for these bodies; as `ShapedDynamics`."""
        ...


def shaped(dynamics: Dynamics, bodies: Bodies) -> Dynamics:
    """Return a dynamics for these bodies.

    Raises:
        ConfigError: it can only predict disks.
    """
    if bodies.are_paper_disks:
        return dynamics
    if isinstance(dynamics, ShapedDynamics):
        return dynamics.with_bodies(bodies)
    if bodies.stand_in_for_disks:
        return dynamics
    names = ", ".join(shape.name for shape in bodies.shapes)
    raise ConfigError(
        f"{type(dynamics).__name__} can only predict disks; the bodies are {names}:"
        " use a model for any shape, such as sain, or give it the method with_bodies"
    )


class IdentityPrior:
    """f_p(s, a) = s: the prior that the paper deploys (section II-D)."""

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Return the scenes unchanged."""
        return scenes.copy()

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the same: it moves no body of any shape."""
        return self


class StepwiseRollout:
    """Makes a `RolloutModel` of any `Dynamics` by feeding it its own predictions."""

    def __init__(self, dynamics: Dynamics) -> None:
        """Roll out this dynamics."""
        self.dynamics = dynamics

    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        """Predict scenes (K, H, N, 8) with H batched steps of at most K pushes.

        Pushes of zero length move nothing, so that the dynamics is not asked about them.
        """
        samples, horizon, _ = pushes.shape
        predicted = np.empty((samples, horizon, *scene.shape))
        current = np.broadcast_to(scene, (samples, *scene.shape)).copy()  # (K, N, 8)
        for step in range(horizon):
            moving = pushes[:, step, LENGTH] > 0.0
            if moving.any():
                current[moving] = self.dynamics.step(current[moving], pushes[moving, step])
            predicted[:, step] = current
        return predicted


def shaped_rollout(model: RolloutModel, bodies: Bodies) -> RolloutModel:
    """Return a rollout model for these bodies, as `shaped`."""
    if bodies.are_paper_disks:
        return model
    if isinstance(model, ShapedRollout):
        return model.with_bodies(bodies)
    if bodies.stand_in_for_disks:
        return model
    raise ConfigError(f"{type(model).__name__} can only predict disks with the paper's roles")


def scenes_before(scene: Scene, predicted: PredictedScenes) -> PredictedScenes:
    """Return the scenes (K, H, N, 8) that the pushes of a rollout start from."""
    first = np.broadcast_to(scene, (len(predicted), 1, *scene.shape))
    return np.concatenate([first, predicted[:, :-1]], axis=1)


def as_rollout(dynamics: Dynamics | RolloutModel) -> RolloutModel:
    """Return the dynamics' own rollout where it has one, else a stepwise one."""
    return dynamics if isinstance(dynamics, RolloutModel) else StepwiseRollout(dynamics)


def regions_of(
    model: RolloutModel, scene: Scene, pushes: PushSequences, predicted: PredictedScenes
) -> Radii | None:
    """Return how sure a model is of its rollouts, (K, H, N) [m], where it can tell."""
    return model.regions(scene, pushes, predicted) if isinstance(model, RegionModel) else None
