"""Parameters of the planar prior that a network may correct.

A residual on a prediction would have to learn how each push responds to what the prior lacks: a
slope shifts a disk that coasts for long, and one that is held not at all. A prior with a corrected
slope responds by itself. So the network corrects ten numbers of each disk:

| column | what | 1 means | at most |
| --- | --- | --- | --- |
| DRAG | friction with the table, logarithm of a factor | 0.3 | 1.2 |
| PULL_X, PULL_Y | acceleration along the world's axes, as on a slope | 0.1 m/s^2 | 0.5 m/s^2 |
| MASS_FORE, MASS_LEFT | from a body's centroid to its centre of mass | 0.1 radii | 0.35 radii |
| RIM_GRIP | friction with bodies nearer to the push, logarithm of a factor | 0.5 | 2.0 |
| TOOL_GRIP | friction with the tool, likewise | 0.5 | 2.0 |
| LENGTH | how much further the tool goes; of the pushed body alone | 5 mm | 20 mm |
| ANGLE | which way it goes, likewise | 0.05 rad | 0.3 rad |
| LOCATION | where around that body it starts, its way kept, likewise | 0.05 rad | 0.3 rad |

All are 0 for the prior as it is. They saturate smoothly, so that all corrections are
physically possible: masses stay within a disk's feet, factors above 0.
"""

from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import InvalidInputError
from sain_core.push import ANGLE as PUSH_ANGLE
from sain_core.push import LENGTH as PUSH_LENGTH
from sain_core.push import LOCATION as PUSH_LOCATION
from sain_core.push import pushed_bodies
from sain_core.types import Pushes
from sain_model.compute.batch_checks import check_finite

DRAG, PULL_X, PULL_Y, MASS_FORE, MASS_LEFT, RIM_GRIP, TOOL_GRIP = range(7)
OF_DISKS: Final = 7  # columns that the kernels take of each disk, in their order
LENGTH, ANGLE, LOCATION = range(7, 10)
CORRECTIONS: Final = 10
UNIT: Final = np.array([0.3, 0.1, 0.1, 0.1, 0.1, 0.5, 0.5, 0.005, 0.05, 0.05])
MOST: Final = np.array([1.2, 0.5, 0.5, 0.35, 0.35, 2.0, 2.0, 0.02, 0.3, 0.3])

Corrections = Float[ndarray, "B N C"]  # C = CORRECTIONS


def saturated(corrections: Corrections) -> Corrections:
    """Return corrections in plain units (B, N, 10), none beyond what is possible."""
    return np.asarray(MOST * np.tanh(corrections * (UNIT / MOST)))


def corrected_disks(corrections: Corrections) -> Float[ndarray, "B N 7"]:
    """Return what the kernels take of each disk: factors, accelerations, lengths in radii."""
    told = saturated(corrections)[..., :OF_DISKS]
    for column in (DRAG, RIM_GRIP, TOOL_GRIP):
        told[..., column] = np.exp(told[..., column])
    return told


def corrected_pushes(pushes: Pushes, corrections: Corrections) -> Pushes:
    """Return pushes (B, 3 or 4) with their length, angle and location corrected.

    A push of no length stays as it is; none becomes shorter than that.
    """
    told = saturated(corrections)[np.arange(len(pushes)), pushed_bodies(pushes)]
    corrected = pushes.copy()
    longer = np.maximum(pushes[:, PUSH_LENGTH] + told[:, LENGTH], 0.0)
    corrected[:, PUSH_LENGTH] = np.where(pushes[:, PUSH_LENGTH] == 0.0, 0.0, longer)
    corrected[:, PUSH_ANGLE] += told[:, ANGLE] - told[:, LOCATION]
    corrected[:, PUSH_LOCATION] += told[:, LOCATION]
    return corrected


def check_corrections(corrections: ndarray, scenes: ndarray) -> None:
    """Check that corrections (B, N, 10) are of these scenes (B, N, 8) and finite.

    Raises:
        InvalidInputError: naming what is not.
    """
    right = (*scenes.shape[:2], CORRECTIONS)
    if corrections.shape != right:
        raise InvalidInputError(f"corrections have shape {right}, not {corrections.shape}")
    check_finite("corrections", corrections)
