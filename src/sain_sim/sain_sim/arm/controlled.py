"""A position-controlled Panda in any engine: where it is held, and how it follows joint angles."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Final

import numpy as np

from sain_sim.arm.kinematics import Joints, Kinematics, Tips

JOINT_COUNT: Final = 7
STOCK_TORQUE: Final = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])  # [N m], Franka
REST: Final = np.zeros(JOINT_COUNT)
AT_REST: Final = [0.0] * JOINT_COUNT


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
