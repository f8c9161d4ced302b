# ruff: noqa: E501 - a case is a line
"""Files of a robot that were damaged at random: each loads, or is refused in one short line."""

import random
import shutil
import struct
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import numpy as np
import yaml

from sain_arm.robot.arm_model import ArmModel
from sain_arm.robot.robot import read_robot
from sain_core.errors import SainError

MUTATIONS = 700
LONGEST = 1000  # characters of an error
SLOWEST = 5.0  # [s]
BAD = (
    "", " ", "fast", "nan", "NaN", "inf", "-inf", "1e300", "-1e300", "1e-300", "0", "-0", "-1", "150",
    "0 0", "0 0 0", "0 0 0 0", "1,5", "0.15 m", "${pi}", "-${pi}", "$(arg x)", "null", "true", "[]", "é",
    "../..", "/", "package://", "package://x/y", "file:///etc/passwd", "~x/y", "x" * 5000, "a\x0bb", "world",
    "sain_rod", "base", "upper", "turn", "part.stl", "bent.dae", "two.urdf",
)  # fmt: skip
KIND = ("fixed", "continuous", "prismatic", "planar", "floating", "revolute")
URDF = """<?xml version="1.0"?>
<robot name="two">
  <link name="base"><collision><geometry><mesh filename="part.stl" scale="1 1 1"/></geometry></collision></link>
  <link name="upper">
    <inertial><origin xyz="0 0 0" rpy="0 0 0"/><mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 0" rpy="0 0 0"/><geometry><cylinder radius="0.03" length="0.1"/></geometry></collision>
  </link>
  <link name="fore"><collision><geometry><mesh filename="bent.dae"/></geometry></collision></link>
  <link name="hand"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.1" rpy="0 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" velocity="1.5" effort="10"/><dynamics damping="0.1" friction="0.1"/>
  </joint>
  <joint name="swing" type="continuous">
    <parent link="upper"/><child link="fore"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit velocity="1" effort="1"/>
  </joint>
  <joint name="lift" type="prismatic">
    <parent link="fore"/><child link="hand"/><limit lower="0" upper="0.5" velocity="0.5" effort="10"/>
  </joint>
</robot>
"""
YAML = """urdf: two.urdf
base: {x: 0.1, y: 0.0, z: 0.0, yaw: 0.0}
tool: {frame: hand, axis: z, rod: 0.1, radius: 0.01}
controller: my_controller
home: {turn: 0.0, swing: 0.1, lift: 0.2}
limits: {position: {swing: [-3, 3]}, velocity: 1.0, acceleration: {lift: 2.0}}
workspace: {x: [0.1, 0.5], y: [-0.5, 0.5], z: [0.0, 0.5]}
"""


def stl(triangles: np.ndarray) -> bytes:
    rows = [struct.pack("<12fH", 0, 0, 0, *corners, 0) for corners in triangles.reshape(-1, 9)]
    return bytes(80) + struct.pack("<I", len(rows)) + b"".join(rows)


