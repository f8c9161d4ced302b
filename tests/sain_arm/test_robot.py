# ruff: noqa: E501 - a case is a line
"""The YAML file of a robot, and its URDF: what is taken, and what is refused with a reason."""

import re
from pathlib import Path
from textwrap import dedent
from typing import Any

import numpy as np
import pytest
import yaml

from sain_arm.planning.push_planner import PushPlanner
from sain_arm.planning.reach import table_of_reach
from sain_arm.robot.arm_model import ArmModel
from sain_arm.robot.robot import SHIPPED, Robot, parse_robot, read_robot
from sain_core.errors import ConfigError, UnreachableError
from tests.paths import ROOT

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
LONG = {"frame": "hand", "rod": 0.2, "radius": 0.01}
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


def test_a_file_gets_its_limits_from_the_urdf(tmp_path):
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
        ({"tool": {"frame": "hnd", "radius": 0.01}}, r"tool.frame is 'hnd' \(did you mean 'hand'\?\); the links of two.urdf: base, upper, hand"),
        ({"tool": {"frame": "hand"}}, "tool: radius is missing"),
        ({"tool": {"frame": "hand", "radius": 0.01, "axis": "w"}}, "tool.axis is 'w'; allowed: z, -z"),
        ({"tool": {"frame": "base", "radius": 0.01}}, "no joint of two.urdf moves the tool's frame 'base'"),
        ({"speed": 1}, "unknown key 'speed'; allowed: urdf, base, tool"),
        ({"controler": "x"}, r"unknown key 'controler' \(did you mean 'controller'\?\)"),
        ({"limits": {"velocty": 1}}, r"limits: unknown key 'velocty' \(did you mean 'velocity'\?\)"),
        ({"limits": {"velocity": {"trn": 1}}}, r"unknown key 'trn' \(did you mean 'turn'\?\)"),
        ({"limits": {"velocity": -1}}, "limits.velocity of 'turn' is -1; allowed: 0.001 to 50"),
        ({"home": {"turn": 0.0}}, "home has no lift; all of these move the tool"),
        ({"home": {"turn": 9.0, "lift": 0.2}}, "home of joint 'turn' is 9.0; allowed: -2 to 2 rad: 9 degrees are 0.1571 rad"),
        ({"base": {"yaw": 9}}, "base.yaw is 9; allowed: -6.29 to 6.29 rad: 9 degrees are 0.1571 rad"),
        ({"tool": {"frame": "hand", "radius": 10}}, "tool.radius is 10; allowed: 0.001 to 0.05 m: 10 millimetres are 0.01 m"),
        ({"tool": {"frame": "Hand", "radius": 0.01}}, r"tool.frame is 'Hand' \(did you mean 'hand'\?\)"),
        ({"limits": {"velocity": {"turn": 0}}}, "limits.velocity of 'turn' is 0; allowed: 0.001 to 50 rad/s"),
        ({"base": {"z": -1.2}}, "base.z is -1.2; allowed: -1 to 10"),
        ({"workspace": {"x": [1, 0]}}, r"workspace.x is \[1, 0\]; the first number must be the lower"),
        ({"controller": 3}, "controller is 3; it must be a text"),
        ({"urdf": "package://nobody_has_this/a.urdf"}, "there is no package 'nobody_has_this'"),
        ({"urdf": "none.urdf"}, "none.urdf: No such file"),
        ({"urdf": "two.yaml"}, "two.yaml is no XML"),
        ({"urdf": "~no_such_user/x.urdf"}, "x.urdf: No such file"),
        ({"controller": ""}, "controller is ''; it must be a text"),
        ({"controller": "my arm"}, "controller is 'my arm'; a name in ROS has letters"),
        ({"home": [0.0]}, "home has 1 numbers; these joints move: turn, lift"),
        ({"home": [-90, 0.2]}, "home of joint 'turn' is -90.0; allowed: -2 to 2 rad: -90 degrees are -1.571 rad"),
        ({"home": {"turn": "0.3 rad", "lift": 0.2}}, "home.turn is '0.3 rad'; allowed"),
        ({"limits": {"position": {"turn": [-150, 150]}}}, "limits.position.turn is -150.0; allowed: -12.58 to 12.58 rad: -150 degrees are -2.618 rad"),
        ({"tool": {"frame": "hand", "radius": 0}}, "tool.radius is 0; allowed: 0.001 to 0.05"),
        ({"tool": {"frame": "hand", "radius": 0.01, "rod": -0.1}}, "tool.rod is -0.1; allowed: 0 to 1"),
        ({"tool": {"frame": "hand", "radius": 0.01, "rod": 100}}, "tool.rod is 100; allowed: 0 to 1"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_refused_with_what_is_allowed(tmp_path, changes, text):
    with pytest.raises(ConfigError, match=text):
        read_robot(str(write(tmp_path, **changes)))


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('<axis xyz="0 0 1"/>\n    <limit lower="0"', '<mimic joint="turn"/><limit lower="0"', "joint 'lift' mimics 'turn'"),
        ('type="revolute"', 'type="continuous"', r"joint 'turn' is continuous and has no limits .* limits: \{position: \{turn:"),
        ('type="prismatic"', 'type="floating"', "joint 'lift' is 'floating'; allowed: revolute, prismatic"),
        (CYLINDER, "", "no link of two.urdf has a collision geometry"),
        ('<cylinder radius="0.03" length="0.1"/>', '<mesh filename="gone.stl"/>', "link 'base' has the collision mesh 'gone.stl': .*gone.stl: No such file"),
        ('<cylinder radius="0.03" length="0.1"/>', '<mesh filename="two.yaml"/>', "two.yaml: a collision mesh must be .stl, .obj or .dae; convert it: assimp export two.yaml two.stl"),
        (' velocity="1.5"', "", "joint 'turn' has no limit of velocity in the URDF; allowed: 0.001 to 50 rad/s: correct it there, or give limits: {velocity: {turn: 1.0}}"),
        ('velocity="1.5"', 'velocity="fast"', "joint 'turn' has <limit velocity='fast'>; allowed: a number from 0"),
        ('velocity="1.5"', 'velocity="0"', "joint 'turn' has the limit 0 of velocity in the URDF; allowed: 0.001 to 50 rad/s"),
        ('velocity="1.5"', 'velocity="180"', "limits.velocity of 'turn' is 180.0; allowed: 0.001 to 50"),
        ('effort="10"', 'effort="-1"', "joint 'lift' has <limit effort='-1'>; allowed: a number from 0"),
        ('lower="-2" upper="2"', 'lower="2" upper="-2"', "joint 'turn' has the limits lower=2 and upper=-2; lower must be less"),
        ('lower="-2" upper="2"', 'lower="2" upper="2"', "joint 'turn' has the limits lower=2 and upper=2; lower must be less"),
        ('lower="-2" upper="2"', 'lower="-150" upper="150"', "joint 'turn' has <limit lower='-150'>; allowed: .* rad: are these degrees?"),
        ('lower="-2" upper="2"', 'lower="-${pi}" upper="2"', r"joint 'turn' has lower='-\$\{pi\}': .*two.urdf is xacro; expand it: `xacro two.urdf > "),
        ('lower="-2" upper="2"', "", r"joint 'turn' is revolute and has no limits .* limits: \{position: \{turn:"),
        ('lower="0" upper="0.5"', 'lower="0" upper="500"', "joint 'lift' has <limit upper='500'>; allowed: .* m: are these millimetres?"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "joint 'lift' has the axis 0 0 0; give the direction"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 1"/>', "joint 'turn' has <axis xyz='0 1'>; allowed: 3 numbers"),
        ('<axis xyz="0 0 1"/>', '<origin xyz="0 0 310"/>', "joint 'turn' has <origin xyz='0 0 310'>; .* are these millimetres?"),
        ('<axis xyz="0 0 1"/>', '<origin xyz="0 9 0"/>', "the arm to 'hand' is 18 m long; allowed: 10 m"),
        ('<axis xyz="0 0 1"/>', '<origin rpy="0 nan 0"/>', "joint 'turn' has <origin rpy='0 nan 0'>; allowed: 3 numbers"),
        ('<axis xyz="0 0 1"/>', '<origin/><origin/>', "joint 'turn' has two <origin> in one <joint>; allowed: one"),
        ('type="revolute"', 'type="hinge"', "joint 'turn' has the type 'hinge'; allowed: revolute, prismatic, continuous, fixed"),
        ('type="revolute"', 'type="planar"', "joint 'turn' is 'planar'; allowed: revolute, prismatic, continuous"),
        ('<parent link="base"/>', '<parent link="hand"/>', "joints form a circle through the links"),
        ('<parent link="base"/>', '<parent link="bas"/>', r"joint 'turn' has the parent 'bas' \(did you mean 'base'\?\); the links are base, upper, hand"),
        ('<child link="hand"/>', '<child link="upper"/>', "link 'upper' is the child of joints 'turn' and 'lift'; allowed: one"),
        ('<link name="hand"/>', '<link name="hand"/><link name="more"/>', "the links base, more are no child of a joint; allowed: one"),
        ('<link name="hand"/>', '<link name="hand"/><link name="hand"/>', "two.urdf has two links 'hand'; rename one"),
        ('name="lift"', 'name="turn"', "two.urdf has two joints 'turn'; rename one"),
        ('<link name="hand"/>', '<link name="hand"/><link/>', "link 4 has the name ''; give it 1 to 200 characters"),
        ('<link name="hand"/>', '<link name="sain_rod"/>', "link 3 has the name 'sain_rod'; give it .* not begin with 'sain_'"),
        ('radius="0.03" length="0.1"', 'radius="0.03"', "link 'base' has <cylinder> without length; allowed: a number from 1e-06 to 10 m"),
        ('radius="0.03" length="0.1"', 'radius="30" length="100"', "link 'base' has <cylinder radius='30'>; .* are these millimetres?"),
        ('<cylinder radius="0.03" length="0.1"/>', '<cone radius="0.03"/>', "link 'base' has nothing in <geometry>; allowed: one of box"),
        ('<link name="hand"/>', '<link name="hand"><xacro:gripper xmlns:xacro="http://www.ros.org/wiki/xacro"/></link>', "two.urdf is xacro; expand it: `xacro two.urdf > "),
        ('<link name="hand"/>', '<link name="hand"/><xacro:gripper/>', "two.urdf is xacro; expand it: `xacro two.urdf > "),
        ('<robot name="two">', '<!DOCTYPE r [<!ENTITY a "b">]><robot name="two">', "two.urdf has a DOCTYPE; none is read"),
        (URDF, " ", "two.urdf is empty; if xacro wrote it, read its error"),
        ('<robot name="two">', '<robot name="two"><broken>', "two.urdf is no XML: mismatched tag"),
    ],
)  # fmt: skip
def test_a_urdf_that_cannot_be_planned_for_is_refused(tmp_path, old, new, text):
    assert old in URDF
    with pytest.raises(ConfigError, match=text):
        read_robot(str(write(tmp_path, URDF.replace(old, new))))


