"""Whether what a model answered can be an answer: the one check at the border to every model.

A model may come from another package or another process. What a border does not check, a planner
acts on.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy import ndarray

from sain_core.errors import ModelUnavailableError, SainError
from sain_core.scene import MASS
from sain_core.types import PredictedScenes, PushSequences, Scene, Scenes


@contextmanager
def answering(model: str) -> Iterator[None]:
    """Turn whatever a model raises into an error that names the model.

    Raises:
        ModelUnavailableError: the model raised something else than a `SainError`.
    """
    try:
        yield
    except SainError:
        raise
    except Exception as error:
        raise ModelUnavailableError(f"{model} failed: {type(error).__name__}: {error}") from error


def check_step(predicted: object, scenes: Scenes, model: str = "the model") -> Scenes:
    """Return predicted scenes (B, N, 8) when they can follow from scenes (B, N, 8).

    Raises:
        ModelUnavailableError: no array, another shape, NaN or Inf, or disks of other masses or
            radii. The message begins with how `model` is called.
    """
    found = check_finite_answer(_array(predicted, scenes.shape, model), model)
    _check_disks(found, scenes, model)
    return found


def check_rollout(
    predicted: object, scene: Scene, sequences: PushSequences, model: str = "the model"
) -> PredictedScenes:
    """Return predicted scenes (K, H, N, 8) when they can be of sequences (K, H, 3) from a scene.

    Sequences whose prediction is not finite are let through: a search gives them no weight. To
    refuse them too, use `check_finite_answer`.

    Raises:
        ModelUnavailableError: no array, another shape, or disks of other masses or radii.
    """
    found = _array(predicted, (*sequences.shape[:2], *scene.shape), model)
    _check_disks(found[:, 0], np.broadcast_to(scene, found[:, 0].shape), model)
    return found


def check_finite_answer(predicted: ndarray, model: str = "the model") -> ndarray:
    """Return predictions of any shape when all of them are finite.

    Raises:
        ModelUnavailableError: saying how many are not.
    """
    finite = np.isfinite(predicted)
    if not finite.all():
        bad = int((~finite).sum())
        raise ModelUnavailableError(
            f"{model} predicts NaN or Inf in {bad} of {finite.size} numbers"
        )
    return predicted


def _array(predicted: object, expected: tuple[int, ...], model: str) -> ndarray:
    if not isinstance(predicted, ndarray):
        what = type(predicted).__name__
        raise ModelUnavailableError(f"{model} returned a {what}; it must return a NumPy array")
    if predicted.shape != expected:
        raise ModelUnavailableError(
            f"{model} predicted scenes of shape {predicted.shape}; the shape must be {expected}"
        )
    return predicted


def _check_disks(predicted: ndarray, scenes: ndarray, model: str) -> None:
    """Raise where a finite scene (.., N, 8) has disks of other masses or radii."""
    other = (predicted[..., MASS:] != scenes[..., MASS:]).any(axis=(-2, -1))
    if other.any() and np.isfinite(predicted[other]).all(axis=(-2, -1)).any():
        raise ModelUnavailableError(
            f"{model} predicted disks of other masses or radii; a push changes neither, and disks"
            " must stay in their order"
        )
