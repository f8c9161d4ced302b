"""The Panda in Bullet: set to a pose, or moved along tool tips at the control rate."""

from typing import Final

import numpy as np

from sain_sim.arm.client import Client
from sain_sim.arm.controlled import JOINT_COUNT, STOCK_TORQUE, ControlledArm
from sain_sim.arm.kinematics import Joints, Kinematics, Tips
from sain_sim.arm.panda import PandaModel
from sain_sim.engines.bullet.tool_spring import ToolSpring

STICK_LINK: Final = 6  # the stick is part of the last link
JOINTS: Final = range(JOINT_COUNT)
UNIT_GAINS: Final = [1.0] * JOINT_COUNT


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