def test_what_is_not_used_may_be_anything(tmp_path):
    wheel = """<link name="wheel"/><joint name="roll" type="continuous"><parent link="base"/>
      <child link="wheel"/><axis xyz="0 0 0"/><limit lower="-1e16" upper="1e16" velocity="inf"/>
    </joint><gazebo><sensor:camera/><plugin path="$(find x)"/></gazebo></robot>"""
    visual = '<visual><geometry><mesh filename="gone.dae" scale="x"/></geometry></visual>'
    urdf = URDF.replace("</robot>", wheel).replace(CYLINDER, CYLINDER + visual)
    assert read_robot(str(write(tmp_path, urdf))).joints == ("turn", "lift")


def test_a_link_without_mass_gets_one_and_the_log_names_it(tmp_path, caplog):
    """Its joint moves, and neither mass nor geometry is given."""
    arm = ArmModel(read_robot(str(write(tmp_path))))
    assert caplog.messages[-1].startswith("two.urdf: links without mass or inertia: upper, hand;")
    assert arm.model.body("hand").mass[0] == 0.01


def test_an_axis_that_is_not_given_is_x(tmp_path):
    urdf = URDF.replace('<axis xyz="0 0 1"/>', "")
    arm = ArmModel(read_robot(str(write(tmp_path, urdf))))
    np.testing.assert_allclose(arm.tip(np.array([0.0, 0.3])), [0.3, 0.0, 0.1], atol=1e-9)


