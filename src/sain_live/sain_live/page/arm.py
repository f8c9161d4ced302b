"""The arm, from its URDF: each link is a node below its parent, so viewers add up the joints."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import viser

from sain_core.errors import ConfigError
from sain_live.page.geometry import Quaternion, Vector, about, of_angles, turned
from sain_live.page.meshes import read_mesh
from sain_live.state import Level, LiveArm, LiveState

PLAIN: Final = (210, 212, 215)
MOVES: Final = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Joint:
    """How a link hangs on its parent."""

    name: str
    kind: str
    parent: str
    child: str
    place: Vector
    turn: Quaternion
    axis: Vector

    def pose(self, value: float) -> tuple[Vector, Quaternion]:
        """Return the pose of the child in the parent at a position [rad or m] of the joint."""
        if self.kind == "prismatic":
            x, y, z = self.place + _matrix(self.turn) @ (value * np.array(self.axis))
            return (float(x), float(y), float(z)), self.turn
        return self.place, turned(self.turn, about(self.axis, value))


class ArmView:
    """Draws the arm as its joints are."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Draw nothing yet."""
        self._scene = server.scene
        self._root: Any = None
        self._drawn: LiveArm | None = None
        self._moving: list[tuple[Joint, Any]] = []
        self._joints: Mapping[str, float] = {}

    def show(self, known: LiveState) -> None:
        """Draw what has changed."""
        if known.arm is None:
            return
        if known.arm is not self._drawn:
            self._drawn = known.arm
            try:
                self._make(known.arm)
            except (ConfigError, ElementTree.ParseError, ValueError) as error:
                known.tell(Level.FAULT, f"the arm is not drawn: {error}")
            self._joints = {}
        if known.joints is self._joints:
            return
        for joint, frame in self._moving:
            value = known.joints.get(joint.name)
            if value is None or value == self._joints.get(joint.name):
                continue
            frame.position, frame.wxyz = joint.pose(value)
        self._joints = known.joints

    def _make(self, arm: LiveArm) -> None:
        if self._root is not None:
            self._root.remove()
        self._moving = []
        robot = ElementTree.fromstring(arm.description)
        joints = [read_joint(part) for part in robot.findall("joint")]
        links = {str(part.get("name")): part for part in robot.findall("link")}
        children = {joint.child for joint in joints}
        root = next((name for name in links if name not in children), None)
        if root is None:
            raise ConfigError("its description has no link that hangs on no other")
        self._root = self._scene.add_frame(
            "/arm", show_axes=False, position=arm.place, wxyz=arm.turn
        )
        colours = dict(_named_colours(robot))
        self._hang(root, "/arm", links, joints, colours)

    def _hang(
        self,
        link: str,
        path: str,
        links: Mapping[str, ElementTree.Element],
        joints: list[Joint],
        colours: Mapping[str, tuple[int, int, int]],
    ) -> None:
        """Draw a link and all that hangs on it."""
        for number, visual in enumerate(links[link].findall("visual")):
            self._draw(f"{path}/visual{number}", visual, colours)
        for joint in joints:
            if joint.parent != link or joint.child not in links:
                continue
            below = f"{path}/{joint.child}"
            place, turn = joint.pose(0.0)
            frame = self._scene.add_frame(below, show_axes=False, position=place, wxyz=turn)
            if joint.kind in MOVES:
                self._moving.append((joint, frame))
            self._hang(joint.child, below, links, joints, colours)

    def _draw(
        self,
        name: str,
        visual: ElementTree.Element,
        colours: Mapping[str, tuple[int, int, int]],
    ) -> None:
        geometry = visual.find("geometry")
        shape = None if geometry is None else next(iter(geometry), None)
        if shape is None:
            return
        place, turn = _origin(visual)
        colour, scene = _colour(visual, colours), self._scene
        scene.add_frame(name, show_axes=False, position=place, wxyz=turn)
        if shape.tag == "mesh":
            scale = _numbers(shape.get("scale", "1 1 1"))
            parts = read_mesh(shape.get("filename", ""), colour or PLAIN, colour is None)
            for number, (vertices, faces, own) in enumerate(parts):
                scene.add_mesh_simple(f"{name}/{number}", vertices * scale, faces, color=own)
        elif shape.tag == "box":
            size = _numbers(shape.get("size", "0 0 0"))
            scene.add_box(f"{name}/box", color=colour or PLAIN, dimensions=size)
        elif shape.tag == "cylinder":
            radius, length = float(shape.get("radius", 0)), float(shape.get("length", 0))
            scene.add_cylinder(f"{name}/cylinder", radius, length, color=colour or PLAIN)
        elif shape.tag == "sphere":
            radius = float(shape.get("radius", 0))
            scene.add_icosphere(f"{name}/ball", radius, color=colour or PLAIN)


def read_joint(part: ElementTree.Element) -> Joint:
    """Return a joint of a URDF."""
    ends = {one.tag: one.get("link", "") for one in part if one.tag in ("parent", "child")}
    axis = part.find("axis")
    direction = _numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0"))
    x, y, z = (direction / max(float(np.linalg.norm(direction)), 1e-9)).tolist()
    place, turn = _origin(part)
    names = str(part.get("name")), str(part.get("type")), ends["parent"], ends["child"]
    return Joint(*names, place, turn, (x, y, z))


def _origin(part: ElementTree.Element) -> tuple[Vector, Quaternion]:
    origin = part.find("origin")
    place = _numbers("0 0 0" if origin is None else origin.get("xyz", "0 0 0"))
    angles = _numbers("0 0 0" if origin is None else origin.get("rpy", "0 0 0"))
    x, y, z = place.tolist()
    return (x, y, z), of_angles(*angles.tolist())


def _numbers(text: str) -> np.ndarray:
    numbers = np.array([float(word) for word in text.split()])
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise ConfigError(f"its description has {text!r}; three finite numbers are needed")
    return numbers


def _named_colours(robot: ElementTree.Element) -> Iterator[tuple[str, tuple[int, int, int]]]:
    for material in robot.iter("material"):
        if (colour := _own_colour(material)) is not None:
            yield str(material.get("name")), colour


def _colour(
    visual: ElementTree.Element, colours: Mapping[str, tuple[int, int, int]]
) -> tuple[int, int, int] | None:
    """Return the colour of a visual; None: white or none, so the file of its mesh knows better."""
    material = visual.find("material")
    if material is None:
        return None
    found = _own_colour(material) or colours.get(str(material.get("name")))
    return None if found == (255, 255, 255) else found


def _own_colour(material: ElementTree.Element) -> tuple[int, int, int] | None:
    colour = material.find("color")
    if colour is None:
        return None
    red, green, blue = (round(255 * float(x)) for x in colour.get("rgba", "1 1 1 1").split()[:3])
    return red, green, blue


def _matrix(turn: Quaternion) -> np.ndarray:
    w, x, y, z = turn
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
