"""Where the arm's joints are, as ``/joint_states`` says."""

from time import monotonic
from typing import Final

import numpy as np
from sensor_msgs.msg import JointState

from sain_arm.robot.robot import Robot, Vector
from sain_core.errors import BusyError
from sain_core.ros import codec

STILL: Final = 0.02  # [rad/s]


class JointListener:
    """Keeps the latest state of a robot's joints; others on the topic do not matter."""

    def __init__(self, robot: Robot, max_age: float) -> None:
        """Take states for current that came within so long [s]."""
        self._robot, self._max_age = robot, max_age
        self._heard = -np.inf
        self.stamp = -np.inf  # [s], of the latest state, by the clock of whoever measures it
        self._positions: Vector | None = None
        self._speed = 0.0

    def listen(self, message: JointState) -> None:
        """Take a message; one without all joints of the arm is of somebody else."""
        names = list(message.name)
        if not set(self._robot.joints) <= set(names) or len(message.position) != len(names):
            return
        values = np.array([message.position[names.index(name)] for name in self._robot.joints])
        now = monotonic()
        if self._positions is not None and np.isfinite(self._heard) and now > self._heard:
            moved = np.abs(values - self._positions).max() / max(now - self._heard, 1e-3)
            self._speed = max(moved, 0.5 * self._speed)  # a message alone is no rest
        self._positions, self._heard = values, now
        self.stamp = codec.decode_time(message.header.stamp)

    @property
    def current(self) -> Vector:
        """The joints (J,) now.

        Raises:
            BusyError: no state is current, or one is not finite.
        """
        age = monotonic() - self._heard
        if self._positions is None or age > self._max_age:
            since = "came" if self._positions is None else f"came for {age:.1f} s"
            names = ", ".join(self._robot.joints)
            raise BusyError(f"no /joint_states with {names} {since}")
        if not np.isfinite(self._positions).all():
            raise BusyError("/joint_states has NaN or Inf; where the arm is is not known")
        return self._positions

    @property
    def still(self) -> bool:
        """Whether the arm rests."""
        return bool(self._speed < STILL)
