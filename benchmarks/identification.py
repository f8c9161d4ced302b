"""Identification without a network: the planar prior is told the same of every push."""

from typing import Final

import numpy as np

from sain_model.data.dataset import Part
from sain_model.dynamics.physics_gradient import ToldPushes, moves, variations
from sain_model.network.corrections import CORRECTIONS, Corrections
from sain_model.network.feature_kernels import TURN_SCALE
from sain_model.network.interaction_network import POSITION_UNIT
from sain_model.physics.planar import PlanarPrior

STEPS: Final = 8
SCALE: Final = np.array([POSITION_UNIT, POSITION_UNIT, TURN_SCALE])  # of errors
SOFT: Final = 0.1  # of the scale: errors beyond it count less and less
STIFFNESS: Final = 1.0  # how firmly a step stays small


def identify(prior: PlanarPrior, data: Part) -> Corrections:
    """Return one set of corrections (N, 10), fitted to all of the data by Gauss and Newton.

    One slope, one centre of mass of each disk, one friction of each and so on: what a patient
    engineer would find out of a laboratory whose kinds of roughness are known.
    """
    told = np.zeros((data.state.shape[1], CORRECTIONS))
    truth = moves(data.state, data.action, data.next_state)
    pushes = ToldPushes(prior, data.state, data.action, data.action, {})
    for _ in range(STEPS):
        everywhere = np.tile(told, (len(data), 1, 1))
        ends = pushes.moves(everywhere)
        slopes = variations(everywhere, pushes, ends) / SCALE
        missing = ((truth - ends) / SCALE).ravel()
        slopes = slopes.reshape(len(data), told.size, -1).transpose(0, 2, 1).reshape(-1, told.size)
        weighted = slopes / np.sqrt(SOFT**2 + missing**2)[:, None]
        normal = weighted.T @ slopes + STIFFNESS * np.eye(told.size)
        told += np.linalg.solve(normal, weighted.T @ missing).reshape(told.shape)
    return told
