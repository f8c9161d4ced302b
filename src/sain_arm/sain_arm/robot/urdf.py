"""A URDF: refuses what cannot be planned for, and prepares it for MuJoCo.

What is prepared has absolute mesh paths, no visuals, the arm's base where it stands in the world, a
rod at the tool and a link at its tip. Joints that the arm does not move are fixed at 0.
"""

import logging
import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from sysconfig import get_path
from typing import Any, Final

import mujoco
import numpy as np

from sain_arm.robot.mesh import mesh_corners
from sain_arm.robot.urdf_file import (
    LEAST_PART,
    LONGEST,
    MOVING,
    RATE,
    SHORTEST,
    check_part,
    has_mass,
    parse_urdf,
    range_of,
    read_numbers,
    written,
    xacro_advice,
)
from sain_core.errors import ConfigError, UntrustedFileError
from sain_core.guarding.plugins import did_you_mean
from sain_core.guarding.untrusted import listed, reason_of, shown, user_path

logger = logging.getLogger(__name__)

OWN: Final = "sain_"  # begins the names of links that are added
ROOT: Final = "sain_world"
ROD: Final = "sain_rod"
TIP: Final = "sain_tip"
MOST_LINKS: Final = 500
LONGEST_NAME: Final = 200
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
LIGHT: Final = """<inertial><mass value="0.01"/>
  <inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial>"""


@dataclass(frozen=True)
class UrdfJoint:
    """A joint of the chain to the tool.

    Attributes:
        name: it.
        kind: as URDF names it.
        lower: position limit [rad] or [m]; None: the file states none.
        upper: likewise.
        velocity: limit [rad/s] or [m/s]; None: the file states none.
        effort: limit [N m] or [N]; 0: the file states none.
    """

    name: str
    kind: str
    lower: float | None
    upper: float | None
    velocity: float | None
    effort: float = 0.0

    @property
    def unit(self) -> str:
        """The unit of its position."""
        return "m" if self.kind == "prismatic" else "rad"


