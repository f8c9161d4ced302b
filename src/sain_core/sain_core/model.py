"""The one contract of everything that predicts a push: `Model`, of which planners need a part.

The four kinds of the paper's Fig. 1 all are a `Model`; planner, evaluation and service take any of
them. One step is one whole push, from settled scene to settled scene. Who writes a model inherits
from `Model` and implements `step`.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoint
from math import log
from pathlib import Path
from typing import Final, Protocol, Self, runtime_checkable

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.errors import ConfigError, ModelUnavailableError, SainError
from sain_core.guarding.plugins import Plugins
from sain_core.push import LENGTH
from sain_core.scene import MASS
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_core.types import PredictedScenes, Pushes, PushSequences, Scene, Scenes
from sain_core.world import MASSES, unknown_names

Radii = Float[ndarray, "K H N"]

REGION_STD: Final = (-2.0 * log(0.1)) ** 0.5  # radius over standard deviation of a 90 % circle


@runtime_checkable
class RolloutModel(Protocol):
    """Predicts sequences of pushes from one scene, which is what a planner needs: see `Model`."""

    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        """Predict scenes (K, H, N, 8) for push sequences (K, H, A)."""
        ...

    def regions(
        self, scene: Scene, pushes: PushSequences, predicted: PredictedScenes
    ) -> Radii | None:
        """Return the radius [m] of the region that should hold each body (K, H, N)."""
        ...

    def with_bodies(self, bodies: Bodies) -> "RolloutModel":
        """Return the model for these bodies."""
        ...

    def condition(self, history: PushHistory) -> "RolloutModel":
        """Return the model conditioned on an episode's earlier pushes."""
        ...


class Model(ABC):
    """Predicts pushes: a `RolloutModel`, given `step` alone. Pure: same input, same output.

    The other methods are those of a model of disks that infers nothing from earlier pushes. They
    are there to be overridden.
    """

    @abstractmethod
    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, A) from scenes (B, N, 8)."""

    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        """Predict scenes (K, H, N, 8) for push sequences (K, H, A) from one scene (N, 8).

        Entry ``[k, h]`` is the scene *after* push h of sequence k. Pushes of zero length move
        nothing, so that no step is made of them. What sequences begin with alike is predicted once.
        """
        samples, horizon, _ = pushes.shape
        predicted = np.empty((samples, horizon, *scene.shape))
        current = np.broadcast_to(scene, (samples, *scene.shape)).copy()  # (K, N, 8)
        one, group = _alike(pushes[:, :1])
        for step in range(horizon):
            if len(one) < samples:
                one, group = _alike(pushes[:, : step + 1])
            moving = one[pushes[one, step, LENGTH] > 0.0]
            if len(moving):
                current[moving] = self.step(current[moving], pushes[moving, step])
            if len(one) < samples:
                current = current[one[group]]
            predicted[:, step] = current
        return predicted

    def regions(
        self, scene: Scene, pushes: PushSequences, predicted: PredictedScenes
    ) -> Radii | None:
        """Return the radius [m] of the region that should hold each body after each push (K, H, N).

        Each push is looked at by itself: as if the scene that it was `predicted` (K, H, N, 8) to
        start from were right. None: the model has no regions.
        """
        return None

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the model for these bodies; by default itself for disks, else a `ConfigError`."""
        if bodies.stand_in_for_disks:
            return self
        names = ", ".join(shape.name for shape in bodies.shapes)
        raise ConfigError(
            f"{type(self).__name__} can only predict disks with the paper's roles; the bodies are"
            f" {names}: use a model for any shape, such as sain, or give it the method with_bodies"
        )

    def condition(self, history: PushHistory) -> Self:
        """Return the model conditioned on an episode's earlier pushes; by default itself."""
        return self

    @property
    def takes_belief(self) -> bool:
        """Whether `with_belief` can be called."""
        return False

    def with_belief(self, path: Path) -> Self:
        """Return the model that begins each episode with a belief of ``sain_model identify``.

        Raises `CheckpointError`: the file is missing or no belief; `ConfigError`: it takes none
        like this.
        """
        raise ConfigError(
            f"{type(self).__name__} takes no belief; 'sain' does, and checkpoints on planar priors"
        )

    def with_unknown_masses(self) -> Self:
        """Return the model for scenes with nominal masses: itself, if it cannot infer them."""
        return self

    @property
    def refused(self) -> int | None:
        """How many pushes it could not carry out so far; None: it does not count them."""
        return None

    def close(self) -> None:  # noqa: B027 - there is nothing to release
        """Release what it holds."""


class IdentityPrior(Model):
    """f_p(s, a) = s: the prior that the paper deploys (section II-D)."""

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Return the scenes unchanged."""
        return scenes.copy()

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the same: it moves no body of any shape."""
        return self


def scenes_before(scene: Scene, predicted: PredictedScenes) -> PredictedScenes:
    """Return the scenes (K, H, N, 8) that the pushes of a rollout start from."""
    first = np.broadcast_to(scene, (len(predicted), 1, *scene.shape))
    return np.concatenate([first, predicted[:, :-1]], axis=1)