def test_home_may_be_numbers_in_the_order_of_the_joints(tmp_path):
    robot = read_robot(str(write(tmp_path, home=[0.5, 0.2])))
    assert dict(zip(robot.joints, robot.home, strict=True)) == {"turn": 0.5, "lift": 0.2}


# --- meshes -----------------------------------------------------------------------------------------

WEDGE = np.array([(0, 0, 0), (0.1, 0, 0), (0, 0.2, 0), (0, 0, 0.3)])
FACES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


def stl_text(corners: np.ndarray) -> bytes:
    facets = [
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x:g} {y:g} {z:g}\n" for x, y, z in corners[face])
        + "endloop\nendfacet\n"
        for face in FACES
    ]
    return f"solid wedge\n{''.join(facets)}endsolid wedge\n".encode()


def stl_binary(corners: np.ndarray) -> bytes:
    facets = [np.pad(corners[face].ravel(), (3, 0)).astype("<f4").tobytes() for face in FACES]
    return bytes(80) + len(facets).to_bytes(4, "little") + b"".join(f + bytes(2) for f in facets)


def obj(corners: np.ndarray) -> bytes:
    rows = [f"v {x:g} {y:g} {z:g}" for x, y, z in corners]
    return "\n".join([*rows, *("f {} {} {}".format(*face + 1) for face in FACES)]).encode()


