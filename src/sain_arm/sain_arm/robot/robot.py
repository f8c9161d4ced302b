"""A robot, as one YAML file states it.

    urdf: package://my_description/urdf/my_arm.urdf
    tool: {frame: tool0, rod: 0.15, radius: 0.012}
    controller: joint_trajectory_controller
    home: {joint_1: 0.0, joint_2: -1.2, joint_3: 1.5}

`KEYS` has all that may stand in it. Angles are in rad, lengths in m, times in s. ``home`` has the
joints that move, by name or in their order from the base; what else the URDF has is fixed at 0.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_arm.robot.urdf import AXES, Urdf, UrdfJoint
from sain_core.config import check_angle, check_number, check_text
from sain_core.errors import ConfigError
from sain_core.feasibility import Reach
from sain_core.guarding.documents import read_user_yaml
from sain_core.guarding.plugins import did_you_mean
from sain_core.guarding.untrusted import (
    TIP_RADII,
    check_ros_name,
    listed,
    one_line,
    shown,
    user_path,
)

Joints = Float[ndarray, "_ J"]  # each way has its own number of points
Vector = Float[ndarray, "J"]

SHIPPED: Final = Path(__file__).parent.parent / "robots"
KEYS: Final = {
    "": ("urdf", "base", "tool", "controller", "home", "limits", "workspace", "reach"),
    "base": ("x", "y", "z", "yaw"),
    "tool": ("frame", "axis", "rod", "radius"),
    "limits": ("position", "velocity", "acceleration"),
    "workspace": ("x", "y", "z"),
    "reach": ("inner", "outer", "bearing"),
}
NEEDED: Final = {
    "": ("urdf", "tool", "controller", "home"),
    "tool": ("frame", "radius"),
    "reach": ("inner", "outer"),
}
LONGEST_TEXT: Final = 4096  # characters, as the longest path
FAR: Final = 10.0  # [m]
LOWEST: Final = 1.0  # [m], of a base below the table top
FASTEST: Final = 50.0  # [rad/s]
STRONGEST: Final = 500.0  # [rad/s^2]
LEAST_RATE: Final = 1e-3  # likewise
RATES: Final = {"velocity": "/s", "acceleration": "/s^2"}
START_TIME: Final = 0.4  # [s], to full speed where no acceleration is given


@dataclass(frozen=True, eq=False)
class Robot:
    """An arm with a tool.

    Attributes:
        name: of its file.
        description: its URDF, as `Urdf.prepared` makes it.
        joints: names, in the order of all vectors.
        home: angles [rad].
        lower: position limits [rad].
        upper: likewise.
        velocity: limits [rad/s].
        acceleration: limits [rad/s^2].
        effort: limits [N m] of the URDF; infinite where it states none.
        tool_radius: of the rod [m].
        controller: which serves ``<controller>/follow_joint_trajectory``.
        base: its place x, y [m] in the world.
        workspace: (3, 2), lowest and highest x, y, z [m] of the tool's tip.
        reach: where the tool can stand; None: its inverse kinematics tell.
    """

    name: str
    description: str
    joints: tuple[str, ...]
    home: Vector
    lower: Vector
    upper: Vector
    velocity: Vector
    acceleration: Vector
    effort: Vector
    tool_radius: float
    controller: str
    base: Float[ndarray, "2"]
    workspace: Float[ndarray, "3 2"]
    reach: Reach | None = None

    def aside(self, turn: float) -> Vector:
        """Return the angles (J,) at home with the first joint turned [rad], as far as it goes."""
        joints = self.home.copy()
        joints[0] = np.clip(joints[0] + turn, self.lower[0], self.upper[0])
        return joints


def read_robot(name: str) -> Robot:
    """Return the robot of a YAML file, or a shipped one by its name.

    Raises:
        ConfigError: naming the file and what is wrong in it.
    """
    if not name:
        raise ConfigError(f"robot is empty; give a YAML file, or one of {', '.join(shipped())}")
    path = SHIPPED / f"{name}.yaml" if name in shipped() else user_path(name)
    content = read_user_yaml(path, "robot file", f"; shipped are {', '.join(shipped())}")
    try:
        return parse_robot(content, path.stem, path.parent)
    except ConfigError as error:
        raise ConfigError(one_line(f"robot file {path}: {error}")) from error


def shipped() -> tuple[str, ...]:
    """Return the names of the robots that come with this package."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.yaml")))


def parse_robot(content: Any, name: str, beside: Path) -> Robot:
    """Return the robot that the content of a file states; raises as `read_robot`."""
    rows = _Section("", content)
    tool = _Section("tool", rows.given["tool"])
    base, limits = (_Section(key, rows.given.get(key, {})) for key in ("base", "limits"))
    space = _Section("workspace", rows.given.get("workspace", {}))
    axis = tool.given.get("axis", "z")
    if not isinstance(axis, str) or axis not in AXES:
        hint = did_you_mean(str(axis), AXES)
        raise ConfigError(f"tool.axis is {shown(axis)}{hint}; allowed: {', '.join(AXES)}")
    frame = tool.text("frame")
    length, radius = (
        tool.number("rod", 0.0, 0.0, 1.0, "m"),
        tool.number("radius", None, *TIP_RADII, "m"),
    )
    urdf = Urdf(rows.text("urdf"), beside)
    chain = urdf.chain(frame)
    home = _home(rows.given["home"], chain)
    joints = tuple(home)
    stands = (
        *(base.number(key, 0.0, -LOWEST if key == "z" else -FAR, FAR, "m") for key in "xyz"),
        check_angle("base.yaw", base.given.get("yaw", 0.0)),
    )
    position = _Section("limits.position", limits.given.get("position", {}), joints)
    bounds = np.array([_bounds(joint, position) for joint in chain])
    values = np.array([home[joint] for joint in joints])
    for joint, value, (low, high) in zip(chain, values.tolist(), bounds, strict=True):
        check_number(f"home of joint {joint.name!r}", value, low, high, joint.unit)
    velocity = _per_joint(limits, "velocity", FASTEST, [joint.velocity for joint in chain], chain)
    usual = [value / START_TIME for value in velocity]
    acceleration = _per_joint(limits, "acceleration", STRONGEST, usual, chain)
    prepared = urdf.prepared(
        joints, (stands[0], stands[1], stands[2], stands[3]), frame, axis, (length, radius)
    )
    return Robot(
        name,
        prepared,
        joints,
        values,
        bounds[:, 0],
        bounds[:, 1],
        np.array(velocity),
        np.array(acceleration),
        np.array([joint.effort or np.inf for joint in chain]),
        radius,
        check_ros_name("controller", rows.text("controller")),
        np.array(stands[:2]),
        np.array([space.pair(key, (-FAR, FAR)) for key in KEYS["workspace"]]),
        _reach(rows.given["reach"]) if "reach" in rows.given else None,
    )


