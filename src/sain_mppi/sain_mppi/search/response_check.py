"""Whether the response of a model fits the request."""

import numpy as np
from numpy import ndarray

from sain_core.errors import ModelUnavailableError
from sain_core.scene import MASS
from sain_core.types import PushSequences, Scene


def check_answer(predicted: ndarray, scene: Scene, sequences: PushSequences) -> ndarray:
    """Return predicted scenes (K, H, N, 8) when they can be of sequences (K, H, 3) from a scene.

    Sequences whose prediction is not finite are let through.

    Raises:
        ModelUnavailableError: another shape, or disks of other masses or radii.
    """
    expected = (*sequences.shape[:2], *scene.shape)
    if predicted.shape != expected:
        raise ModelUnavailableError(
            f"the model predicted scenes of shape {predicted.shape}, not {expected}"
        )
    first = predicted[:, 0, :, MASS:]
    other = (first != scene[:, MASS:]).any(axis=(1, 2))
    if other.any() and np.isfinite(predicted[other]).all(axis=(1, 2, 3)).any():
        raise ModelUnavailableError(
            "the model predicted disks of other masses or radii: it answered for another scene"
        )
    return predicted
