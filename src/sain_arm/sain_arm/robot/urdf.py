"""Reads a URDF, refuses what cannot be planned for, and prepares it for MuJoCo.

What is prepared has absolute mesh paths, no visuals, the arm's base where it stands in the world, a
rod at the tool and a link at its tip. Joints that the arm does not move are fixed at 0.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from sysconfig import get_path
from typing import Final

from sain_core.errors import ConfigError, UntrustedFileError
from sain_core.guarding.untrusted import read_regular

ROOT: Final = "sain_world"
ROD: Final = "sain_rod"
TIP: Final = "sain_tip"
URDF_BYTES: Final = 10_000_000
MOVING: Final = ("revolute", "prismatic")
MESHES: Final = (".stl", ".obj", ".msh")  # what MuJoCo reads
COMPILER: Final = {
    "strippath": "false",
    "discardvisual": "true",
    "fusestatic": "false",
    "balanceinertia": "true",
}
AXES: Final = {  # roll and pitch [rad] that turn z into the axis of the tool
    "z": "0 0 0",
    "-z": "3.14159265358979 0 0",
    "x": "0 1.5707963267949 0",
    "-x": "0 -1.5707963267949 0",
    "y": "-1.5707963267949 0 0",
    "-y": "1.5707963267949 0 0",
}


@dataclass(frozen=True)
class UrdfJoint:
    """A joint of the chain to the tool.

    Attributes:
        name: it.
        kind: as URDF names it.
        lower: position limit [rad] or [m]; None: the file states none.
        upper: likewise.
        velocity: limit [rad/s] or [m/s]; None: the file states none.
    """

    name: str
    kind: str
    lower: float | None
    upper: float | None
    velocity: float | None


class Urdf:
    """A robot description."""

    def __init__(self, path: str, beside: Path = Path()) -> None:
        """Read a file, given as a path or ``package://``; relative paths are `beside` a folder.

        Raises:
            ConfigError: there is no such file or package, or it is no URDF.
        """
        self.path = resolve(path, beside)
        try:
            self.robot = ElementTree.fromstring(read_regular(self.path, URDF_BYTES))
        except OSError as error:
            raise ConfigError(f"urdf {self.path}: {error.strerror or error}") from error
        except UntrustedFileError as error:
            raise ConfigError(f"urdf {self.path} is not read: {error}") from error
        except ElementTree.ParseError as error:
            raise ConfigError(f"urdf {self.path} is no XML: {error}") from error
        if self.robot.tag != "robot":
            raise ConfigError(f"urdf {self.path} is <{self.robot.tag}>; it must be <robot>")
        self._joints = {joint.get("name", ""): joint for joint in self.robot.findall("joint")}
        self.links = [link.get("name", "") for link in self.robot.findall("link")]

    def chain(self, frame: str) -> tuple[UrdfJoint, ...]:
        """Return the joints that move a frame, from the base on.

        Raises:
            ConfigError: there is no such frame, or one of these joints mimics another one.
        """
        if frame not in self.links:
            known = ", ".join(self.links)
            raise ConfigError(f"tool.frame is {frame!r}; the links of {self.path.name}: {known}")
        by_child = {_end(joint, "child"): joint for joint in self._joints.values()}
        found, link = [], frame
        while joint := by_child.get(link):
            link = _end(joint, "parent")
            if joint.get("type") != "fixed":
                found.append(self._moving(joint))
        if not found:
            raise ConfigError(f"no joint of {self.path.name} moves the tool's frame {frame!r}")
        return tuple(reversed(found))

    def _moving(self, joint: ElementTree.Element) -> UrdfJoint:
        name, kind = joint.get("name", ""), joint.get("type", "")
        mimic, limit = joint.find("mimic"), joint.find("limit")
        if mimic is not None:
            raise ConfigError(
                f"joint {name!r} mimics {mimic.get('joint')!r}; every joint between base and tool"
                " must move by itself"
            )
        if kind not in (*MOVING, "continuous"):
            allowed = ", ".join((*MOVING, "continuous"))
            raise ConfigError(f"joint {name!r} is {kind!r}; allowed: {allowed}")
        given = {} if limit is None else limit.attrib
        lower, upper = (
            float(given[key]) if key in given and kind in MOVING else None
            for key in ("lower", "upper")
        )
        velocity = float(given.get("velocity", 0.0)) or None
        return UrdfJoint(name, kind, lower, upper, velocity)

    def prepared(
        self,
        moved: Iterable[str],
        base: tuple[float, float, float, float],
        frame: str,
        axis: str,
        rod: tuple[float, float],
    ) -> str:
        """Return the description for MuJoCo.

        Args:
            moved: names of the joints that the arm moves.
            base: x, y, z [m] and yaw [rad] of the robot's root in the world.
            frame: the link that holds the tool.
            axis: of this link, along which the tool points.
            rod: length and radius [m] of a rod that begins there; without length: no rod.

        Raises:
            ConfigError: a mesh is missing or of a kind that is not read, or nothing collides.
        """
        robot = ElementTree.fromstring(ElementTree.tostring(self.robot))
        moved = set(moved)
        for link in robot.findall("link"):
            for visual in link.findall("visual"):
                link.remove(visual)
        if robot.find("link/collision") is None:
            raise ConfigError(
                f"no link of {self.path.name} has a collision geometry: contacts of the arm could"
                " not be checked; use a URDF with collision meshes"
            )
        for mesh in robot.iter("mesh"):
            mesh.set("filename", str(self._mesh(mesh.get("filename", ""))))
        for joint in robot.findall("joint"):
            if joint.get("name") not in moved:
                joint.set("type", "fixed")
            for mimic in joint.findall("mimic"):
                joint.remove(mimic)
            _rename_world(joint)
        _rename_world(robot)
        children = {_end(joint, "child") for joint in robot.findall("joint")}
        roots = [link.get("name", "") for link in robot.findall("link")]
        root = next(name for name in roots if name not in children)
        x, y, z, yaw = base
        length, radius = rod
        robot.extend(_part(ROOT, root, f"{x} {y} {z}", f"0 0 {yaw}", parent_is_new=True))
        robot.extend(_part(frame, ROD, "0 0 0", AXES[axis], parent_is_new=False))
        robot.extend(_part(ROD, TIP, f"0 0 {length}", "0 0 0", parent_is_new=False))
        if length > 0.0:
            link = next(one for one in robot.findall("link") if one.get("name") == ROD)
            link.append(_cylinder(length, radius))
        compiler = ElementTree.Element("mujoco")
        compiler.append(ElementTree.Element("compiler", COMPILER))
        robot.insert(0, compiler)
        return ElementTree.tostring(robot, encoding="unicode")

    def _mesh(self, name: str) -> Path:
        path = resolve(name, self.path.parent)
        if not path.is_file():
            raise ConfigError(f"{self.path.name} has the mesh {name}: there is no file {path}")
        if path.suffix.lower() not in MESHES:
            raise ConfigError(
                f"{self.path.name} has the collision mesh {name}; allowed: {', '.join(MESHES)}"
            )
        return path


def visible(description: str) -> str:
    """Return a description whose links look as they collide, for viewers."""
    robot = ElementTree.fromstring(description)
    for link in robot.findall("link"):
        if link.find("visual") is None:
            for collision in link.findall("collision"):
                visual = ElementTree.SubElement(link, "visual")
                visual.extend(collision)
    return ElementTree.tostring(robot, encoding="unicode")


def resolve(name: str, beside: Path) -> Path:
    """Return the file of a path, ``file://`` or ``package://`` address.

    Raises:
        ConfigError: there is no such package.
    """
    if name.startswith("package://"):
        package, _, rest = name.removeprefix("package://").partition("/")
        for folder in _shares():
            if (folder / package).is_dir():
                return folder / package / rest
        raise ConfigError(
            f"there is no package {package!r} for {name}: install it, source its workspace, or"
            " give a path"
        )
    return beside / Path(name.removeprefix("file://")).expanduser()


def _shares() -> Iterable[Path]:
    """Yield the folders of packages' data: of sourced workspaces, then of wheels."""
    from os import environ

    for prefix in environ.get("AMENT_PREFIX_PATH", "").split(":"):
        if prefix:
            yield Path(prefix) / "share"
    yield Path(get_path("purelib")) / "cmeel.prefix" / "share"


