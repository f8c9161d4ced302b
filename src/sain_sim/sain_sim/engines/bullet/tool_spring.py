"""A compliant stick: a spring and a damper, in two directions across it, hold it to the hand.

An arm under impedance control behaves like this. Bullet's motors cannot be soft at any gain, but
a mass on a spring can, and Bullet solves its contacts.
"""

from math import hypot, sqrt
from typing import Final

import numpy as np

from sain_sim.arm.client import Client
from sain_sim.arm.kinematics import FLANGE_DROP, WRIST_OFFSET, Joints, Tips
from sain_sim.arm.urdf import SPRUNG_MASS

SLIDES: Final = (7, 8)  # joints, and the links behind them; the stick is behind the second
JOINTS: Final = range(9)  # the arm's and the slides
REST: Final = [0.0] * len(JOINTS)
DAMPING: Final = 1.0  # as a share of critical damping


class ToolSpring:
    """Pulls the stick back to where the hand holds it; forces hold for one step each."""

    def __init__(
        self,
        client: Client,
        body: int,
        stiffness: float,
        torques: Joints,
        length: float,
        radius: float,
    ) -> None:
        """Hold the stick of a loaded arm, of this length from the flange and this radius [m].

        The spring [N/m] asks no more of the arm's joints than torques (7,) [N m]; zeros: any.
        """
        self._client = client
        self._torques = torques
        self._limited = bool(torques.any())
        self._weakest = float(torques.min())
        self._contact = [0.0, 0.0, (length - 2 * radius) / 2]  # from the stick's link
        self._hang = hypot(WRIST_OFFSET, FLANGE_DROP + length)  # from the wrist to the tip [m]
        self._body = body
        self._stiffness = stiffness
        self._damping = DAMPING * 2.0 * sqrt(stiffness * SPRUNG_MASS)
        self.link = SLIDES[-1]
        zeros = [0.0, 0.0]
        client.setJointMotorControlArray(  # PyBullet's joints start out with a brake
            body, SLIDES, client.VELOCITY_CONTROL, targetVelocities=zeros, forces=zeros
        )

    def relax(self) -> None:
        """Set the stick to where the hand holds it, at rest."""
        for joint in SLIDES:
            self._client.resetJointState(self._body, joint, 0.0, 0.0)

    def pull(self) -> None:
        """Apply the spring's force for the next step."""
        (x, vx, *_), (y, vy, *_) = self._client.getJointStates(self._body, SLIDES)
        forces = [
            -self._stiffness * x - self._damping * vx,
            -self._stiffness * y - self._damping * vy,
        ]
        if self._limited and not self._light(hypot(*forces), abs(x) + abs(y)):
            share = self._share(np.array(forces))
            forces = [share * force for force in forces]
        self._client.setJointMotorControlArray(
            self._body, SLIDES, self._client.TORQUE_CONTROL, forces=forces
        )

    def _light(self, force: float, shift: float) -> bool:
        """Tell whether the joints bear a force [N] on a stick shifted by so much [m] in any pose.

        The weakest joints are the wrist's. Those before it are less than four times as far away,
        and seven times as strong.
        """
        return force * (self._hang + shift) <= self._weakest

    def _share(self, forces: np.ndarray) -> float:
        """Return which share of the spring's forces (2,) [N] the joints can bear.

        What the arm's own weight takes of their torque is left out.
        """
        angles = [state[0] for state in self._client.getJointStates(self._body, JOINTS)]
        linear, _ = self._client.calculateJacobian(
            self._body, self.link, self._contact, angles, REST, REST
        )
        jacobian = np.array(linear)  # (3, 9)
        asked = np.abs(jacobian[:, :7].T @ jacobian[:, 7:] @ forces)  # (7,) [N m]
        over = float((asked / self._torques).max())
        return 1.0 / over if over > 1.0 else 1.0

    def tip(self, held: Tips) -> Tips:
        """Return where the tip is (3,) [m] when the hand holds it at a point (3,)."""
        state = self._client.getLinkState(self._body, self.link, computeForwardKinematics=True)
        return np.array([*state[4][:2], held[2]])
