"""How the arm moves its tool: closed-form kinematics of a Panda, and the timing of ways.

The tool points straight down. With q3 = q5 = 0 the arm lies in one vertical plane, turned to the
tool by q1. In that plane the wrist hangs at the end of two links, set by q2 and q4, and
q6 = q2 - q4 makes the tool vertical. Lengths: Franka's Denavit-Hartenberg table
(https://frankaemika.github.io/docs/control_parameters.html), limits: the same page.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_arm.planning.arm_config import MotionConfig
from sain_core.errors import UnreachableError

SHOULDER_HEIGHT: Final = 0.333  # [m] above the base
UPPER_ARM: Final = 0.316  # [m]
ELBOW_OFFSET: Final = 0.0825  # [m], forward on the upper arm, back on the forearm
FOREARM: Final = 0.384  # [m]
WRIST_OFFSET: Final = 0.088  # [m], from the wrist forward to the flange's axis
FLANGE_DROP: Final = 0.107  # [m], from the wrist down to the flange
TOOL_LENGTH: Final = 0.22  # [m], from the flange down to the tip
TIME_STEP: Final = 1 / 240  # [s], of control

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
    """

    base_height: float

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
        return self.base_height + SHOULDER_HEIGHT - FLANGE_DROP - TOOL_LENGTH


def _corner(beside: float, span: ndarray, opposite: float) -> ndarray:
    """Return the angle [rad] between sides ``beside`` and ``span`` of a triangle."""
    cosine = (beside**2 + span**2 - opposite**2) / (2 * beside * span)
    return np.arccos(np.minimum(cosine, 1.0))  # a stretched arm may round to above 1


def _require(possible: ndarray, tips: Tips, reason: str) -> None:
    if not np.all(possible):
        x, y, z = tips.reshape(-1, 3)[int(np.argmin(np.ravel(possible)))]
        raise UnreachableError(f"the tool cannot stand at ({x:.3f}, {y:.3f}, {z:.3f}) m: {reason}")


Progress = Float[ndarray, "T"]  # [m], from 0 to the length

JOINT_COUNT: Final = 7
STOCK_TORQUE: Final = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])  # [N m], Franka
REST: Final = np.zeros(JOINT_COUNT)
AT_REST: Final = [0.0] * JOINT_COUNT


def stroke_tips(motion: MotionConfig, start: ndarray, end: ndarray, speed: float) -> Tips:
    """Return the tips (T, 3) of a push from start (2,) to end (2,) [m], at a speed [m/s]."""
    low_start, low_end = (np.array([*place, motion.tip_height]) for place in (start, end))
    return line(motion, low_start, low_end, speed)


def line(motion: MotionConfig, start: ndarray, end: ndarray, speed: float | None = None) -> Tips:
    """Return the tips (T, 3) on a straight line from start (3,) to end (3,) [m]."""
    way = end - start
    share = _share(float(np.linalg.norm(way)), speed or motion.travel_speed, motion)
    return np.asarray(start + share[:, None] * way)


def arc(motion: MotionConfig, start: ndarray, end: ndarray) -> Tips:
    """Return the tips (T, 3) on a spiral about the base from start (3,) to end (3,) [m].

    Distance and bearing change evenly, so the way never comes nearer to the base, or goes
    farther from it, than its two ends.
    """
    near, far = (np.array([np.hypot(*p[:2]), np.arctan2(p[1], p[0]), p[2]]) for p in (start, end))
    turn = far - near
    length = float(np.linalg.norm([turn[0], turn[1] * max(near[0], far[0]), turn[2]]))
    share = _share(length, motion.travel_speed, motion)
    radius, bearing, height = (near + share[:, None] * turn).T
    return np.stack([radius * np.cos(bearing), radius * np.sin(bearing), height], axis=-1)


def _share(length: float, speed: float, motion: MotionConfig) -> ndarray:
    """Return the shares (T,) of a way that are done after 0, 1, 2 .. control steps."""
    return trapezoid(length, speed, motion.acceleration) / length if length else np.ones(1)


def trapezoid(length: float, speed: float, acceleration: float) -> Progress:
    """Return the distances (T,) [m] done after each control step of a trapezoidal speed profile.

    From rest to rest; short ways never reach the full speed. Starts at 0, ends at the length.
    """
    ramp = min(speed, np.sqrt(length * acceleration)) / acceleration  # [s]
    top = ramp * acceleration
    duration = length / top + ramp
    times = np.minimum(np.arange(int(np.ceil(duration / TIME_STEP)) + 1) * TIME_STEP, duration)
    left = duration - times
    speeding = 0.5 * acceleration * times**2
    cruising = top * (times - 0.5 * ramp)
    braking = length - 0.5 * acceleration * left**2
    return np.where(times < ramp, speeding, np.where(left < ramp, braking, cruising))


class ControlledArm(ABC):
    """An arm whose base is in the world's axis, below the table top.

    Each command holds for one control step.
    """

    def __init__(self, kinematics: Kinematics) -> None:
        """Control an arm."""
        self.kinematics = kinematics
        self.target = REST

    @abstractmethod
    def put(self, joints: Joints) -> None:
        """Set the joints to angles (7,) at once, at rest."""

    @abstractmethod
    def command(self, joints: list[float], speeds: list[float]) -> None:
        """Command angles of now (7) [rad], and speeds (7) [rad/s] that lead to the next ones."""

    @abstractmethod
    def joint_states(self) -> tuple[Joints, Joints]:
        """Return the joint angles (7,) [rad] and speeds (7,) [rad/s]."""

    def place(self, joints: Joints) -> None:
        """Set the arm to joints (7,) at once, at rest, and hold it there."""
        self.put(joints)
        self.hold(joints)

    def hold(self, joints: Joints) -> None:
        """Command the arm to rest at joints (7,)."""
        self.command(joints.tolist(), AT_REST)
        self.target = joints

    def follow(self, joints: Joints) -> Iterator[int]:
        """Command one step towards each of joints (T, 7) after the first; the caller steps.

        The motors get the angle of now and the speed that leads to the next: a feed-forward
        that leaves the gain only disturbances to undo.
        """
        speeds = np.diff(joints, axis=0) / TIME_STEP  # (T - 1, 7)
        commands = zip(joints[:-1].tolist(), speeds.tolist(), strict=True)
        for step, command in enumerate(commands):
            self.command(*command)
            self.target = joints[step + 1]
            yield step
        self.hold(joints[-1])

    def tip(self) -> Tips:
        """Return where the hand holds the tool's tip, (3,) [m]."""
        return self.kinematics.tips(self.joint_states()[0])

    def tool(self) -> Tips:
        """Return where the tool's tip is, (3,) [m]."""
        return self.tip()

    def commanded_tip(self) -> Tips:
        """Return where the tool's tip was last commanded to be, (3,) [m]."""
        return self.kinematics.tips(self.target)