class Urdf:
    """A robot description."""

    def __init__(self, path: str, beside: Path = Path()) -> None:
        """Read a file, given as a path or ``package://``; relative paths are `beside` a folder.

        Raises:
            ConfigError: there is no such file or package, or it is no URDF; naming the link or the
                joint at fault.
        """
        self.path = resolve(path, beside)
        self.robot = parse_urdf(self.path)
        self._links, self._joints = self._named("link"), self._named("joint")
        self._by_child = self._tree()

    def _named(self, tag: str) -> dict[str, ElementTree.Element]:
        """Return all links or joints by their names."""
        found: dict[str, ElementTree.Element] = {}
        for number, part in enumerate(self.robot.findall(tag), 1):
            name = part.get("name", "")
            what = f"{self.path.name}: {tag} {shown(name)}"
            for element in part.iter():
                for key, value in element.items():
                    if "${" in value or "$(" in value:
                        raise ConfigError(
                            f"{what} has {key}={shown(value)}: {xacro_advice(self.path)}"
                        )
            if not name or len(name) > LONGEST_NAME or name.startswith(OWN):
                raise ConfigError(
                    f"{self.path.name}: {tag} {number} has the name {shown(name)}; give it 1 to"
                    f" {LONGEST_NAME} characters that do not begin with {OWN!r}"
                )
            if name in found:
                raise ConfigError(f"{self.path.name} has two {tag}s {name!r}; rename one")
            check_part(what, part)
            found[name] = part
        if tag == "link" and not 0 < len(found) <= MOST_LINKS:
            raise ConfigError(
                f"{self.path.name} has {len(found):,} links; allowed: 1 to {MOST_LINKS}"
            )
        return found

    def _tree(self) -> dict[str, ElementTree.Element]:
        """Return the joint that each link hangs on; raise where the links are no tree."""
        name, by_child = self.path.name, dict[str, ElementTree.Element]()
        for joint in self._joints.values():
            for end in ("parent", "child"):
                if (link := _end(joint, end)) not in self._links:
                    raise ConfigError(
                        f"{name}: joint {joint.get('name')!r} has the {end} {shown(link)}"
                        f"{did_you_mean(link, self._links)}; the links are {listed(self._links)}"
                    )
            if (first := by_child.setdefault(link, joint)) is not joint:
                raise ConfigError(
                    f"{name}: link {link!r} is the child of joints {first.get('name')!r} and"
                    f" {joint.get('name')!r}; allowed: one"
                )
        for link in self._links:
            way, above = dict[str, None](), link
            while above in by_child and above not in way:
                way[above] = None
                above = _end(by_child[above], "parent")
            if above in way:
                raise ConfigError(f"{name}: joints form a circle through the links {listed(way)}")
        if len(roots := [link for link in self._links if link not in by_child]) > 1:
            raise ConfigError(
                f"{name}: the links {listed(roots)} are no child of a joint; allowed: one, the root"
            )
        return by_child

    def chain(self, frame: str) -> tuple[UrdfJoint, ...]:
        """Return the joints that move a frame, from the base on.

        Raises:
            ConfigError: there is no such frame, or one of these joints mimics another one.
        """
        name = self.path.name
        if frame not in self._links:
            near = did_you_mean(frame, self._links)
            raise ConfigError(
                f"tool.frame is {shown(frame)}{near}; the links of {name}: {listed(self._links)}"
            )
        found, link, length = [], frame, 0.0
        while (joint := self._by_child.get(link)) is not None:
            link = _end(joint, "parent")
            if (origin := joint.find("origin")) is not None:
                length += float(np.linalg.norm(written(origin, "xyz")))
            if joint.get("type") != "fixed":
                found.append(self._moving(joint))
        if not found:
            raise ConfigError(f"no joint of {name} moves the tool's frame {frame!r}")
        if length > LONGEST:
            raise ConfigError(
                f"{name}: the arm to {frame!r} is {length:.0f} m long; allowed: {LONGEST:g} m;"
                " lengths are in m: do you mean millimetres?"
            )
        return tuple(reversed(found))

    def _moving(self, joint: ElementTree.Element) -> UrdfJoint:
        name, kind = joint.get("name", ""), joint.get("type", "")
        what = f"{self.path.name}: joint {name!r}"
        if (mimic := joint.find("mimic")) is not None:
            raise ConfigError(
                f"{what} mimics {shown(mimic.get('joint'))}; every joint between base and tool"
                " must move by itself"
            )
        if kind not in (*MOVING, "continuous"):
            allowed = ", ".join((*MOVING, "continuous"))
            raise ConfigError(f"{what} is {kind!r}; allowed: {allowed}")
        if (axis := joint.find("axis")) is not None and not np.linalg.norm(written(axis, "xyz")):
            raise ConfigError(f"{what} has the axis 0 0 0; give the direction that it turns about")
        lower, upper = range_of(what, joint) or (None, None)
        limit = joint.find("limit")
        if limit is None:
            return UrdfJoint(name, kind, lower, upper, None)
        (velocity,), (effort,) = (
            read_numbers(what, limit, key, RATE) for key in ("velocity", "effort")
        )
        stated = None if limit.get("velocity") is None else velocity
        return UrdfJoint(name, kind, lower, upper, stated, float(effort))

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
        robot, moved = deepcopy(self.robot), set(moved)
        if robot.find("link/collision") is None:
            raise ConfigError(
                f"no link of {self.path.name} has a collision geometry: contacts of the arm could"
                " not be checked; use a URDF with collision meshes"
            )
        for link in robot.findall("link"):
            for mesh in link.iter("mesh"):
                mesh.set("filename", str(self._mesh(link.get("name", ""), mesh)))
        self._weigh(robot, {_end(self._joints[name], "child") for name in moved})
        for joint in robot.findall("joint"):
            if joint.get("name") not in moved:
                joint.set("type", "fixed")
            for part in (*joint.findall("mimic"), *joint.findall("limit")):
                joint.remove(part)
            name = joint.get("name", "")
            if name in moved and (limits := range_of(name, self._joints[name])):
                lower, upper = map(repr, limits)
                joint.append(ElementTree.Element("limit", lower=lower, upper=upper))
            _rename_world(joint)
        _rename_world(robot)
        (root,) = (link for link in self._links if link not in self._by_child)
        root = "urdf_world" if root == "world" else root
        x, y, z, yaw = base
        length, radius = rod
        robot.extend(_part(ROOT, root, f"{x} {y} {z}", f"0 0 {yaw}", parent_is_new=True))
        robot.extend(_part(frame, ROD, "0 0 0", AXES[axis], parent_is_new=False))
        robot.extend(_part(ROD, TIP, f"0 0 {length}", "0 0 0", parent_is_new=False))
        if length > 0.0:
            link = next(one for one in robot.findall("link") if one.get("name") == ROD)
            link.append(_cylinder(length, radius))
        robot.insert(0, _compiler())
        return ElementTree.tostring(robot, encoding="unicode")

    def _weigh(self, robot: ElementTree.Element, moved: set[str]) -> None:
        """Give a mass to the links that have none: of their geometry, or a small one."""
        weighed = []
        for link in robot.findall("link"):
            inertial = link.find("inertial")
            if inertial is not None and has_mass(inertial):
                continue
            if inertial is not None:
                link.remove(inertial)
            if link.get("name") in moved:
                weighed.append(link.get("name", ""))
                if link.find("collision") is None:
                    link.append(ElementTree.fromstring(LIGHT))
        if weighed:
            logger.warning(
                "%s: links without mass or inertia: %s; taken is that of their geometry in water,"
                " without geometry 10 g",
                self.path.name,
                listed(weighed),
            )

    def _mesh(self, link: str, mesh: ElementTree.Element) -> Path:
        """Return the file of a mesh, once it can be read."""
        name = mesh.get("filename", "")
        what = f"{self.path.name}: link {link!r} has the collision mesh {shown(name)}"
        path = resolve(name, self.path.parent)
        scale = written(mesh, "scale")
        try:
            width = np.ptp(mesh_corners(path) * scale, axis=0)
        except (OSError, UntrustedFileError, ValueError) as error:
            raise ConfigError(f"{what}: {path}: {reason_of(error)}") from error
        if not (LEAST_PART <= width.max() <= LONGEST and width.min() > SHORTEST):
            raise ConfigError(
                f"{what} of {' x '.join(f'{one:.4g}' for one in width)} m, of the scale"
                f" {' '.join(f'{one:g}' for one in scale)}; allowed: {LEAST_PART:g} to"
                f" {LONGEST:g} m for the longest side, {SHORTEST:g} m or more for the shortest;"
                ' the scale is "0.001 0.001 0.001" for a mesh in millimetres, "1 1 1" for metres'
            )
        return path