GROUP: Final = "sain.dynamics"
CHECKPOINT: Final = "checkpoint"
LABORATORY: Final = "lab"  # resolves lab:NAME, and the path of a laboratory
LABORATORY_FILE: Final = "laboratory.json"  # that a laboratory's folder has
MODELS: Final = Plugins(
    GROUP,
    "model",
    hidden=(CHECKPOINT, LABORATORY),
    more=", the path of a checkpoint, or lab:NAME of a laboratory",
)


def check_model_name(name_or_path: str) -> EntryPoint:
    """Return what offers a model of this name, or checkpoints; nothing is imported.

    A name with a colon, as ``lab:my_table``, is for the model named before it to resolve. Raises
    `ConfigError`: no installed package offers it, or two do.
    """
    family, colon, _ = name_or_path.partition(":")
    if colon and family in MODELS.entries():
        return MODELS.find(family)
    if "/" in name_or_path and (Path(name_or_path).expanduser() / LABORATORY_FILE).exists():
        return MODELS.find(LABORATORY)
    is_path = "/" in name_or_path or name_or_path.startswith("~")
    is_path = is_path or bool(Path(name_or_path).suffix) or Path(name_or_path).exists()
    offered = name_or_path != CHECKPOINT and name_or_path in MODELS.entries()
    return MODELS.find(CHECKPOINT if is_path and not offered else name_or_path)


def load_dynamics(name_or_path: str) -> Model:
    """Return the model of this name, or the one in this checkpoint.

    Raises `ConfigError`, which names the package that fails or offers no model; `CheckpointError`:
    a checkpoint that is missing, damaged or of another version.
    """
    entry = check_model_name(name_or_path)
    loaded = MODELS.load(entry, lambda load: load(name_or_path), name_or_path)
    if isinstance(loaded, Model):
        return loaded
    raise MODELS.wrong(
        entry,
        f"{entry.value} returned a {type(loaded).__name__}; a model inherits from"
        " sain_core.model.Model and implements step(scenes, pushes)",
        name_or_path,
    )


def as_observed(model: Model, unknown: str) -> Model:
    """Return a model for scenes in which these names, with commas, are nominal."""
    return model.with_unknown_masses() if MASSES in unknown_names(unknown) else model


@contextmanager
def answering(model: str) -> Iterator[None]:
    """Turn errors other than a `SainError` into a `ModelUnavailableError` that names the model."""
    try:
        yield
    except SainError:
        raise
    except Exception as error:
        raise ModelUnavailableError(f"{model} failed: {type(error).__name__}: {error}") from error


def check_step(
    predicted: object, scenes: Scenes, model: str = "the model", finite: bool = True
) -> Scenes:
    """Return predicted scenes (..., N, 8) when they can follow from scenes (..., N, 8).

    Raises `ModelUnavailableError`, which begins with `model`: another shape, NaN or Inf, other
    masses or radii. What is not `finite` is let through if asked: a search gives it no weight.
    """
    if not isinstance(predicted, ndarray):
        what = type(predicted).__name__
        raise ModelUnavailableError(f"{model} returned a {what}; it must return a NumPy array")
    if predicted.shape != scenes.shape:
        raise ModelUnavailableError(
            f"{model} predicted scenes of shape {predicted.shape}; the shape must be {scenes.shape}"
        )
    is_finite = np.isfinite(predicted)
    if finite and not is_finite.all():
        bad = int((~is_finite).sum())
        raise ModelUnavailableError(
            f"{model} predicts NaN or Inf in {bad} of {is_finite.size} numbers"
        )
    other = (predicted[..., MASS:] != scenes[..., MASS:]).any(axis=(-2, -1))
    if (other & is_finite.all(axis=(-2, -1))).any():
        raise ModelUnavailableError(
            f"{model} predicted disks of other masses or radii; a push changes neither, and disks"
            " must stay in their order"
        )
    return predicted


def _alike(sequences: PushSequences) -> tuple[Int[ndarray, "G"], Int[ndarray, "K"]]:
    """Return one sequence of each group that is alike to the bit, and the group of each (K,)."""
    count, pushes, numbers = sequences.shape
    rows = np.ascontiguousarray(sequences).reshape(count, pushes * numbers)
    whole = rows.view((np.void, rows.itemsize * pushes * numbers))[:, 0]
    _, one, group = np.unique(whole, return_index=True, return_inverse=True)
    return (one, group) if len(one) < count else (np.arange(count), np.arange(count))


def check_rollout(
    predicted: object,
    scene: Scene,
    sequences: PushSequences,
    model: str = "the model",
    finite: bool = True,
) -> PredictedScenes:
    """Return predicted scenes (K, H, N, 8) when they can follow from a scene; see `check_step`."""
    before = np.broadcast_to(scene, (*sequences.shape[:2], *scene.shape))
    return check_step(predicted, before, model, finite)
