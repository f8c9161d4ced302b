"""The arm as it collides, from its URDF. Each link is a node below its parent: viewers add up."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Self

import mujoco
import numpy as np
import viser
from scipy.spatial.transform import Rotation

from sain_arm.robot.urdf import read_links, resolve
from sain_core.errors import ConfigError
from sain_live.page.drawing import Quaternion, Vector
from sain_live.state import Level, LiveArm, LiveState

COLOUR: Final = (210, 212, 215)
LARGEST_MESH: Final = 50_000_000  # bytes of a file
MESHES: Final = (".obj", ".stl", ".ply", ".glb")


@dataclass(frozen=True)
class Link:
    """How a link hangs on its parent."""

    place: np.ndarray  # in the parent, at 0
    turn: Rotation
    joint: str = ""  # empty: it is fixed
    axis: np.ndarray = field(default_factory=lambda: np.zeros(3))  # in the link
    slides: bool = False

    @classmethod
    def of(cls, body: Any) -> Self:
        """Return the same of a MuJoCo body."""
        place, turn = body.pos.copy(), Rotation.from_quat(body.quat, scalar_first=True)
        for joint in body.joints:
            axis = joint.axis / np.linalg.norm(joint.axis)
            slides = joint.type == mujoco.mjtJoint.mjJNT_SLIDE
            return cls(place, turn, joint.name, axis, slides)
        return cls(place, turn)

    def pose(self, value: float = 0.0) -> tuple[Vector, Quaternion]:
        """Return the pose in the parent at a position [rad or m] of the joint."""
        place, turn = self.place, self.turn
        if self.slides:
            place = place + turn.apply(value * self.axis)
        else:
            turn = turn * Rotation.from_rotvec(value * self.axis)
        (x, y, z), (w, a, b, c) = place.tolist(), turn.as_quat(scalar_first=True).tolist()
        return (x, y, z), (w, a, b, c)


class ArmView:
    """Draws the arm as its joints are."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene
        self._root: Any = None
        self._drawn: LiveArm | None = None
        self._moving: list[tuple[Link, Any]] = []  # with their nodes
        self._joints: Mapping[str, float] = {}

    def show(self, state: LiveState) -> None:
        """Draw what has changed."""
        if state.arm is None:
            return
        if state.arm is not self._drawn:
            self._drawn = state.arm
            try:
                self._make(state.arm)
            except (ConfigError, OSError, ValueError) as error:
                state.tell(Level.FAULT, f"the arm is not drawn: {error}")
            self._joints = {}
        if state.joints is self._joints:
            return
        for link, node in self._moving:
            value = state.joints.get(link.joint)
            if value is not None and value != self._joints.get(link.joint):
                node.position, node.wxyz = link.pose(value)
        self._joints = state.joints

    def _make(self, arm: LiveArm) -> None:
        if self._root is not None:
            self._root.remove()
        self._moving = []
        spec = read_links(arm.description)
        (root,) = spec.worldbody.bodies
        place, turn = arm.frames.get(root.name, ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)))
        self._root = self._scene.add_frame("/arm", show_axes=False, position=place, wxyz=turn)
        self._hang(root, "/arm", {mesh.name: mesh for mesh in spec.meshes})

    def _hang(self, body: Any, path: str, meshes: Mapping[str, Any]) -> None:
        """Draw a link and all that hangs on it."""
        for number, geom in enumerate(body.geoms):
            self._draw(f"{path}/geometry{number}", geom, meshes)
        for child in body.bodies:
            link, below = Link.of(child), f"{path}/{child.name}"
            place, turn = link.pose()
            node = self._scene.add_frame(below, show_axes=False, position=place, wxyz=turn)
            if link.joint:
                self._moving.append((link, node))
            self._hang(child, below, meshes)

    def _draw(self, name: str, geom: Any, meshes: Mapping[str, Any]) -> None:
        where: dict[str, Any] = {"position": tuple(geom.pos), "wxyz": tuple(geom.quat)}
        match geom.type, geom.size:
            case mujoco.mjtGeom.mjGEOM_MESH, _:
                mesh = meshes[geom.meshname]
                vertices, faces = read_mesh(mesh.file)
                self._scene.add_mesh_simple(
                    name, vertices * mesh.scale, faces, color=COLOUR, **where
                )
            case mujoco.mjtGeom.mjGEOM_BOX, size:
                self._scene.add_box(name, color=COLOUR, dimensions=tuple(2.0 * size), **where)
            case mujoco.mjtGeom.mjGEOM_SPHERE, size:
                self._scene.add_icosphere(name, size[0], color=COLOUR, **where)
            case _, size:  # a cylinder, or a capsule without its ends
                self._scene.add_cylinder(name, size[0], 2.0 * size[1], color=COLOUR, **where)


def read_mesh(address: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (V, 3) of a mesh, in the unit of its file, and the faces (F, 3).

    Raises:
        ConfigError: a file that is missing, too large or of a kind that is not read.
    """
    import trimesh  # for a second

    path = resolve(address, Path())
    if path.suffix.lower() not in MESHES:
        raise ConfigError(f"mesh {address!r}; allowed: files of type {', '.join(MESHES)}")
    if not path.is_file() or path.stat().st_size > LARGEST_MESH:
        raise ConfigError(f"mesh {path} is missing or larger than {LARGEST_MESH >> 20} MB")
    mesh: Any = trimesh.load_mesh(path)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)
