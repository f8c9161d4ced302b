"""The Panda in Bullet, moved by its motors, and the spring that may hold its stick."""

from math import hypot, sqrt
from typing import Final

import numpy as np

from sain_sim.arm.client import Client
from sain_sim.arm.kinematics import FLANGE_DROP, WRIST_OFFSET, Joints, Kinematics, Tips
from sain_sim.arm.motion import JOINT_COUNT, STOCK_TORQUE, ControlledArm
from sain_sim.arm.panda import SPRUNG_MASS, PandaModel

STICK_LINK: Final = 6  # the stick is part of the last link
JOINTS: Final = range(JOINT_COUNT)
UNIT_GAINS: Final = [1.0] * JOINT_COUNT
SLIDES: Final = (7, 8)  # joints of a spring, and the links behind them; the stick is the second
ALL_JOINTS: Final = range(9)  # the arm's and the slides
REST: Final = [0.0] * len(ALL_JOINTS)
DAMPING: Final = 1.0  # as a share of critical damping


class ToolSpring:
    """Pulls a compliant stick back to where the hand holds it; forces hold for one step each.

    A spring and a damper act in two directions across the stick, as an arm under impedance control
    does. Bullet's motors cannot be soft at any gain, but a mass on a spring can, and Bullet solves
    its contacts.
    """

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
        """Return whether the joints bear a force [N] on a stick shifted by so much [m] in any pose.

        The weakest joints are the wrist's. Those before it are less than four times as far away,
        and seven times as strong.
        """
        return force * (self._hang + shift) <= self._weakest

    def _share(self, forces: np.ndarray) -> float:
        """Return which share of the spring's forces (2,) [N] the joints can bear.

        What the arm's own weight takes of their torque is left out.
        """
        angles = [state[0] for state in self._client.getJointStates(self._body, ALL_JOINTS)]
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


class Arm(ControlledArm):
    """A Panda of Bullet's, moved by its motors."""

    def __init__(
        self,
        client: Client,
        body: int,
        kinematics: Kinematics,
        model: PandaModel,
        time_step: float,
    ) -> None:
        """Control a loaded arm of this model; each command holds for one time_step [s]."""
        super().__init__(kinematics, time_step)
        config = model.config
        self._client = client
        self._torques = (config.torque_scale * STOCK_TORQUE).tolist()
        self._gains = [config.gain] * JOINT_COUNT
        self.body = body
        self.spring: ToolSpring | None = None
        self.stick = STICK_LINK
        if config.tool_stiffness > 0.0:
            torques = config.tool_torque_scale * STOCK_TORQUE
            stick = (config.tool_length, model.tool_radius)
            self.spring = ToolSpring(client, body, config.tool_stiffness, torques, *stick)
            self.stick = self.spring.link

    def set_friction(self, value: float) -> None:
        """Set the stick's friction coefficient as Bullet multiplies it."""
        self._client.changeDynamics(
            self.body, self.stick, lateralFriction=value, restitution=0.0, rollingFriction=0.0
        )

    def put(self, joints: Joints) -> None:
        """Set the joints to angles (7,) at once, at rest."""
        for joint, value in enumerate(joints.tolist()):
            self._client.resetJointState(self.body, joint, value, 0.0)
        if self.spring is not None:
            self.spring.relax()

    def command(self, joints: list[float], speeds: list[float]) -> None:
        """Command angles of now (7) [rad], and speeds (7) [rad/s] that lead to the next ones."""
        self._client.setJointMotorControlArray(
            self.body,
            JOINTS,
            self._client.POSITION_CONTROL,
            targetPositions=joints,
            targetVelocities=speeds,
            forces=self._torques,
            positionGains=self._gains,
            velocityGains=UNIT_GAINS,
        )

    def joint_states(self) -> tuple[Joints, Joints]:
        """Return the joint angles (7,) [rad] and speeds (7,) [rad/s]."""
        states = self._client.getJointStates(self.body, range(JOINT_COUNT))
        return np.array([s[0] for s in states]), np.array([s[1] for s in states])

    def tool(self) -> Tips:
        """Return where the tool's tip is, (3,) [m]; a stick on a spring is not where it is held."""
        return self.tip() if self.spring is None else self.spring.tip(self.tip())
