"""A robot's arm in Bullet: its description, its motors, and a tool that may be on a spring.

Only the tool collides, with a ball that meets bodies at half their height: Bullet finds the normal
between a ball and a disk's rim to 1e-5 rad, and between two cylinders to 1e-2 only. Rotors turn a
hundred times faster than the joints behind their gears, so an arm resists a knock with far more
than its links. Bullet has no rotors, and its solver does not converge for light links that push
heavy bodies: so all links have the same large inertia, and motors have no limit.
"""

import warnings
import xml.etree.ElementTree as ElementTree
from math import hypot, sqrt
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from sain_arm.robot.arm_model import ArmModel, Pose
from sain_arm.robot.robot import Vector
from sain_arm.robot.urdf_file import LONGEST
from sain_core.scratch import scratch_folder
from sain_sim.engines.bullet_client import Client
from sain_sim.world.workcell import ControlledArm, Tip

GAIN: Final = 0.6  # share of a position error that a step corrects
STRONG: Final = 1e5  # [N m], no limit
DAMPING: Final = 1.0  # as a share of critical damping
X_AXIS, Y_AXIS = np.eye(3)[:2]
FIXED: Final = """<inertial><mass value="0"/>
  <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>"""
HERE: Final[Pose] = np.zeros(3), Rotation.identity()
# Without a visual, Bullet makes a mesh of what collides, which takes time.
UNSEEN: Final = '<visual><geometry><box size="0.002 0.002 0.002"/></geometry></visual>'


class Load(NamedTuple):
    """What a joint moves, and how far."""

    mass: float  # [kg]
    inertia: float  # [kg m^2]
    reach: float = LONGEST  # either way [m], where it slides


SPRUNG_MASS: Final = 2.0  # [kg], moves with a tool that a spring holds: some of a soft arm
SLIDE_RANGE: Final = 0.16  # [m], either way: more than a push is long
LINK: Final = Load(500.0, 20.0)
SLIDE: Final = Load(0.01, 0.0001, SLIDE_RANGE)  # between the two directions of the spring
TOOL: Final = Load(SPRUNG_MASS, SPRUNG_MASS / 100, SLIDE_RANGE)


class ArmFile:
    """The description of an arm on disk, for as long as this object lives."""

    def __init__(self, arm: ArmModel, rise: float, sprung: bool) -> None:
        """Write it, with a ball so far [m] above the tool's tip, on a spring or not."""
        self._folder = scratch_folder("arm")
        self.path = Path(self._folder.name) / "arm.urdf"
        self.path.write_text(describe_arm(arm, rise, sprung))


def describe_arm(arm: ArmModel, rise: float, sprung: bool) -> str:
    """Return the URDF that Bullet simulates: the links that move, and the ball that pushes.

    A tool on a spring slides across its axis, along two more joints.
    """
    tree = ElementTree.fromstring(f'<robot name="arm"><link name="base">{FIXED}</link></robot>')
    above = "base"
    for joint in arm.chain():
        kind = "prismatic" if joint.slides else "continuous"
        _add_link(tree, above, joint.name, kind, joint.pose, joint.axis, LINK)
        above = joint.name
    tip = arm.tip_pose()
    if sprung:
        _add_link(tree, above, "slide", "prismatic", tip, X_AXIS, SLIDE)
        _add_link(tree, "slide", "tool", "prismatic", HERE, Y_AXIS, TOOL)
        tip, above = HERE, "tool"
    ball = tip[0] - rise * tip[1].as_matrix()[:, 2]
    shape = f'<geometry><sphere radius="{arm.robot.tool_radius}"/></geometry>'
    collision = f'<collision><origin xyz="{_words(ball)}"/>{shape}</collision>'
    link = tree.find(f"link[@name='{above}']")
    assert link is not None
    link.extend(ElementTree.fromstring(f"<parts>{UNSEEN}{collision}</parts>"))
    return ElementTree.tostring(tree, encoding="unicode")


def _add_link(
    tree: ElementTree.Element,
    parent: str,
    name: str,
    kind: str,
    pose: Pose,
    axis: np.ndarray,
    load: Load,
) -> None:
    """Add a link behind a joint, whose frame is at a pose in the parent's."""
    place, turn = _words(pose[0]), _words(_fixed_axes(pose[1]))
    mass, inertia, reach = load
    limit = f'<limit lower="{-reach}" upper="{reach}" effort="1e4" velocity="100"/>'
    tree.extend(
        ElementTree.fromstring(f"""<parts>
          <link name="{name}"><inertial><mass value="{mass}"/>
            <inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/>
          </inertial></link>
          <joint name="to {name}" type="{kind}">
            <parent link="{parent}"/><child link="{name}"/>
            <origin xyz="{place}" rpy="{turn}"/><axis xyz="{_words(axis)}"/>{limit}
          </joint>
        </parts>""")
    )