def dae(corners: np.ndarray) -> bytes:
    """Return it in centimetres, in a node that turns and moves it."""
    turned = corners[:, [1, 2, 0]] * 50 - 1  # the node scales, then moves, then turns it back
    numbers = " ".join(f"{one:.9g}" for one in turned.ravel())
    return f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"><asset>
      <unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
      <library_geometries><geometry id="wedge"><mesh>
        <source id="p"><float_array id="pa" count="12">{numbers}</float_array></source>
        <source id="n"><float_array id="na" count="3">7 7 7</float_array></source>
        <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
      </mesh></geometry></library_geometries>
      <library_visual_scenes><visual_scene id="s"><node>
        <matrix>0 0 1 0 1 0 0 0 0 1 0 0 0 0 0 1</matrix><node>
          <translate>2 2 2</translate><rotate>0 0 2 360</rotate><scale>2 2 2</scale>
          <instance_geometry url="#wedge"/></node></node>
      </visual_scene></library_visual_scenes></COLLADA>""".encode()


def with_mesh(folder: Path, name: str, content: bytes, scale: str = "1 1 1") -> Path:
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(content)
    mesh = f'<mesh filename="{name}" scale="{scale}"/>'
    urdf = URDF.replace('<cylinder radius="0.03" length="0.1"/>', mesh, 1)
    return write(folder, urdf, home={"turn": 0.0, "lift": 0.45})  # above the mesh


@pytest.mark.parametrize(
    ("name", "content"),
    [("part.stl", stl_binary), ("part.STL", stl_text), ("part.obj", obj), ("part.dae", dae)],
)
def test_a_mesh_is_read_in_every_form(tmp_path, name, content):
    arm = ArmModel(read_robot(str(with_mesh(tmp_path, name, content(WEDGE)))))
    found = arm.model.mesh_vert  # MuJoCo turns it
    assert found.shape == (4, 3)
    widths = [np.sort(np.linalg.norm(a[:, None] - a, axis=2).ravel()) for a in (found, WEDGE)]
    np.testing.assert_allclose(*widths, atol=1e-6)


def test_meshes_of_one_name_and_of_two_scales_are_told_apart(tmp_path):
    path = with_mesh(tmp_path, "a/part.stl", stl_binary(WEDGE), "2 2 2")
    with_mesh(tmp_path, "b/part.stl", stl_text(WEDGE))
    mesh = '<mesh filename="{}" scale="{}"/>'
    urdf = URDF.replace(
        '<cylinder radius="0.03" length="0.1"/>', mesh.format("a/part.stl", "2 2 2"), 1
    )
    urdf = urdf.replace(
        '<cylinder radius="0.03" length="0.1"/>', mesh.format("b/part.stl", "-3 3 3")
    )
    (tmp_path / "two.urdf").write_text(urdf)
    model = ArmModel(read_robot(str(path))).model
    bounds = [model.geom_rbound[model.body(link).geomadr[0]] for link in ("base", "upper")]
    assert bounds[1] / bounds[0] == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (b"<COLLADA", b"<!DOCTYPE x><COLLADA", "has a DOCTYPE"),
        (b"</COLLADA>", b"", "is no XML: no element found"),
        (b"#wedge", b"#gone", "it has no corners"),
        (b"2 2 2</translate", b"2 2</translate", "it has 2 numbers where 3 belong together"),
        (b"2 2 2</translate", b"2 two 2</translate", "a text has no numbers"),
        (b"instance_geometry", b"instance_node", "it has <instance_node>, which is not read"),
        (b'meter="0.01"', b'meter=" "', "it has 0 numbers where 1 belong together"),
        (b'meter="0.01"', b'meter="1"', "10 x 20 x 30 m, of the scale 1 1 1; allowed"),
    ],
)
def test_a_collada_file_is_refused_with_its_reason(tmp_path, old, new, text):
    path = with_mesh(tmp_path, "part.dae", dae(WEDGE).replace(old, new))
    with pytest.raises(ConfigError, match=f"link 'base' has the collision mesh 'part.dae'.*{text}"):
        read_robot(str(path))


@pytest.mark.parametrize(
    ("content", "scale", "text"),
    [
        (b"", "1 1 1", "it is no STL: its header states 0 triangles"),
        (b"solid nothing\nendsolid\n", "1 1 1", "it has no corners"),
        (stl_binary(WEDGE)[:150], "1 1 1", "it is no STL: its header states 4 triangles, which are 284 bytes; it has 150"),
        (stl_binary(WEDGE * [1, 1, 0]), "1 1 1", "all its corners lie in one plane"),
        (stl_text(WEDGE[[0, 1, 2, 0]]), "1 1 1", "all its corners lie in one plane"),
        (stl_binary(WEDGE * [1, np.nan, 1]), "1 1 1", "a corner has NaN, or a number beyond 1e.09"),
        (stl_text(WEDGE).replace(b"0.3", b"high"), "1 1 1", "a corner is no number"),
        (stl_text(WEDGE)[:-30], "1 1 1", "it does not end with endsolid; it was cut off, or damaged; get it again"),
        (stl_text(WEDGE).replace(b"vertex 0 0 0.3\n", b""), "1 1 1", "its 4 facets have .* corners, not 3 each"),
        (stl_binary(WEDGE * 1000), "1 1 1", '100 x 200 x 300 m, of the scale 1 1 1; allowed: 0.002 to 10 m for the longest side, .*"0.001 0.001 0.001" for a mesh in millimetres'),
        (stl_binary(WEDGE), "0.001 0.001 0.001", '0.0001 x 0.0002 x 0.0003 m, of the scale 0.001 0.001 0.001; allowed: 0.002 to 10 m .* "1 1 1" for metres'),
        (stl_binary(WEDGE), "1 1 0", "of 0.1 x 0.2 x 0 m, of the scale 1 1 0; allowed"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:12\nsize 9\n" * 2, "1 1 1", "it is a pointer of Git LFS, not the file; `git lfs pull` fetches it"),
    ],
)  # fmt: skip
def test_a_mesh_that_is_no_body_is_refused_with_its_link(tmp_path, content, scale, text):
    path = with_mesh(tmp_path, "part.stl", content, scale)
    with pytest.raises(ConfigError, match=f"link 'base' has the collision mesh 'part.stl'.*{text}"):
        read_robot(str(path))


def test_an_obj_that_ends_before_its_faces_is_refused(tmp_path):
    path = with_mesh(tmp_path, "part.obj", obj(WEDGE).split(b"f")[0])
    with pytest.raises(ConfigError, match="has corners and no face; it was cut off, or damaged"):
        read_robot(str(path))


ELBOW = URDF.replace('type="prismatic"', 'type="revolute"').replace(
    '<axis xyz="0 0 1"/>\n    <limit lower="0" upper="0.5"',
    '<axis xyz="0 1 0"/><origin xyz="0 0 0.2"/>\n    <limit lower="-3" upper="3"',
)


def test_links_that_touch_at_home_only_are_refused_by_name_and_depth(tmp_path):
    text = "robot 'two': the links 'base' and 'sain_rod' touch at home, .* mm deep; allowed"
    folded = read_robot(str(write(tmp_path, ELBOW, tool=LONG, home={"turn": 0.0, "lift": 3.0})))
    with pytest.raises(ConfigError, match=text):
        ArmModel(folded)
    straight = write(tmp_path, ELBOW, tool=LONG, home={"turn": 0.0, "lift": 0.0})
    arm = ArmModel(read_robot(str(straight)))
    touching = [
        {"base", "sain_rod"} in [{one.first, one.second} for one in arm.contacts(np.array(joints))]
        for joints in ([0.0, 0.0], [0.0, 3.0])
    ]
    assert touching == [False, True]


def test_a_package_is_found_around_the_urdf(tmp_path):
    folder = tmp_path / "src" / "my_description"
    path = with_mesh(folder / "urdf", "part.stl", stl_binary(WEDGE))
    (folder / "meshes").mkdir()
    (folder / "urdf" / "part.stl").rename(folder / "meshes" / "part.stl")
    urdf = (folder / "urdf" / "two.urdf").read_text()
    (folder / "urdf" / "two.urdf").write_text(
        urdf.replace('"part.stl"', '"package://my_description/meshes/part.stl"')
    )
    assert ArmModel(read_robot(str(path))).model.nmesh == 1


def test_a_continuous_joint_moves_within_limits_of_the_file(tmp_path):
    urdf = URDF.replace('type="revolute"', 'type="continuous"')
    robot = read_robot(str(write(tmp_path, urdf, limits={"position": {"turn": [-3.0, 3.0]}})))
    assert (robot.lower[0], robot.upper[0]) == (-3.0, 3.0)


def test_an_arm_that_reaches_nothing_says_so(tmp_path):
    """Its tool points up."""
    robot = read_robot(str(write(tmp_path, workspace={"x": [0.1, 0.5], "y": [0.0, 0.5]})))
    with pytest.raises(UnreachableError, match="robot 'two' can push nowhere in its workspace"):
        table_of_reach(PushPlanner(robot))


def test_a_robot_that_is_not_shipped_is_named_with_those_that_are():
    with pytest.raises(
        ConfigError, match="shipped are free_tool, panda, paper_panda, so101, ur5, xarm7"
    ):
        read_robot("ur6")
    with pytest.raises(ConfigError, match="robot is empty"):
        read_robot("")


def test_a_robot_stands_where_the_file_says(ur5):
    robot: Robot = ur5.robot
    from sain_arm.robot.robot import SHIPPED

    content = yaml.safe_load((SHIPPED / "ur5.yaml").read_text())
    moved = parse_robot(
        content | {"base": {"x": 0.3, "y": 0.1, "yaw": np.pi / 2}}, "moved", SHIPPED
    )
    x, y, z = ArmModel(robot).tip(robot.home)
    np.testing.assert_allclose(ArmModel(moved).tip(robot.home), [0.3 - y, 0.1 + x, z], atol=1e-6)


def test_the_file_of_the_guide_is_an_arm_that_reaches_the_guide_s_goal(tmp_path):
    """With the shipped UR5's description in place of the UR5e's, which is not installed."""
    page = (ROOT / "docs/guides/your_robot.md").read_text()
    lines = re.search(r"^    urdf: ur5e\.urdf.*?(?=^$)", page, re.MULTILINE | re.DOTALL)[0]
    urdf = re.search(r"urdf: (\S+)", (SHIPPED / "ur5.yaml").read_text())[1]
    path = tmp_path / "my_arm.yaml"
    path.write_text(dedent(lines).replace("ur5e.urdf", urdf))
    planner = PushPlanner(read_robot(str(path)))
    assert planner.arm.tip(planner.robot.home)[2] > 0.1
    assert table_of_reach(planner).room(np.array([[0.55, 0.1]])) > 0.1
