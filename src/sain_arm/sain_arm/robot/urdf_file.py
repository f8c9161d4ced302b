"""Reads the file of a URDF: its links and joints, with nothing but what is used of them.

All numbers are checked where they stand, and written out, so that whoever reads them later finds
finite ones. What is not used, as visuals and plugins, may be anything.
"""

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Final, NamedTuple
from xml.parsers import expat

import numpy as np

from sain_core.config import TURN
from sain_core.errors import ConfigError, UntrustedFileError
from sain_core.guarding.plugins import did_you_mean
from sain_core.guarding.untrusted import MIB, read_regular_text, reason_of, shown

URDF_BYTES: Final = 4 * MIB
MOVING: Final = ("revolute", "prismatic")
KINDS: Final = (*MOVING, "continuous", "fixed", "floating", "planar")
GEOMETRIES: Final = ("box", "capsule", "cylinder", "mesh", "sphere")
LONGEST: Final = 10.0  # [m], of an arm and its parts; beyond it the file is in millimetres
SHORTEST: Final = 1e-6  # [m], of a side of a part
LEAST_PART: Final = 0.002  # [m], of its longest side; below it a mesh in metres was scaled again
TURNS: Final = 2 * TURN  # [rad], of an angle; beyond it the file is in degrees
DEGREES: Final = ": are these degrees?"
LEAST_MOMENT: Final = 1e-12  # [kg m^2]


class Numbers(NamedTuple):
    """What an attribute may hold: how many numbers, their range, and what stands for none."""

    many: int
    low: float
    high: float
    default: str | None = None
    unit: str = ""
    hint: str = ""


