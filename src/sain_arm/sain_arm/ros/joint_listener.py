"""Where the arm's joints are, as ``/joint_states`` says."""

from time import monotonic
from typing import Final

import numpy as np
from sensor_msgs.msg import JointState

from sain_arm.robot.robot import Robot, Vector
from sain_core.errors import BusyError, InvalidInputError
from sain_core.ros import codec

STILL: Final = 0.02  # [rad/s]
BEYOND: Final = 0.5  # [rad], of a limit, as far as a joint of a real arm is never
CHANGE: Final = 1e-3  # [rad], of a joint that moves: more than the noise of one that does not
STRANGE: Final = 2.0  # [s] with states of other joints only, after which those are named


class JointListener:
    """Keeps the latest state of a robot's joints; others on the topic do not matter.

    Attributes:
        stamp: of the latest state [s], by the clock of whoever measures it.
        changed: when a joint moved last [s], of a steady clock.
    """

    def __init__(self, robot: Robot, max_age: float) -> None:
        """Take states for current that came within so long [s]."""
        self._robot, self._max_age = robot, max_age
        self._began, self._came = monotonic(), -np.inf
        self.stamp = self.changed = -np.inf
        self._positions: Vector | None = None
        self._moved_to: Vector | None = None  # where it was when it moved last
        self._speed = 0.0
        self._trouble = ""  # why the state after it was refused

    def listen(self, message: JointState) -> None:
        """Take a state; one without any joint of the arm is of somebody else.

        Raises:
            InvalidInputError: a state of the arm that cannot be; its place is then unknown.
        """
        now, names = monotonic(), list(message.name)
        missing = [name for name in self._robot.joints if name not in names]
        if missing:
            self._check_others(names, missing, now)
            return
        stamp = codec.decode_time(message.header.stamp)
        if stamp < self.stamp and now < self._came + self._max_age:
            raise InvalidInputError(
                f"its stamp is {self.stamp - stamp:.3f} s before that of the last state"
            )
        try:
            values = self._checked(names, message)
        except InvalidInputError as error:
            self._trouble = str(error)
            raise
        if self._moved_to is None or np.abs(values - self._moved_to).max() > CHANGE:
            self.changed = self.changed if self._moved_to is None else now
            self._moved_to = values
        if self._positions is not None and now > self._came:
            way = np.abs(values - self._positions).max()
            # A message alone is no rest.
            self._speed = max(way / max(now - self._came, 1e-3), 0.5 * self._speed)
        self._positions, self._came, self.stamp, self._trouble = values, now, stamp, ""

    def _check_others(self, names: list[str], missing: list[str], now: float) -> None:
        """Refuse a part of the arm's joints; other joints only where no others come."""
        is_part = len(missing) < len(self._robot.joints)
        if is_part or now > max(self._began, self._came) + STRANGE:
            raise InvalidInputError(
                f"it has no {', '.join(missing)}; its joints are {', '.join(names[:20]) or 'none'},"
                f" and robot {self._robot.name!r} needs all of its joints in one message"
            )

    def _checked(self, names: list[str], message: JointState) -> Vector:
        """Return the positions (J,) of a message with all joints."""
        robot = self._robot
        if len(message.position) != len(names):
            raise InvalidInputError(f"{len(names)} names and {len(message.position)} positions")
        if twice := [name for name in robot.joints if names.count(name) > 1]:
            raise InvalidInputError(f"joint {twice[0]} comes {names.count(twice[0])} times")
        values = np.array([message.position[names.index(name)] for name in robot.joints])
        low, high = robot.lower - BEYOND, robot.upper + BEYOND
        fine = (values >= low) & (values <= high)  # NaN is not
        if not fine.all():
            joint = int(np.argmin(fine))
            turned = np.radians(values)
            hint = "; it looks like degrees" if ((turned >= low) & (turned <= high)).all() else ""
            raise InvalidInputError(
                f"joint {robot.joints[joint]} is at {values[joint]:g} rad; its limits are"
                f" {robot.lower[joint]:.2f} to {robot.upper[joint]:.2f} rad{hint}"
            )
        return np.asarray(values)

    @property
    def current(self) -> Vector:
        """The joints (J,) now.

        Raises:
            BusyError: no state is current, or the latest cannot be.
        """
        if self._trouble:
            raise BusyError(f"/joint_states cannot be used: {self._trouble}")
        age = monotonic() - self._came
        if self._positions is None or age > self._max_age:
            since = "came" if self._positions is None else f"came for {age:.1f} s"
            names = ", ".join(self._robot.joints)
            raise BusyError(f"no /joint_states with {names} {since}")
        return self._positions

    @property
    def still(self) -> bool:
        """Whether the arm rests."""
        return bool(self._speed < STILL)