def _reach(given: Any) -> Reach:
    ring = _Section("reach", given)
    inner = ring.number("inner", None, 0.0, FAR, "m")
    bearing = ring.number("bearing", np.pi, 0.0, np.pi, "rad")
    return Reach(inner, ring.number("outer", None, inner, FAR, "m"), bearing)


class _Section:
    """A mapping of the file, whose keys are checked."""

    def __init__(self, name: str, content: Any, allowed: tuple[str, ...] = ()) -> None:
        allowed = allowed or KEYS[name]
        if not isinstance(content, Mapping):
            what = f"{name} is {shown(content)}; it" if name else "it"
            raise ConfigError(f"{what} must have keys: {', '.join(allowed)}")
        for key in content:
            if key not in allowed:
                hint = did_you_mean(str(key), allowed)
                raise ConfigError(
                    f"{self._within(name)}unknown key {shown(key)}{hint};"
                    f" allowed: {listed(allowed)}"
                )
        for key in NEEDED.get(name, ()):
            if key not in content:
                raise ConfigError(f"{self._within(name)}{key} is missing")
        self.name, self.given = name, content

    @staticmethod
    def _within(name: str) -> str:
        return f"{name}: " if name else ""

    def _called(self, key: str) -> str:
        return f"{self.name}.{key}" if self.name else key

    def text(self, key: str) -> str:
        return check_text(self._called(key), self.given[key], most=LONGEST_TEXT)

    def number(self, key: str, default: float | None, low: float, high: float, unit: str) -> float:
        return check_number(self._called(key), self.given.get(key, default), low, high, unit)

    def pair(self, key: str, default: tuple[float, float]) -> tuple[float, float]:
        """Return a range of two numbers, the lower one first."""
        name, value = self._called(key), self.given.get(key, default)
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise ConfigError(f"{name} is {shown(value)}; it must be [lowest, highest]")
        low, high = (check_number(name, one, -1e3, 1e3) for one in value)
        if low >= high:
            raise ConfigError(f"{name} is {value!r}; the first number must be the lower one")
        return low, high


def _home(given: Any, chain: tuple[UrdfJoint, ...]) -> dict[str, float]:
    """Return the angle of each joint of the chain to the tool, in the order of the chain."""
    names = tuple(joint.name for joint in chain)
    if isinstance(given, list):
        if len(given) != len(names):
            raise ConfigError(f"home has {len(given)} numbers; these joints move: {listed(names)}")
        given = dict(zip(names, given, strict=True))
    home = _Section("home", given, names).given
    if missing := [name for name in names if name not in home]:
        raise ConfigError(f"home has no {listed(missing)}; all of these move the tool")
    return {name: check_number(f"home.{name}", home[name], -1e3, 1e3) for name in names}


def _bounds(joint: UrdfJoint, position: _Section) -> tuple[float, float]:
    if joint.name in position.given:
        low, high = position.pair(joint.name, (0.0, 0.0))
        for limit in (low, high):
            name = f"limits.position.{joint.name}"
            if joint.kind == "prismatic":
                check_number(name, limit, -FAR, FAR, "m")
            else:
                check_angle(name, limit, turns=2)
        return low, high
    if joint.lower is None or joint.upper is None:
        raise ConfigError(
            f"joint {joint.name!r} is {joint.kind} and has no limits in the URDF; give them as"
            f" limits: {{position: {{{joint.name}: [-3.1, 3.1]}}}}"
        )
    return joint.lower, joint.upper


def _per_joint(
    limits: _Section,
    key: str,
    most: float,
    defaults: list[float | None] | list[float],
    chain: tuple[UrdfJoint, ...],
) -> list[float]:
    """Return a limit of each joint: one number for all, a mapping, or the defaults."""
    given, joints = limits.given.get(key), tuple(joint.name for joint in chain)
    if given is not None and not isinstance(given, Mapping):
        given = dict.fromkeys(joints, given)
    given = _Section(f"limits.{key}", given or {}, joints).given
    found = []
    for joint, default in zip(chain, defaults, strict=True):
        value, unit = given.get(joint.name, default), joint.unit + RATES[key]
        if joint.name not in given and not value:
            has = "no limit" if value is None else "the limit 0"
            raise ConfigError(
                f"joint {joint.name!r} has {has} of {key} in the URDF; allowed: {LEAST_RATE:g} to"
                f" {most:g} {unit}: correct it there, or give limits:"
                f" {{{key}: {{{joint.name}: 1.0}}}}"
            )
        name = f"limits.{key} of {joint.name!r}"
        found.append(check_number(name, value, LEAST_RATE, most, unit))
    return found
