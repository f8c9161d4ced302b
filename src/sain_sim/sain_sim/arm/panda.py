"""The Panda with its stick: its description, made of that of ``pybullet_data``.

Hand, closed fingers and stick become part of the last link, so the arm has seven links and
seven joints and nothing else. Only the stick's round end collides: nothing else of the arm comes
lower than 0.1 m over the table, and disks are 0.04 m high. A ball, because Bullet finds the normal
between a ball and a disk's rim to 1e-5 rad, and between two cylinders to 1e-2 only. For viewers the
stick is rigid, also where a spring holds it in the simulation: each joint has a state.
"""

import xml.etree.ElementTree as ElementTree
from math import cos, pi, sin
from pathlib import Path
from typing import Final, NamedTuple

import pybullet_data

from sain_core.scratch import scratch_folder
from sain_sim.arm.client import Client
from sain_sim.arm.motion import FLANGE_DROP, JOINT_COUNT, TOOL_LENGTH

PANDA_FOLDER: Final = Path(pybullet_data.getDataPath()) / "franka_panda"
LAST_LINK: Final = "panda_link7"
KEPT_LINKS: Final = tuple(f"panda_link{index}" for index in range(8))
KEPT_JOINTS: Final = tuple(f"panda_joint{index}" for index in range(1, 8))
STICK_COLOR: Final = "0.13 0.14 0.17 1"
HAND_COLOR: Final = "0.93 0.93 0.93 1"

# link 7 (0.2 kg), hand (0.81 kg), two fingers (0.1 kg each) and stick (0.1 kg), stock URDF
END_MASS: Final = 1.31  # [kg]
END_CENTRE: Final = 0.15  # [m], their centre of mass along the flange's axis
END_INERTIA: Final = 0.1  # [kg m^2], of each link in the stock URDF

SPRUNG_MASS: Final = 2.0  # [kg], moves with a stick that a spring holds: some of a soft arm
SLIDE_MASS: Final = 0.01  # [kg], between the two directions of the spring
SLIDE_RANGE: Final = 0.16  # [m], either way: more than a push is long
# Without a visual, Bullet makes a mesh of what collides, which takes time.
UNSEEN: Final = '<visual><geometry><box size="0.002 0.002 0.002"/></geometry></visual>'
FINGER_DROP: Final = 0.0584  # [m], from hand to finger, stock URDF


JOINT_NAMES: Final = tuple(f"panda_joint{index}" for index in range(1, JOINT_COUNT + 1))
BASE_FRAME: Final = "panda_link0"
TOOL_FRAME: Final = "panda_tool"  # at the stick's tip
TORQUE_SCALE: Final = 20.0  # of joint torque limits and MuJoCo's servos, over Franka's
# Rotors turn a hundred times faster than the joints behind their gears, so an arm resists a
# knock with far more than its links. Bullet has no rotors, and its solver does not converge
# for light links that push heavy disks: the tool deviated, depending on the arm's pose.
BULLET_INERTIA: Final = 20.0  # of the links, over Franka's
STOCK_INERTIA: Final = 1.0
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # x, y, z, w


def panda_with_stick(
    radius: float, inertia_scale: float, visuals: bool, sprung: bool = False
) -> str:
    """Return the URDF of a Panda with a stick of this radius [m] below its flange.

    Masses and inertias are a multiple of the stock ones. Without visuals a world builds faster.
    A sprung stick slides across its axis, along two more joints.
    """
    robot = ElementTree.parse(PANDA_FOLDER / "panda.urdf").getroot()
    for tag, kept in (("link", KEPT_LINKS), ("joint", KEPT_JOINTS)):
        for part in robot.findall(tag):
            if part.get("name") not in kept:
                robot.remove(part)
    for link in robot.findall("link"):
        _remove(link, "collision")
        if link.get("name") == LAST_LINK:
            _remove(link, "inertial")
            link.extend(_hand(radius))
            if not sprung:
                link.extend(_stick(FLANGE_DROP, radius))
        _scale_inertia(link, inertia_scale)
    if sprung:
        robot.extend(_slides(radius))
    if not visuals:
        _hide(robot)
    for mesh in robot.iter("mesh"):
        mesh.set("filename", mesh.get("filename", "").replace("package://", f"{PANDA_FOLDER}/"))
    return ElementTree.tostring(robot, encoding="unicode")