MILLIMETRES: Final = ": are these millimetres?"
LENGTH: Final = Numbers(1, -LONGEST, LONGEST, "0", "m", MILLIMETRES)
ANGLE: Final = Numbers(1, -TURNS, TURNS, "0", "rad", DEGREES)
SIZE: Final = Numbers(1, SHORTEST, LONGEST, None, "m", MILLIMETRES)
RATE: Final = Numbers(1, 0.0, 1e12, "0")
MOMENT: Final = Numbers(1, -1e6, 1e6, "0", "kg m^2")
NUMBERS: Final[dict[str, dict[str, Numbers]]] = {  # of attributes, by the elements they are in
    "origin": {
        "xyz": LENGTH._replace(many=3, default="0 0 0"),
        "rpy": ANGLE._replace(many=3, default="0 0 0"),
    },
    "axis": {"xyz": Numbers(3, -1e6, 1e6, "1 0 0")},
    "dynamics": {"damping": RATE, "friction": RATE},
    "mass": {"value": Numbers(1, 0.0, 1e5, None, "kg")},
    "inertia": dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), MOMENT),
    "box": {"size": SIZE._replace(many=3)},
    "cylinder": {"radius": SIZE, "length": SIZE},
    "capsule": {"radius": SIZE, "length": SIZE},
    "sphere": {"radius": SIZE},
    "mesh": {"scale": Numbers(3, -1e6, 1e6, "1 1 1")},
}
CHILDREN: Final = {  # what is read, by the elements it is in
    "robot": ("link", "joint"),
    "link": ("inertial", "collision"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
    "inertial": ("origin", "mass", "inertia"),
    "collision": ("origin", "geometry"),
    "geometry": GEOMETRIES,
}


def parse_urdf(path: Path) -> ElementTree.Element:
    """Return the root of a URDF, with nothing but what is read of it."""
    try:
        text = read_regular_text(path, URDF_BYTES)
    except (OSError, ValueError) as error:
        raise ConfigError(f"urdf {path}: {reason_of(error)}") from error
    if not text.strip():
        raise ConfigError(f"urdf {path} is empty; if xacro wrote it, read its error")
    try:
        robot = tree_of(text)
    except UntrustedFileError as error:
        raise ConfigError(f"urdf {path} {error}") from error
    if any(element.tag.startswith("xacro:") for element in robot.iter()):
        raise ConfigError(xacro_advice(path))
    if robot.tag != "robot":
        raise ConfigError(f"urdf {path} is {shown(robot.tag)}; it must be <robot>")
    return _kept(robot)


def tree_of(text: str) -> ElementTree.Element:
    """Return the tree of an XML text; names keep their prefixes, declared or not, as in ROS.

    Raises:
        UntrustedFileError: it is no XML, or has a DOCTYPE.
    """
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler, parser.buffer_text = builder.data, True
    parser.StartDoctypeDeclHandler = _refuse_doctype
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise UntrustedFileError(f"is no XML: {error}") from error
    return builder.close()


def _refuse_doctype(*_: object) -> None:
    raise UntrustedFileError("has a DOCTYPE; none is read")


def _kept(element: ElementTree.Element) -> ElementTree.Element:
    """Return an element with the children that are read."""
    kept = ElementTree.Element(element.tag, element.attrib)
    kept.extend(_kept(part) for part in element if part.tag in CHILDREN.get(element.tag, ()))
    return kept


def xacro_advice(path: Path) -> str:
    """Return the error about a file that must be expanded first."""
    return (
        f"urdf {path} is xacro; expand it: `xacro {path.name} > expanded.urdf`, and give that file"
    )


def check_part(what: str, part: ElementTree.Element) -> None:
    """Raise where a link or a joint has what is no URDF; write its numbers out."""
    for element in part.iter():
        tags = [child.tag for child in element if child.tag != "collision"]
        for tag in tags:
            if tags.count(tag) > 1:
                raise ConfigError(f"{what} has two <{tag}> in one <{element.tag}>; allowed: one")
        if (element.tag == "geometry" and len(tags) != 1) or (
            element.tag == "collision" and "geometry" not in tags
        ):
            found = " and ".join(tags) or "nothing"
            raise ConfigError(
                f"{what} has {found} in <{element.tag}>; allowed: one of {', '.join(GEOMETRIES)}"
            )
        for key, allowed in NUMBERS.get(element.tag, {}).items():
            numbers = read_numbers(what, element, key, allowed)
            element.set(key, " ".join(map(repr, numbers)))
    if part.tag == "joint" and part.get("type") not in KINDS:
        kind = part.get("type", "")
        hint = did_you_mean(kind, KINDS)
        raise ConfigError(f"{what} has the type {shown(kind)}{hint}; allowed: {', '.join(KINDS)}")


def read_numbers(
    what: str, element: ElementTree.Element, key: str, allowed: Numbers
) -> list[float]:
    """Return the numbers of an attribute.

    Raises:
        ConfigError: there are others than allowed; what they belong to is `what`.
    """
    text = element.get(key, allowed.default)
    try:
        numbers = [float(word) for word in (text or "").split()]
    except ValueError:
        numbers = []
    if len(numbers) == allowed.many and all(allowed.low <= one <= allowed.high for one in numbers):
        return numbers
    has = (
        f"<{element.tag} {key}={shown(text)}>"
        if text is not None
        else f"<{element.tag}> without {key}"
    )
    amount = "a number" if allowed.many == 1 else f"{allowed.many} numbers"
    far = len(numbers) == allowed.many and max(map(abs, numbers)) > allowed.high
    raise ConfigError(
        f"{what} has {has}; allowed: {amount} from {allowed.low:.4g} to {allowed.high:.4g}"
        f" {allowed.unit}".rstrip()
        + allowed.hint * far
    )


def written(element: ElementTree.Element, key: str) -> list[float]:
    """Return the numbers that `check_part` wrote."""
    return [float(word) for word in element.get(key, "").split()]


def range_of(what: str, joint: ElementTree.Element) -> tuple[float, float] | None:
    """Return the range of a joint in its URDF; raise where it is none."""
    limit = joint.find("limit")
    if (
        limit is None
        or joint.get("type") == "continuous"
        or not {"lower", "upper"} & set(limit.keys())
    ):
        return None
    far = LENGTH if joint.get("type") == "prismatic" else ANGLE
    (lower,), (upper,) = (read_numbers(what, limit, key, far) for key in ("lower", "upper"))
    if lower >= upper:
        raise ConfigError(
            f"{what} has the limits lower={lower:g} and upper={upper:g}; lower must be less"
        )
    return lower, upper


def has_mass(inertial: ElementTree.Element) -> bool:
    """Return True if MuJoCo accepts the mass and the inertia of a link."""
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        return False
    moments = (written(inertia, key)[0] for key in NUMBERS["inertia"])
    xx, yy, zz, xy, xz, yz = moments
    least = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])[0]
    return bool(written(mass, "value")[0] > 0.0 and least > LEAST_MOMENT)
