"""How the tool moves: lines and arcs of tips at the control rate, and an arm that follows them."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import Config, option
from sain_sim.arm.kinematics import Joints, Kinematics, Tips

Progress = Float[ndarray, "T"]  # [m], from 0 to the length

JOINT_COUNT: Final = 7
STOCK_TORQUE: Final = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])  # [N m], Franka
REST: Final = np.zeros(JOINT_COUNT)
AT_REST: Final = [0.0] * JOINT_COUNT


@dataclass(frozen=True)
class MotionConfig(Config):
    """Speeds and heights of the tool; a push has its own speed."""

    travel_speed: float = option(0.5, "speed out of contact", unit="m/s", minimum=0.01, maximum=1.5)
    acceleration: float = option(4.0, "acceleration", unit="m/s^2", minimum=0.1, maximum=20.0)
    tip_height: float = option(
        0.008,
        "height of the tool's tip above the table during a push",
        unit="m",
        minimum=0.002,
        maximum=0.02,
    )
    lift: float = option(
        0.08, "height of the tip above that between pushes", unit="m", minimum=0.04, maximum=0.2
    )
    time_step: float = option(1 / 240, "control and physics step", unit="s", minimum=1e-4)

    @property
    def raised(self) -> float:
        """Height [m] of the tip between pushes."""
        return self.tip_height + self.lift

    def stroke(self, start: ndarray, end: ndarray, speed: float) -> Tips:
        """Return the tips (T, 3) of a push from start (2,) to end (2,) [m], at a speed [m/s]."""
        low_start, low_end = (np.array([*place, self.tip_height]) for place in (start, end))
        return self.line(low_start, low_end, speed)

    def line(self, start: ndarray, end: ndarray, speed: float | None = None) -> Tips:
        """Return the tips (T, 3) on a straight line from start (3,) to end (3,) [m]."""
        way = end - start
        length = float(np.linalg.norm(way))
        share = self._share(length, speed or self.travel_speed)
        return np.asarray(start + share[:, None] * way)

    def arc(self, start: ndarray, end: ndarray) -> Tips:
        """Return the tips (T, 3) on a spiral about the base from start (3,) to end (3,) [m].

        Distance and bearing change evenly, so the way never comes nearer to the base, or goes
        farther from it, than its two ends.
        """
        near, far = (
            np.array([np.hypot(*p[:2]), np.arctan2(p[1], p[0]), p[2]]) for p in (start, end)
        )
        turn = far - near
        length = float(np.linalg.norm([turn[0], turn[1] * max(near[0], far[0]), turn[2]]))
        radius, bearing, height = (near + self._share(length, self.travel_speed)[:, None] * turn).T
        return np.stack([radius * np.cos(bearing), radius * np.sin(bearing), height], axis=-1)

    def _share(self, length: float, speed: float) -> ndarray:
        """Return the shares (T,) of a way that are done after 0, 1, 2 .. control steps."""
        if length == 0.0:
            return np.ones(1)
        return trapezoid(length, speed, self.acceleration, self.time_step) / length


def trapezoid(length: float, speed: float, acceleration: float, time_step: float) -> Progress:
    """Return the distances (T,) [m] done after each step of a trapezoidal speed profile.

    From rest to rest; short ways never reach the full speed. Starts at 0, ends at the length.
    """
    ramp = min(speed, np.sqrt(length * acceleration)) / acceleration  # [s]
    top = ramp * acceleration
    duration = length / top + ramp
    times = np.minimum(np.arange(int(np.ceil(duration / time_step)) + 1) * time_step, duration)
    left = duration - times
    speeding = 0.5 * acceleration * times**2
    cruising = top * (times - 0.5 * ramp)
    braking = length - 0.5 * acceleration * left**2
    return np.where(times < ramp, speeding, np.where(left < ramp, braking, cruising))


class ControlledArm(ABC):
    """An arm whose base is in the world's axis, below the table top."""

    def __init__(self, kinematics: Kinematics, time_step: float) -> None:
        """Control an arm; each command holds for one time_step [s]."""
        self._time_step = time_step
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
        speeds = np.diff(joints, axis=0) / self._time_step  # (T - 1, 7)
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
