"""Closed-form kinematics of a Panda whose tool points straight down.

With q3 = q5 = 0 the arm lies in one vertical plane, turned to the tool by q1. In that plane
the wrist hangs at the end of two links, set by q2 and q4, and q6 = q2 - q4 makes the tool
vertical. Lengths: Franka's Denavit-Hartenberg table
(https://frankaemika.github.io/docs/control_parameters.html), limits: the same page.
"""

from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import UnreachableError

SHOULDER_HEIGHT: Final = 0.333  # [m] above the base
UPPER_ARM: Final = 0.316  # [m]
ELBOW_OFFSET: Final = 0.0825  # [m], forward on the upper arm, back on the forearm
FOREARM: Final = 0.384  # [m]
WRIST_OFFSET: Final = 0.088  # [m], from the wrist forward to the flange's axis
FLANGE_DROP: Final = 0.107  # [m], from the wrist down to the flange

LOWER_LIMITS: Final = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
UPPER_LIMITS: Final = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])

_UPPER_LINK: Final = float(np.hypot(UPPER_ARM, ELBOW_OFFSET))
_FORE_LINK: Final = float(np.hypot(FOREARM, ELBOW_OFFSET))
_UPPER_TURN: Final = float(np.arctan2(ELBOW_OFFSET, UPPER_ARM))
_FORE_TURN: Final = float(np.arctan2(ELBOW_OFFSET, FOREARM))

Tips = Float[ndarray, "*T 3"]  # tool tips in the world [m]
Joints = Float[ndarray, "*T 7"]  # joint angles [rad]


@dataclass(frozen=True)
class Kinematics:
    """Where the tool's tip is for joint angles, and the other way round.

    Attributes:
        base_height: z of the arm's base in the world [m].
        tool_length: from the flange down to the tip [m].
    """

    base_height: float
    tool_length: float

    def tips(self, joints: Joints) -> Tips:
        """Return the tips (..., 3) [m] of a vertical tool for joints (..., 7)."""
        bearing, lean, fold = joints[..., 0], joints[..., 1], joints[..., 3]
        upper, fore = lean + _UPPER_TURN, lean - fold - _FORE_TURN  # from the vertical [rad]
        radius = _UPPER_LINK * np.sin(upper) + _FORE_LINK * np.sin(fore) + WRIST_OFFSET
        height = _UPPER_LINK * np.cos(upper) + _FORE_LINK * np.cos(fore) + self._wrist_origin
        return np.stack([radius * np.cos(bearing), radius * np.sin(bearing), height], axis=-1)

    def joints(self, tips: Tips) -> Joints:
        """Return the joints (..., 7) that hold the tool's tip at points (..., 3) [m].

        Raises:
            UnreachableError: naming the first pose the arm cannot take, and why.
        """
        radius = np.hypot(tips[..., 0], tips[..., 1]) - WRIST_OFFSET
        height = tips[..., 2] - self._wrist_origin
        span = np.hypot(radius, height)
        _require(
            (span <= _UPPER_LINK + _FORE_LINK) & (span >= abs(_UPPER_LINK - _FORE_LINK)),
            tips,
            "it is out of the arm's reach",
        )
        towards = np.arctan2(radius, height)  # from the vertical to the wrist [rad]
        # cosine rule in the triangle shoulder, elbow, wrist; the elbow stays above
        upper = towards - _corner(_UPPER_LINK, span, _FORE_LINK)
        fore = towards + _corner(_FORE_LINK, span, _UPPER_LINK)
        lean, reach = upper - _UPPER_TURN, fore + _FORE_TURN
        joints = np.zeros((*tips.shape[:-1], 7))
        joints[..., 0] = np.arctan2(tips[..., 1], tips[..., 0])
        joints[..., 1] = lean
        joints[..., 3] = lean - reach
        joints[..., 5] = reach
        joints[..., 6] = pi / 4
        inside = (joints >= LOWER_LIMITS) & (joints <= UPPER_LIMITS)  # (..., 7)
        if not inside.all():
            joint = int(np.argwhere(~inside)[0][-1])
            low, high = LOWER_LIMITS[joint], UPPER_LIMITS[joint]
            reason = f"joint {joint + 1} would leave [{low}, {high}] rad"
            _require(inside[..., joint], tips, reason)
        return joints

    @property
    def _wrist_origin(self) -> float:
        """Height [m] of the tip when the wrist is level with the shoulder."""
        return self.base_height + SHOULDER_HEIGHT - FLANGE_DROP - self.tool_length


def _corner(beside: float, span: ndarray, opposite: float) -> ndarray:
    """Return the angle [rad] between sides ``beside`` and ``span`` of a triangle."""
    cosine = (beside**2 + span**2 - opposite**2) / (2 * beside * span)
    return np.arccos(np.minimum(cosine, 1.0))  # a stretched arm may round to above 1


def _require(possible: ndarray, tips: Tips, reason: str) -> None:
    if not np.all(possible):
        x, y, z = tips.reshape(-1, 3)[int(np.argmin(np.ravel(possible)))]
        raise UnreachableError(f"the tool cannot stand at ({x:.3f}, {y:.3f}, {z:.3f}) m: {reason}")