def _remove(parent: ElementTree.Element, tag: str) -> None:
    for child in parent.findall(tag):
        parent.remove(child)


def _hide(robot: ElementTree.Element) -> None:
    """Leave out visuals, and what Bullet does not use: reading them takes time."""
    for joint in robot.findall("joint"):
        _remove(joint, "safety_controller")
    for link in robot.findall("link"):
        _remove(link, "visual")
        if link.find("collision") is not None:
            link.append(ElementTree.fromstring(UNSEEN))


def _scale_inertia(link: ElementTree.Element, scale: float) -> None:
    for value in [*link.iter("mass"), *link.iter("inertia")]:
        for name, number in value.attrib.items():
            value.set(name, str(scale * float(number)))


def _hand(radius: float) -> ElementTree.Element:
    """Return hand and fingers, and the inertia of all that the last link now carries."""
    finger = FLANGE_DROP + FINGER_DROP
    side = radius / 2**0.5  # the hand is turned by 45 degrees about the flange's axis
    return ElementTree.fromstring(f"""<parts>
      {_inertial(END_MASS, END_INERTIA, END_CENTRE)}
      {_mesh("hand", (0.0, 0.0, FLANGE_DROP), -pi / 4)}
      {_mesh("finger", (side, side, finger), -pi / 4)}
      {_mesh("finger", (-side, -side, finger), 3 * pi / 4)}
    </parts>""")


def _stick(drop: float, radius: float) -> ElementTree.Element:
    """Return a stick with a round end that begins so far below a link's origin [m]."""
    shaft = TOOL_LENGTH - radius  # down to the middle of the ball
    stick = f'<geometry><cylinder radius="{radius}" length="{shaft}"/></geometry>'
    middle = f'<origin xyz="0 0 {drop + shaft / 2}"/>'
    ball = f'<geometry><sphere radius="{radius}"/></geometry>'
    end = f'<origin xyz="0 0 {drop + shaft}"/>'
    return ElementTree.fromstring(f"""<parts>
      <visual>{middle}{stick}
        <material name="stick"><color rgba="{STICK_COLOR}"/></material></visual>
      <visual>{end}{ball}
        <material name="stick"><color rgba="{STICK_COLOR}"/></material></visual>
      <collision>{end}{ball}</collision>
    </parts>""")


def _slides(radius: float) -> ElementTree.Element:
    """Return two joints across the flange's axis and the links behind them, the stick last."""
    limit = f'<limit lower="-{SLIDE_RANGE}" upper="{SLIDE_RANGE}" effort="1e4" velocity="10"/>'
    parts = ElementTree.fromstring(f"""<parts>
      <link name="slide">{_inertial(SLIDE_MASS, SLIDE_MASS / 100, 0.0)}</link>
      <joint name="slide_x" type="prismatic">
        <parent link="{LAST_LINK}"/><child link="slide"/>
        <origin xyz="0 0 {FLANGE_DROP}"/><axis xyz="1 0 0"/>{limit}
      </joint>
      <link name="stick">{_inertial(SPRUNG_MASS, SPRUNG_MASS / 100, TOOL_LENGTH / 2)}</link>
      <joint name="slide_y" type="prismatic">
        <parent link="slide"/><child link="stick"/><axis xyz="0 1 0"/>{limit}
      </joint>
    </parts>""")
    stick = next(link for link in parts.iter("link") if link.get("name") == "stick")
    stick.extend(_stick(0.0, radius))
    return parts