def _fixed_axes(turn: Rotation) -> np.ndarray:
    """Return roll, pitch and yaw [rad]; where pitch is a right angle, with any roll that fits."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Gimbal lock")
        return turn.as_euler("xyz")


def _words(numbers: np.ndarray) -> str:
    return " ".join(map(repr, numbers.tolist()))


class ToolSpring:
    """Pulls a compliant tool back to where the hand holds it; forces hold for one step each.

    A spring and a damper act in two directions across the tool, as an arm under impedance control
    does. Bullet's motors cannot be soft at any gain, but a mass on a spring can, and Bullet solves
    its contacts.
    """

    def __init__(
        self, client: Client, body: int, stiffness: float, efforts: Vector | None, rise: float
    ) -> None:
        """Hold the tool of a loaded arm by a spring [N/m].

        It asks no more of the arm's joints than efforts (J,) [N m], if given. The tool touches
        bodies so far [m] above its tip.
        """
        self._client, self._body, self._efforts = client, body, efforts
        count = client.getNumJoints(body)
        self._slides = count - 2, count - 1
        self._contact, self._rest = [0.0, 0.0, -rise], [0.0] * count
        self._stiffness = stiffness
        self._damping = DAMPING * 2.0 * sqrt(stiffness * SPRUNG_MASS)
        zeros = [0.0, 0.0]
        client.setJointMotorControlArray(  # PyBullet's joints start out with a brake
            body, self._slides, client.VELOCITY_CONTROL, targetVelocities=zeros, forces=zeros
        )

    def relax(self) -> None:
        """Set the tool to where the hand holds it, at rest."""
        for joint in self._slides:
            self._client.resetJointState(self._body, joint, 0.0, 0.0)

    def pull(self) -> None:
        """Apply the spring's force for the next step."""
        (x, vx, *_), (y, vy, *_) = self._client.getJointStates(self._body, self._slides)
        forces = [
            -self._stiffness * x - self._damping * vx,
            -self._stiffness * y - self._damping * vy,
        ]
        if self._efforts is not None and hypot(*forces) > 0.0:
            share = self._share(np.array(forces), self._efforts)
            forces = [share * force for force in forces]
        self._client.setJointMotorControlArray(
            self._body, self._slides, self._client.TORQUE_CONTROL, forces=forces
        )

    def _share(self, forces: np.ndarray, efforts: Vector) -> float:
        """Return which share of the spring's forces (2,) [N] the joints can bear.

        What the arm's own weight takes of their effort is left out.
        """
        states = self._client.getJointStates(self._body, range(len(self._rest)))
        linear, _ = self._client.calculateJacobian(
            self._body,
            self._slides[-1],
            self._contact,
            [state[0] for state in states],
            self._rest,
            self._rest,
        )
        jacobian = np.array(linear)  # (3, J + 2)
        asked = np.abs(jacobian[:, :-2].T @ jacobian[:, -2:] @ forces)  # (J,) [N m]
        over = float((asked / efforts).max())
        return 1.0 / over if over > 1.0 else 1.0

    def tip(self, held: Tip) -> Tip:
        """Return where the tip is (3,) [m] when the hand holds it at a point (3,)."""
        state = self._client.getLinkState(
            self._body, self._slides[-1], computeForwardKinematics=True
        )
        return np.array([*state[4][:2], held[2]])


class BulletArm(ControlledArm):
    """An arm of Bullet's, moved by its motors. Its joints are in the order of the robot's."""

    def __init__(
        self, client: Client, file: ArmFile, model: ArmModel, spring: tuple[float, bool, float]
    ) -> None:
        """Load an arm; of the spring, stiffness [N/m] (0: rigid), whether efforts limit it, rise.

        The rise is from the tip to where it touches bodies [m].
        """
        super().__init__(model)
        self._client, count = client, len(model.robot.joints)
        flags = client.URDF_USE_IMPLICIT_CYLINDER | client.URDF_USE_INERTIA_FROM_FILE
        self.body: int = client.loadURDF(str(file.path), useFixedBase=True, flags=flags)
        self._joints, self._ones = range(count), [1.0] * count
        self._gains, self._forces = [GAIN] * count, [STRONG] * count
        stiffness, limited, rise = spring
        self.spring = None
        if stiffness > 0.0:
            efforts = model.robot.effort if limited else None
            self.spring = ToolSpring(client, self.body, stiffness, efforts, rise)
        self.tool_link = client.getNumJoints(self.body) - 1

    def set_friction(self, value: float) -> None:
        """Set the tool's friction coefficient as Bullet multiplies it."""
        self._client.changeDynamics(
            self.body, self.tool_link, lateralFriction=value, restitution=0.0, rollingFriction=0.0
        )

    def put(self, joints: Vector) -> None:
        """Set the joints to (J,) at once, at rest."""
        for joint, value in enumerate(joints.tolist()):
            self._client.resetJointState(self.body, joint, value, 0.0)
        if self.spring is not None:
            self.spring.relax()

    def command(self, joints: list[float], speeds: list[float]) -> None:
        """Command positions of now (J), and speeds (J) that lead to the next ones."""
        self._client.setJointMotorControlArray(
            self.body,
            self._joints,
            self._client.POSITION_CONTROL,
            targetPositions=joints,
            targetVelocities=speeds,
            forces=self._forces,
            positionGains=self._gains,
            velocityGains=self._ones,
        )

    def joint_states(self) -> tuple[Vector, Vector]:
        """Return the joints' positions (J,) and speeds (J,)."""
        states = self._client.getJointStates(self.body, self._joints)
        return np.array([s[0] for s in states]), np.array([s[1] for s in states])

    def tool(self) -> Tip:
        """Return where the tool's tip is, (3,) [m]; one on a spring is not where it is held."""
        return self.tip() if self.spring is None else self.spring.tip(self.tip())
