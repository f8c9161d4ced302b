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

from sain_core.push import pushed_bodies
from sain_core.types import Pushes
from sain_model.compute.batch_checks import check_finite
from sain_model.physics.planar_config import PlanarConfig

DRAG, PULL_X, PULL_Y, MASS_FORE, MASS_LEFT, RIM_GRIP, TOOL_GRIP = range(7)
OF_DISKS: Final = 7  # columns of each disk; the others are of the tool
LENGTH, ANGLE, LOCATION = range(7, 10)
CORRECTIONS: Final = 10
UNIT: Final = np.array([0.3, 0.1, 0.1, 0.1, 0.1, 0.5, 0.5, 0.005, 0.05, 0.05])
MOST: Final = np.array([1.2, 0.5, 0.5, 0.35, 0.35, 2.0, 2.0, 0.02, 0.3, 0.3])

FACTORS: Final = {"friction_scale": DRAG, "disk_friction": RIM_GRIP, "tool_friction": TOOL_GRIP}
SHIFTS: Final = {
    "slope_x": PULL_X, "slope_y": PULL_Y, "centre_x": MASS_FORE, "centre_y": MASS_LEFT
}  # fmt: skip
OF_TOOL: Final = {"length_offset": LENGTH, "angle_offset": ANGLE, "location_offset": LOCATION}

Corrections = Float[ndarray, "B N C"]  # C = CORRECTIONS


def saturated(corrections: Corrections) -> Corrections:
    """Return corrections in plain units (B, N, 10), none beyond what is possible."""
    return np.asarray(MOST * np.tanh(corrections * (UNIT / MOST)))


def corrected_values(
    corrections: Corrections, pushes: Pushes, config: PlanarConfig
) -> dict[str, ndarray]:
    """Return the parameters of a prior with these settings, as corrected, by name.

    Raises:
        InvalidInputError: corrections that are not finite.
    """
    check_finite("corrections", corrections)
    change = saturated(corrections)
    pushed = change[np.arange(len(pushes)), pushed_bodies(pushes)]
    values = {name: change[..., column] for name, column in SHIFTS.items()}
    for name, column in FACTORS.items():
        values[name] = getattr(config, name) * np.exp(change[..., column])
    return values | {name: pushed[:, column] for name, column in OF_TOOL.items()}
