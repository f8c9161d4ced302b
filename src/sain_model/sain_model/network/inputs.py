"""How the inputs of the network are scaled, and the memory for them in the kernels.

Lengths are divided by constants, so that the inputs are of order one.
"""

from typing import Final, NamedTuple

import numpy as np

PLACE_FEATURES: Final = 10  # columns of a body behind the others, for a network that sees the world
GAP_BEFORE: Final = 10  # columns of a relation: 0 where two bodies touch, 1 far apart
GAP_AFTER: Final = 15

PLACE_SCALE: Final = 0.1  # [m]
MOVE_SCALE: Final = 0.05  # [m]
TURN_SCALE: Final = 0.2  # [rad]
GAP_SCALE: Final = 0.02  # [m], beyond which it hardly matters how far apart two bodies are
MASS_MIDDLE: Final = 8.0  # [kg]
MASS_SCALE: Final = 1.0  # [kg]
REACH_MIDDLE: Final = 0.08  # [m]
REACH_SCALE: Final = 0.02  # [m]
INERTIA_MIDDLE: Final = 0.3
INERTIA_SCALE: Final = 0.2
ORDER_3_SCALE: Final = 3.0
TABLE_X, TABLE_Y = 0.5, 0.0  # [m], the middle of the table
TABLE_SCALE: Final = 0.2  # [m]

LANES: Final = 128  # pushes side by side: the widest layers still fit into a core's nearest cache


class NetworkWork(NamedTuple):
    """Features of pushes, one in each lane, and scratch memory.

    Relation i N + j is to body i from body j; i N + i is to body i from the tool.
    """

    poses: np.ndarray  # (2, N + 1, 5) of bodies and tool in the push frame, before and after
    placed: np.ndarray  # (2, M, 2) corners [m]
    sums: np.ndarray  # (9,)
    patch: np.ndarray  # (6,) of one contact
    bodies: np.ndarray  # (N, inputs of f_dyn, LANES) float32
    relations: np.ndarray  # (N N, inputs of f_rel, LANES) float32
    hidden: np.ndarray  # (2, widest layer, LANES) float32
    residual: np.ndarray  # (N, 3, LANES) dx, dy [m] in the push frame, dtheta [rad]
