"""Fits a prior to a laboratory without a network: centre of mass and frictions, by Gauss-Newton.

That is what a patient engineer would find out, who knows in which ways a laboratory is unlike the
textbook. What is not constant there is left to a network.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.scene import THETA, wrap_angle
from sain_model.data.dataset import Dataset
from sain_model.data.shaped_physics import prior_for
from sain_model.dynamics.lab_prior import LabPrior
from sain_model.network.feature_kernels import TURN_SCALE
from sain_model.network.interaction_network import POSITION_UNIT
from sain_model.physics.planar import PlanarConfig

STEPS: Final = 6
STEP: Final = np.array([0.01, 0.01, 0.05, 0.1, 0.1])  # of a finite difference
SOFT: Final = 0.3  # of the unit: errors beyond it count less and less
STIFFNESS: Final = 1.0  # how firmly a step stays small
FRICTIONS: Final = ("friction", "tool_friction", "disk_friction")
LONGEST: Final = 0.3  # [radii], of an offset


def fit_lab(data: Sequence[Dataset], config: PlanarConfig = PlanarConfig()) -> LabPrior:
    """Return the prior that predicts these pushes best: one offset and one of each friction."""
    values = np.zeros(2 + len(FRICTIONS))
    truth = _poses([part.next_state for part in data])
    for _ in range(STEPS):
        ends = _ends(_prior(config, values), data)
        missing = _difference(truth, ends)
        slopes = np.stack(
            [
                _difference(_ends(_prior(config, values + step), data), ends) / step.sum()
                for step in np.diag(STEP)
            ],
            axis=-1,
        )
        weighted = slopes / np.sqrt(SOFT**2 + missing**2)[:, None]
        normal = weighted.T @ slopes + STIFFNESS * np.eye(len(values))
        values = values + np.linalg.solve(normal, weighted.T @ missing)
        values[:2] *= min(1.0, LONGEST / max(float(np.hypot(*values[:2])), 1e-12))
    return _prior(config, values)


def _prior(config: PlanarConfig, values: Float[ndarray, "5"]) -> LabPrior:
    changed = {
        name: float(getattr(config, name) * np.exp(value))
        for name, value in zip(FRICTIONS, values[2:], strict=True)
    }
    centre = float(values[0]), float(values[1])
    return LabPrior(replace(config, **changed), centre=centre)


def _ends(prior: LabPrior, data: Sequence[Dataset]) -> Float[ndarray, "R 3"]:
    """Return where all bodies come to lie: x, y and heading."""
    return _poses([prior_for(prior, part.bodies).step(part.state, part.action) for part in data])


def _poses(scenes: Sequence[ndarray]) -> Float[ndarray, "R 3"]:
    return np.concatenate([some[..., [0, 1, THETA]].reshape(-1, 3) for some in scenes])


def _difference(first: Float[ndarray, "R 3"], second: Float[ndarray, "R 3"]) -> Float[ndarray, "D"]:
    """Return differences of poses in units of the network's residual, one after the other."""
    off = first - second
    off[:, 2] = wrap_angle(off[:, 2])
    return (off / [POSITION_UNIT, POSITION_UNIT, TURN_SCALE]).ravel()