def _end(joint: ElementTree.Element, tag: str) -> str:
    end = joint.find(tag)
    return "" if end is None else end.get("link", "")


def _rename_world(element: ElementTree.Element) -> None:
    """Rename a link called ``world``: MuJoCo has a body of this name."""
    for tag, key in (("link", "name"), ("parent", "link"), ("child", "link")):
        for one in element.findall(tag):
            if one.get(key) == "world":
                one.set(key, "urdf_world")


def _part(
    parent: str, child: str, place: str, turn: str, parent_is_new: bool
) -> list[ElementTree.Element]:
    """Return a new link, and the fixed joint between parent and child."""
    new = parent if parent_is_new else child
    text = f"""<parts>
      <link name="{new}"/>
      <joint name="{child}_{parent}" type="fixed">
        <parent link="{parent}"/><child link="{child}"/><origin xyz="{place}" rpy="{turn}"/>
      </joint>
    </parts>"""
    return list(ElementTree.fromstring(text))


def _cylinder(length: float, radius: float) -> ElementTree.Element:
    text = f"""<collision>
      <origin xyz="0 0 {length / 2}" rpy="0 0 0"/>
      <geometry><cylinder radius="{radius}" length="{length}"/></geometry>
    </collision>"""
    return ElementTree.fromstring(text)
