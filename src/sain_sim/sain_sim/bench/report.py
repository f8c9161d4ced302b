"""What an arm in simulation breaks: limits of its joints, and contacts that must not be."""

from collections import Counter
from typing import Final

from sain_arm.robot.arm_model import BODY, ArmModel
from sain_arm.robot.robot import Robot, Vector
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene

RATE: Final = 50.0  # [Hz] of looks
SLACK: Final = 0.02  # of a limit of speed, by which servos may overshoot
EDGE: Final = 0.002  # [rad], likewise of a position limit
TOUCHING: Final = 0.002  # [m], to a body that is pushed: a light one slips ahead
DEEP: Final = 0.0005  # [m], overlap of anything else that counts


class Report:
    """Looks at the arm; its links do not collide in the simulated physics.

    Attributes:
        limits: looks at which a joint was beyond a limit of position or speed, by its name.
        contacts: looks at which two things touched that must not, by their names.
        tool: looks at which the tool touched a body.
    """

    def __init__(self, robot: Robot, bodies: Bodies, radii: tuple[float, ...]) -> None:
        """Look at a robot among bodies with radii [m]."""
        self._robot, self._arm = robot, ArmModel(robot, bodies, radii)
        self.limits, self.contacts, self.tool = Counter[str](), Counter[str](), 0

    def look(self, joints: Vector, velocities: Vector, scene: Scene) -> None:
        """Count what is wrong with joints (J,), their velocities (J,) and bodies (N, 8)."""
        robot = self._robot
        beyond = (joints < robot.lower - EDGE) | (joints > robot.upper + EDGE)
        beyond |= abs(velocities) > robot.velocity * (1.0 + SLACK)
        self.limits.update(name for name, wrong in zip(robot.joints, beyond, strict=True) if wrong)
        self._arm.place(scene)
        pushes = False
        for contact in self._arm.contacts(joints):
            if contact.is_tool and contact.second.startswith(BODY):
                pushes |= contact.gap < TOUCHING
            elif contact.gap < -DEEP:
                self.contacts[f"{contact.first} and {contact.second}"] += 1
        self.tool += pushes

    def __str__(self) -> str:
        return f"limits {dict(self.limits)}, contacts {dict(self.contacts)}, tool {self.tool}"
