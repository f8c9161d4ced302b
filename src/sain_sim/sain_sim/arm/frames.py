"""The arm as viewers draw it: its description, and where its links are.

The stick is rigid in it, also where a spring holds it in the simulation: each joint has a state.
"""

import xml.etree.ElementTree as ElementTree
from math import cos, sin
from typing import Final, NamedTuple

from sain_sim.arm.kinematics import FLANGE_DROP
from sain_sim.arm.panda import LAST_LINK, panda_with_stick

BASE_FRAME: Final = "panda_link0"
TOOL_FRAME: Final = "panda_tool"  # at the stick's tip
STOCK_INERTIA: Final = 1.0

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # x, y, z, w


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


def describe_arm(tool_radius: float, tool_length: float) -> str:
    """Return the URDF of a Panda with a stick of this radius and length [m], for viewers.

    Meshes are ``file://``, and the stick's tip is a link of its own.
    """
    text = panda_with_stick(tool_radius, tool_length, STOCK_INERTIA, visuals=True)
    robot = ElementTree.fromstring(text)
    for mesh in robot.iter("mesh"):
        mesh.set("filename", f"file://{mesh.get('filename')}")
    tip = FLANGE_DROP + tool_length
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
    names = {part.tag: part.get("link", "") for part in joint}
    origin = joint.find("origin")
    place, angles = "0 0 0", "0 0 0"
    if origin is not None:
        place, angles = origin.get("xyz", place), origin.get("rpy", angles)
    moves = joint.get("type") == "revolute"
    axis = joint.find("axis")
    assert not moves or (axis is not None and axis.get("xyz") == "0 0 1")
    return Link(names["parent"], names["child"], _vector(place), _turn(*_vector(angles)), moves)


def _vector(text: str) -> Vector:
    x, y, z = map(float, text.split())
    return x, y, z


def _turn(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the quaternion of fixed-axis roll, pitch and yaw [rad], as in URDF."""
    (sr, sp, sy), (cr, cp, cy) = (
        [part(angle / 2.0) for angle in (roll, pitch, yaw)] for part in (sin, cos)
    )
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
