"""The Panda with its stick: set to a pose, or moved along tool tips at the control rate."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from sain_core.config import Config, option
from sain_sim.arm.client import Client
from sain_sim.arm.kinematics import Joints, Kinematics, Tips
from sain_sim.arm.tool_spring import ToolSpring
from sain_sim.arm.urdf import panda_with_stick

JOINT_COUNT: Final = 7
STICK_LINK: Final = 6  # the stick is part of the last link
JOINT_NAMES: Final = tuple(f"panda_joint{index}" for index in range(1, JOINT_COUNT + 1))
STOCK_TORQUE: Final = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])  # [N m], Franka
REST: Final = np.zeros(JOINT_COUNT)
JOINTS: Final = range(JOINT_COUNT)
AT_REST: Final = [0.0] * JOINT_COUNT
UNIT_GAINS: Final = [1.0] * JOINT_COUNT


@dataclass(frozen=True)
class ArmConfig(Config):
    """How the arm is built and controlled."""

    tool_length: float = option(
        0.22, "distance from the flange to the tip", unit="m", minimum=0.15, maximum=0.4
    )
    gain: float = option(
        0.6, "share of a position error that a step corrects", minimum=0.05, maximum=1.0
    )
    torque_scale: float = option(
        20.0, "joint torque limits, as a multiple of Franka's", minimum=0.1, maximum=100.0
    )
    # Rotors turn a hundred times faster than the joints behind their gears, so an arm resists a
    # knock with far more than its links. Bullet has no rotors, and its solver does not converge
    # for light links that push heavy disks: the tool deviated, depending on the arm's pose.
    inertia_scale: float = option(
        20.0, "inertia of the links, as a multiple of Franka's", minimum=0.1, maximum=1000.0
    )
    tool_stiffness: float = option(
        0.0,
        "stiffness of the spring that holds the stick; 0: rigid",
        unit="N/m",
        minimum=0.0,
        maximum=2e4,
    )
    tool_torque_scale: float = option(
        0.0,
        "joint torque limits for a stick on a spring, as a multiple of Franka's; 0: none",
        minimum=0.0,
        maximum=100.0,
    )


class PandaModel:
    """The robot description on disk, for as long as this object lives, and how to load it."""

    def __init__(self, tool_radius: float, config: ArmConfig, visuals: bool = False) -> None:
        """Write the URDF of a Panda with this stick [m]; visuals are meshes for pictures."""
        self.config = config
        self.tool_radius = tool_radius
        self._folder = tempfile.TemporaryDirectory(prefix="sain-panda-")
        self._path = Path(self._folder.name) / "panda.urdf"
        self._path.write_text(
            panda_with_stick(
                tool_radius,
                config.tool_length,
                config.inertia_scale,
                visuals,
                sprung=config.tool_stiffness > 0.0,
            )
        )

    def load(self, client: Client, base_height: float) -> int:
        """Load the arm with its base at z = base_height [m] and return its body."""
        flags = client.URDF_USE_IMPLICIT_CYLINDER
        body: int = client.loadURDF(
            str(self._path), [0.0, 0.0, base_height], useFixedBase=True, flags=flags
        )
        return body


class Arm:
    """A position-controlled Panda whose base is in the world's axis, below the table top."""

    def __init__(
        self,
        client: Client,
        body: int,
        kinematics: Kinematics,
        model: PandaModel,
        time_step: float,
    ) -> None:
        """Control a loaded arm of this model; each command holds for one time_step [s]."""
        config = model.config
        self._client = client
        self._time_step = time_step
        self._torques = (config.torque_scale * STOCK_TORQUE).tolist()
        self._gains = [config.gain] * JOINT_COUNT
        self.body = body
        self.kinematics = kinematics
        self.target = REST
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

    def place(self, joints: Joints) -> None:
        """Set the arm to joints (7,) at once, at rest, and hold it there."""
        for joint, value in enumerate(joints.tolist()):
            self._client.resetJointState(self.body, joint, value, 0.0)
        if self.spring is not None:
            self.spring.relax()
        self.hold(joints)

    def hold(self, joints: Joints) -> None:
        """Command the arm to rest at joints (7,)."""
        self._control(joints.tolist(), AT_REST)
        self.target = joints

    def follow(self, joints: Joints) -> Iterator[int]:
        """Command one step towards each of joints (T, 7) after the first; the caller steps.

        The motors get the angle of now and the speed that leads to the next: a feed-forward
        that leaves the gain only disturbances to undo.
        """
        speeds = np.diff(joints, axis=0) / self._time_step  # (T - 1, 7)
        commands = zip(joints[:-1].tolist(), speeds.tolist(), strict=True)
        for step, command in enumerate(commands):
            self._control(*command)
            self.target = joints[step + 1]
            yield step
        self.hold(joints[-1])

    def _control(self, joints: list[float], speeds: list[float]) -> None:
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

    def tip(self) -> Tips:
        """Return where the hand holds the tool's tip, (3,) [m]."""
        return self.kinematics.tips(self.joint_states()[0])

    def tool(self) -> Tips:
        """Return where the tool's tip is, (3,) [m]; a stick on a spring is not where it is held."""
        return self.tip() if self.spring is None else self.spring.tip(self.tip())

    def commanded_tip(self) -> Tips:
        """Return where the tool's tip was last commanded to be, (3,) [m]."""
        return self.kinematics.tips(self.target)
