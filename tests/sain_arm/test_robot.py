# ruff: noqa: E501 - a case is a line
"""The YAML file of a robot, and its URDF: what is taken, and what is refused with a reason."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from sain_arm.planning.push_planner import PushPlanner
from sain_arm.planning.reach import table_of_reach
from sain_arm.robot.arm_model import ArmModel
from sain_arm.robot.robot import Robot, parse_robot, read_robot
from sain_core.errors import ConfigError, UnreachableError

CYLINDER = '<collision><geometry><cylinder radius="0.03" length="0.1"/></geometry></collision>'
URDF = f"""<robot name="two">
  <link name="base">{CYLINDER}</link><link name="upper">{CYLINDER}</link><link name="hand"/>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" velocity="1.5" effort="10"/>
  </joint>
  <joint name="lift" type="prismatic">
    <parent link="upper"/><child link="hand"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.5" velocity="0.5" effort="10"/>
  </joint>
</robot>"""
FILE: dict[str, Any] = {
    "urdf": "two.urdf",
    "tool": {"frame": "hand", "rod": 0.1, "radius": 0.01},
    "controller": "my_controller",
    "home": {"turn": 0.0, "lift": 0.2},
}


def write(folder: Path, description: str = URDF, **changes: Any) -> Path:
    (folder / "two.urdf").write_text(description)
    path = folder / "two.yaml"
    path.write_text(yaml.safe_dump(FILE | changes))
    return path


def test_a_file_gets_its_limits_from_the_urdf(tmp_path: Path) -> None:
    robot = read_robot(str(write(tmp_path, limits={"acceleration": {"lift": 2.0}})))
    assert robot.joints == ("turn", "lift")
    np.testing.assert_allclose(robot.lower, [-2.0, 0.0])
    np.testing.assert_allclose(robot.velocity, [1.5, 0.5])
    np.testing.assert_allclose(robot.acceleration, [1.5 / 0.4, 2.0])
    tip = ArmModel(robot).tip(np.array([0.0, 0.3]))
    np.testing.assert_allclose(tip, [0.0, 0.0, 0.4], atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"tool": {"frame": "hnd", "radius": 0.01}}, r"tool.frame is 'hnd'; the links of two.urdf: base, upper, hand"),
        ({"tool": {"frame": "hand"}}, "tool: radius is missing"),
        ({"tool": {"frame": "hand", "radius": 0.01, "axis": "w"}}, "tool.axis is 'w'; allowed: z, -z"),
        ({"tool": {"frame": "base", "radius": 0.01}}, "no joint of two.urdf moves the tool's frame 'base'"),
        ({"speed": 1}, "unknown key 'speed'; allowed: urdf, base, tool"),
        ({"controler": "x"}, r"unknown key 'controler' \(did you mean 'controller'\?\)"),
        ({"limits": {"velocty": 1}}, r"limits: unknown key 'velocty' \(did you mean 'velocity'\?\)"),
        ({"limits": {"velocity": {"trn": 1}}}, r"unknown key 'trn' \(did you mean 'turn'\?\)"),
        ({"limits": {"velocity": -1}}, "limits.velocity of 'turn' is -1; allowed: 0.001 to 50"),
        ({"home": {"turn": 0.0}}, "home has no lift; all of these move the tool"),
        ({"home": {"turn": 9.0, "lift": 0.2}}, "home of joint 'turn' is 9; allowed: -2 to 2"),
        ({"base": {"z": -0.2}}, "base.z is -0.2; allowed: 0 to 10"),
        ({"workspace": {"x": [1, 0]}}, r"workspace.x is \[1, 0\]; the first number must be the lower"),
        ({"controller": 3}, "controller is 3; it must be a text"),
        ({"urdf": "package://nobody_has_this/a.urdf"}, "there is no package 'nobody_has_this'"),
        ({"urdf": "none.urdf"}, "none.urdf: No such file"),
        ({"urdf": "two.yaml"}, "two.yaml is no XML"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_refused_with_what_is_allowed(
    tmp_path: Path, changes: dict[str, Any], text: str
) -> None:
    with pytest.raises(ConfigError, match=text):
        read_robot(str(write(tmp_path, **changes)))


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('<axis xyz="0 0 1"/>\n    <limit lower="0"', '<mimic joint="turn"/><limit lower="0"', "joint 'lift' mimics 'turn'"),
        ('type="revolute"', 'type="continuous"', r"joint 'turn' is continuous and has no limits .* limits: \{position: \{turn:"),
        ('type="prismatic"', 'type="floating"', "joint 'lift' is 'floating'; allowed: revolute, prismatic"),
        (CYLINDER, "", "no link of two.urdf has a collision geometry"),
        ('<cylinder radius="0.03" length="0.1"/>', '<mesh filename="gone.stl"/>', "has the mesh gone.stl: there is no file"),
        ('<cylinder radius="0.03" length="0.1"/>', '<mesh filename="two.yaml"/>', "collision mesh two.yaml; allowed: .stl, .obj"),
        (' velocity="1.5"', "", "joint 'turn' has no velocity limit in the URDF; give limits.velocity"),
    ],
)  # fmt: skip
def test_a_urdf_that_cannot_be_planned_for_is_refused(
    tmp_path: Path, old: str, new: str, text: str
) -> None:
    assert old in URDF
    with pytest.raises(ConfigError, match=text):
        read_robot(str(write(tmp_path, URDF.replace(old, new))))


def test_a_continuous_joint_moves_within_limits_of_the_file(tmp_path: Path) -> None:
    urdf = URDF.replace('type="revolute"', 'type="continuous"')
    robot = read_robot(str(write(tmp_path, urdf, limits={"position": {"turn": [-3.0, 3.0]}})))
    assert (robot.lower[0], robot.upper[0]) == (-3.0, 3.0)


def test_an_arm_that_reaches_nothing_says_so(tmp_path: Path) -> None:
    """Its tool points up."""
    robot = read_robot(str(write(tmp_path, workspace={"x": [0.1, 0.5], "y": [0.0, 0.5]})))
    with pytest.raises(UnreachableError, match="robot 'two' can push nowhere in its workspace"):
        table_of_reach(PushPlanner(robot))


def test_a_robot_that_is_not_shipped_is_named_with_those_that_are() -> None:
    with pytest.raises(ConfigError, match="shipped are panda, so101, ur5, xarm7"):
        read_robot("ur6")
    with pytest.raises(ConfigError, match="robot is empty"):
        read_robot("")


def test_a_robot_stands_where_the_file_says(ur5: Any) -> None:
    robot: Robot = ur5.robot
    from sain_arm.robot.robot import SHIPPED

    content = yaml.safe_load((SHIPPED / "ur5.yaml").read_text())
    moved = parse_robot(
        content | {"base": {"x": 0.3, "y": 0.1, "yaw": np.pi / 2}}, "moved", SHIPPED
    )
    x, y, z = ArmModel(robot).tip(robot.home)
    np.testing.assert_allclose(ArmModel(moved).tip(robot.home), [0.3 - y, 0.1 + x, z], atol=1e-6)