def _inertial(mass: float, inertia: float, centre: float) -> str:
    return f"""<inertial>
        <origin xyz="0 0 {centre}"/><mass value="{mass}"/>
        <inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/>
      </inertial>"""


def _mesh(name: str, position: tuple[float, float, float], yaw: float) -> str:
    x, y, z = position
    return f"""<visual>
        <origin xyz="{x} {y} {z}" rpy="0 0 {yaw}"/>
        <geometry><mesh filename="package://meshes/visual/{name}.obj"/></geometry>
        <material name="hand"><color rgba="{HAND_COLOR}"/></material>
      </visual>"""


class PandaModel:
    """The robot description on disk, for as long as this object lives, and how to load it."""

    def __init__(self, tool_radius: float, visuals: bool = False, sprung: bool = False) -> None:
        """Write the URDF of a Panda with this stick [m]; visuals are meshes for pictures."""
        self._folder = scratch_folder("panda")
        self._path = Path(self._folder.name) / "panda.urdf"
        self._path.write_text(panda_with_stick(tool_radius, BULLET_INERTIA, visuals, sprung))

    def load(self, client: Client, base_height: float) -> int:
        """Load the arm with its base at z = base_height [m] and return its body."""
        flags = client.URDF_USE_IMPLICIT_CYLINDER
        body: int = client.loadURDF(
            str(self._path), [0.0, 0.0, base_height], useFixedBase=True, flags=flags
        )
        return body


class Link(NamedTuple):
    """Where a link is in its parent, at the joint's zero. Joints turn about their own z."""

    parent: str
    child: str
    origin: Vector  # [m]
    turn: Quaternion
    moves: bool

    def turned(self, angle: float) -> Quaternion:
        """Return the link's orientation in its parent at a joint angle [rad]."""
        x, y, z, w = self.turn
        s, c = sin(angle / 2.0), cos(angle / 2.0)
        return c * x + s * y, c * y - s * x, c * z + s * w, c * w - s * z


def describe_arm(tool_radius: float) -> str:
    """Return the URDF of a Panda with a stick of this radius [m], for viewers.

    Meshes are ``file://``, and the stick's tip is a link of its own.
    """
    text = panda_with_stick(tool_radius, STOCK_INERTIA, visuals=True)
    robot = ElementTree.fromstring(text)
    for mesh in robot.iter("mesh"):
        mesh.set("filename", f"file://{mesh.get('filename')}")
    tip = FLANGE_DROP + TOOL_LENGTH
    robot.extend(
        ElementTree.fromstring(f"""<parts>
          <link name="{TOOL_FRAME}"/>
          <joint name="{TOOL_FRAME}_joint" type="fixed">
            <parent link="{LAST_LINK}"/><child link="{TOOL_FRAME}"/><origin xyz="0 0 {tip}"/>
          </joint>
        </parts>""")
    )
    return ElementTree.tostring(robot, encoding="unicode")


def links_of(description: str) -> list[Link]:
    """Return the links of a description behind its joints, in the order of the joints."""
    return [_link(joint) for joint in ElementTree.fromstring(description).findall("joint")]


def _link(joint: ElementTree.Element) -> Link:
    from scipy.spatial.transform import Rotation  # takes half a second, and only viewers need it

    names = {part.tag: part.get("link", "") for part in joint}
    origin = joint.find("origin")
    place, angles = "0 0 0", "0 0 0"
    if origin is not None:
        place, angles = origin.get("xyz", place), origin.get("rpy", angles)
    moves = joint.get("type") == "revolute"
    axis = joint.find("axis")
    assert not moves or (axis is not None and axis.get("xyz") == "0 0 1")
    x, y, z = map(float, place.split())
    turn = Rotation.from_euler("xyz", [float(word) for word in angles.split()])  # fixed axes
    return Link(names["parent"], names["child"], (x, y, z), tuple(turn.as_quat().tolist()), moves)
