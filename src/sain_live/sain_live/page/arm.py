"""The arm, from its URDF: each link is a node below its parent, so viewers add up the joints.

Meshes are read once, as that takes longer than the rest of a page. What was read of a file is
kept in the user's cache folder, until the file changes.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple
from urllib.parse import unquote, urlsplit

import numpy as np
import viser
from joblib import Memory
from scipy.spatial.transform import Rotation

from sain_core.errors import ConfigError
from sain_core.scratch import cache_folder
from sain_live.page.drawing import Quaternion, Vector
from sain_live.state import Level, LiveArm, LiveState

LARGEST_MESH: Final = 50_000_000  # bytes of a file
MESHES: Final = (".obj", ".stl", ".ply", ".glb")
KEPT: Final = 200  # meshes; older ones are forgotten

Colour = tuple[int, int, int]


class Mesh(NamedTuple):
    """The part of a mesh that has one colour."""

    vertices: np.ndarray  # (V, 3) [m]
    faces: np.ndarray  # (F, 3), numbers of vertices
    colour: Colour


def read_mesh(filename: str, colour: Colour, own: bool) -> list[Mesh]:
    """Return the parts of a mesh, one for each colour that its file has.

    Args:
        filename: a path or a ``file:`` address.
        colour: of all, or with `own` of those parts that have none.
        own: whether the file's colours are taken.

    Raises:
        ConfigError: a file that is missing, too large or of a kind that is not read.
    """
    path = Path(unquote(urlsplit(filename).path))
    if urlsplit(filename).scheme not in ("", "file") or path.suffix.lower() not in MESHES:
        raise ConfigError(f"mesh {filename!r}; allowed: files of type {', '.join(MESHES)}")
    if not path.is_file() or path.stat().st_size > LARGEST_MESH:
        raise ConfigError(f"mesh {path} is missing or larger than {LARGEST_MESH >> 20} MB")
    memory = Memory(cache_folder() / "meshes", verbose=0)
    with suppress(OSError):
        memory.reduce_size(items_limit=KEPT)
    meshes: list[Mesh] = memory.cache(_read)(path, path.stat().st_mtime_ns, colour, own)
    return meshes


def _read(path: Path, _changed: int, colour: Colour, own: bool) -> list[Mesh]:
    """Return the parts of a file that was changed at a time [ns]."""
    import trimesh  # for a second

    shades: dict[Colour, list[tuple[np.ndarray, np.ndarray]]] = {}
    loaded: Any = trimesh.load(path, force="scene")
    for node in loaded.graph.nodes_geometry:  # not dump(), which copies each texture for each part
        transform, name = loaded.graph[node]
        part = loaded.geometry[name]
        material = getattr(getattr(part, "visual", None), "material", None)
        main = getattr(material, "main_color", None)
        red, green, blue = colour if main is None or not own else map(int, main[:3])
        vertices = np.asarray(part.vertices) @ transform[:3, :3].T + transform[:3, 3]
        shades.setdefault((red, green, blue), []).append((vertices, np.asarray(part.faces)))
    meshes = []
    for shade, parts in shades.items():
        before = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
        faces = [faces + first for (_, faces), first in zip(parts, before, strict=True)]
        vertices = np.concatenate([vertices for vertices, _ in parts])
        single = vertices.astype(np.float32), np.concatenate(faces).astype(np.uint32)
        meshes.append(Mesh(*single, shade))
    return meshes


PLAIN: Final = (210, 212, 215)
MOVES: Final = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Joint:
    """How a link hangs on its parent."""

    name: str
    kind: str
    parent: str
    child: str
    place: np.ndarray
    turn: Rotation
    axis: np.ndarray  # a unit vector

    def pose(self, value: float) -> tuple[Vector, Quaternion]:
        """Return the pose of the child in the parent at a position [rad or m] of the joint."""
        if self.kind == "prismatic":
            return _pose(self.place + self.turn.apply(value * self.axis), self.turn)
        return _pose(self.place, self.turn * Rotation.from_rotvec(value * self.axis))


class ArmView:
    """Draws the arm as its joints are."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene
        self._root: Any = None
        self._drawn: LiveArm | None = None
        self._moving: list[tuple[Joint, Any]] = []
        self._joints: Mapping[str, float] = {}

    def show(self, state: LiveState) -> None:
        """Draw what has changed."""
        if state.arm is None:
            return
        if state.arm is not self._drawn:
            self._drawn = state.arm
            try:
                self._make(state.arm)
            except (ConfigError, ElementTree.ParseError, ValueError) as error:
                state.tell(Level.FAULT, f"the arm is not drawn: {error}")
            self._joints = {}
        if state.joints is self._joints:
            return
        for joint, frame in self._moving:
            value = state.joints.get(joint.name)
            if value is None or value == self._joints.get(joint.name):
                continue
            frame.position, frame.wxyz = joint.pose(value)
        self._joints = state.joints

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
        place, turn = arm.frames.get(root, ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)))
        self._root = self._scene.add_frame("/arm", show_axes=False, position=place, wxyz=turn)
        colours = dict(_named_colours(robot))
        self._hang(root, "/arm", links, joints, colours)

    def _hang(
        self,
        link: str,
        path: str,
        links: Mapping[str, ElementTree.Element],
        joints: list[Joint],
        colours: Mapping[str, Colour],
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

    def _draw(self, name: str, visual: ElementTree.Element, colours: Mapping[str, Colour]) -> None:
        geometry = visual.find("geometry")
        shape = None if geometry is None else next(iter(geometry), None)
        if shape is None:
            return
        place, turn = _pose(*_origin(visual))
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
    names = str(part.get("name")), str(part.get("type")), ends["parent"], ends["child"]
    return Joint(*names, *_origin(part), direction / max(float(np.linalg.norm(direction)), 1e-9))


def _origin(part: ElementTree.Element) -> tuple[np.ndarray, Rotation]:
    origin = part.find("origin")
    given = {} if origin is None else origin.attrib
    place, angles = (_numbers(given.get(name, "0 0 0")) for name in ("xyz", "rpy"))
    return place, Rotation.from_euler("xyz", angles)  # about fixed axes


def _pose(place: np.ndarray, turn: Rotation) -> tuple[Vector, Quaternion]:
    """Return x y z, and the quaternion w x y z, as viser has them."""
    (x, y, z), (a, b, c, w) = place.tolist(), turn.as_quat().tolist()
    return (x, y, z), (w, a, b, c)


def _numbers(text: str) -> np.ndarray:
    numbers = np.array([float(word) for word in text.split()])
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise ConfigError(f"its description has {text!r}; three finite numbers are needed")
    return numbers


def _named_colours(robot: ElementTree.Element) -> Iterator[tuple[str, Colour]]:
    for material in robot.iter("material"):
        if (colour := _own_colour(material)) is not None:
            yield str(material.get("name")), colour


def _colour(visual: ElementTree.Element, colours: Mapping[str, Colour]) -> Colour | None:
    """Return the colour of a visual; None: white or none, so the file of its mesh knows better."""
    material = visual.find("material")
    if material is None:
        return None
    found = _own_colour(material) or colours.get(str(material.get("name")))
    return None if found == (255, 255, 255) else found


def _own_colour(material: ElementTree.Element) -> Colour | None:
    colour = material.find("color")
    if colour is None:
        return None
    red, green, blue = (round(255 * float(x)) for x in colour.get("rgba", "1 1 1 1").split()[:3])
    return red, green, blue