TETRAHEDRON = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
PART = stl(TETRAHEDRON[[(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]])


DAE = """<COLLADA><asset><unit meter="0.1"/></asset><library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="12">0 0 0 1 0 0 0 1 0 0 0 1</float_array></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix>
<rotate>0 0 1 90</rotate><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes></COLLADA>"""


def bent_xml(draw: random.Random) -> bytes:
    """Change one to three things of the URDF."""
    robot = ElementTree.fromstring(URDF)
    for _ in range(draw.randint(1, 3)):
        elements = list(robot.iter())
        element = draw.choice(elements)
        change = draw.randrange(7)
        keys = list(element.keys())
        if change == 0 and keys:
            del element.attrib[draw.choice(keys)]
        elif change == 1 and keys:
            element.set(draw.choice(keys), draw.choice(BAD))
        elif change == 2 and keys:
            value = element.get(keys[0], "")
            element.set(draw.choice(keys), value.replace("0", draw.choice(BAD), 1))
        elif change == 3:
            element.tag = draw.choice(
                ["link", "joint", "xacro:x", "geometry", "mesh", "origin", "x"]
            )
        elif change == 4 and len(element):
            element.append(draw.choice(list(element)))
        elif change == 5 and len(element):
            element.remove(draw.choice(list(element)))
        else:
            other = draw.choice(elements)
            if other.get("type"):
                other.set("type", draw.choice(KIND))
            elif other.get("link"):
                other.set("link", draw.choice(["base", "upper", "fore", "hand"]))
    return ElementTree.tostring(robot)


def cut(content: bytes, draw: random.Random) -> bytes:
    """Change, drop, double or insert bytes anywhere."""
    at, end = sorted(draw.randrange(len(content)) for _ in "ab")
    part = draw.choice([b"", content[at:end] * 2, draw.randbytes(4), draw.choice(BAD).encode()])
    return content[:at] + part + content[draw.choice([end, at, at + 1, len(content)]) :]


def bent_yaml(draw: random.Random) -> bytes:
    """Change one value at any depth of the robot file."""
    content = yaml.safe_load(YAML)
    holder = content
    while isinstance(holder[key := draw.choice(list(holder))], dict) and draw.random() < 0.7:
        holder = holder[key]
    values = [
        *BAD,
        None,
        [],
        {},
        0,
        -1,
        1e300,
        float("nan"),
        float("inf"),
        True,
        [1, 2],
        10**90,
        -90,
    ]
    change = draw.randrange(3)
    if change == 0:
        del holder[key]
    elif change == 1:
        holder[draw.choice(BAD)] = holder.pop(key)
    else:
        holder[key] = draw.choice(values)
    return yaml.safe_dump(content).encode()


MUTATE: list[tuple[str, Callable[[random.Random], bytes]]] = [
    ("two.urdf", bent_xml),
    ("two.urdf", bent_xml),
    ("two.urdf", lambda draw: cut(URDF.encode(), draw)),
    ("two.yaml", bent_yaml),
    ("two.yaml", lambda draw: cut(YAML.encode(), draw)),
    ("part.stl", lambda draw: cut(PART, draw)),
    ("bent.dae", lambda draw: cut(DAE.encode(), draw)),
]


def write_good(folder: Path) -> Path:
    (folder / "two.urdf").write_text(URDF)
    (folder / "part.stl").write_bytes(PART)
    (folder / "bent.dae").write_text(DAE)
    path = folder / "two.yaml"
    path.write_text(YAML)
    return path


def load(path: Path) -> ArmModel:
    arm = ArmModel(read_robot(str(path)))
    assert np.isfinite(arm.tip(arm.robot.home)).all()
    return arm


def test_the_good_files_load(tmp_path):
    assert load(write_good(tmp_path)).robot.joints == ("turn", "swing", "lift")


def test_a_damaged_robot_loads_or_is_refused_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr("sain_arm.robot.arm_model.DRAWS", 5)
    refused, loaded = set[str](), 0
    for seed in range(MUTATIONS):
        draw = random.Random(seed)
        path = write_good(tmp_path)
        name, mutate = MUTATE[seed % len(MUTATE)]
        (tmp_path / name).write_bytes(mutate(draw))
        began = time.thread_time()
        try:
            load(path)
            loaded += 1
        except SainError as error:
            text = str(error)
            assert "\n" not in text and 20 < len(text) < LONGEST, (seed, text)
            refused.add(text)
        except Exception as error:
            kept = shutil.copytree(tmp_path, tmp_path.parent / "kept", dirs_exist_ok=True)
            raise AssertionError(f"mutation {seed} of {name}, in {kept}: {error!r}") from error
        assert time.thread_time() - began < SLOWEST, seed
    assert loaded > 50 and len(refused) > 200, "mutations are neither all harmless nor all alike"