def read_links(description: str) -> Any:
    """Return the specification of a description, as prepared or a driver's; no mesh is read.

    Its bodies live no longer than it. Raises `ValueError`: MuJoCo takes it for no robot.
    """
    try:
        robot = ElementTree.fromstring(description)
    except ElementTree.ParseError as error:
        raise ValueError(f"it is no XML: {error}") from error
    if robot.find("mujoco") is None:
        robot.insert(0, _compiler())
    for part in (robot, *robot.findall("joint")):
        _rename_world(part)
    return mujoco.MjSpec.from_string(ElementTree.tostring(robot, encoding="unicode"))


def _compiler() -> ElementTree.Element:
    options = ElementTree.Element("mujoco")
    options.append(ElementTree.Element("compiler", COMPILER))
    return options


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

    A package is looked for among those installed, then among the folders that it is beside.

    Raises:
        ConfigError: there is no such package.
    """
    if name.startswith("package://"):
        package, _, rest = name.removeprefix("package://").partition("/")
        place = beside.resolve()
        around = [folder for folder in (place, *place.parents) if folder.name == package]
        for folder in (*(share / package for share in _shares()), *around):
            if package and folder.is_dir():
                return folder / rest
        raise ConfigError(
            f"there is no package {shown(package)} for {shown(name)}: install it, source its"
            " workspace, or give a path"
        )
    return beside / user_path(name.removeprefix("file://"))


def _shares() -> Iterable[Path]:
    """Yield the folders of packages' data: of sourced workspaces, then of wheels."""
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(":"):
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
