"""A stick that gives way: a spring and a damper, in two directions across it, hold it to the hand.

So does an arm under impedance control, or a stick in a rubber sleeve. Bullet's motors cannot be
soft, whatever their gain; a mass on a spring can, and Bullet solves what it does in contact.
"""

from math import sqrt
from typing import Final

import numpy as np

from sain_sim.client import Client
from sain_sim.kinematics import Tips
from sain_sim.urdf import SPRUNG_MASS

SLIDES: Final = (7, 8)  # joints, and the links behind them; the stick is behind the second
DAMPING: Final = 1.0  # as a share of critical damping


class ToolSpring:
    """Pulls the stick back to where the hand holds it; forces hold for one step each."""

    def __init__(self, client: Client, body: int, stiffness: float) -> None:
        """Hold the stick of a loaded arm with a spring of this stiffness [N/m]."""
        self._client = client
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
        states = self._client.getJointStates(self._body, SLIDES)
        forces = [-self._stiffness * state[0] - self._damping * state[1] for state in states]
        self._client.setJointMotorControlArray(
            self._body, SLIDES, self._client.TORQUE_CONTROL, forces=forces
        )

    def tip(self, held: Tips) -> Tips:
        """Return where the tip is (3,) [m] when the hand holds it at a point (3,)."""
        state = self._client.getLinkState(self._body, self.link, computeForwardKinematics=True)
        return np.array([*state[4][:2], held[2]])
