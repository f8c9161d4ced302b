"""The arrows between the packages: who may import whom, and where ROS may be imported."""

import re
from pathlib import Path

import pytest

from tests.workspace.source_tree import PYTHON_PACKAGES, SOURCE, Import, imports_in, imports_of

BELOW = {
    "sain_core", "sain_arm", "sain_sim", "sain_model", "sain_mppi", "sain_bags", "sain_eval",
    "sain_vision",
}  # fmt: skip
MAY_IMPORT = {
    "sain_core": set(),
    "sain_arm": {"sain_core"},
    "sain_sim": {"sain_core"},
    "sain_model": {"sain_core"},
    "sain_mppi": {"sain_core"},
    "sain_bags": {"sain_core"},
    "sain_vision": {"sain_core"},
    "sain_eval": {"sain_core", "sain_sim", "sain_model", "sain_mppi", "sain_bags"},
    "sain_lab": BELOW,
    "sain_gym": BELOW | {"sain_lab"},
    "sain_live": BELOW | {"sain_lab", "sain_bringup"},
    "sain_pusht": BELOW,
    "sain_bringup": BELOW | {"sain_lab"},
}
ROS_MODULE = re.compile(r"rclpy|launch|launch_ros|sain_interfaces|.*_msgs|.*_interfaces")


def breaches(package: str) -> list[str]:
    """The imports of a package that cross a boundary."""
    allowed = MAY_IMPORT[package] | {package, "sain_interfaces"}
    found = []
    for one in imports_of(package):
        if one.module.startswith("sain_") and one.module not in allowed:
            found.append(f"{one}, which {package} must not know")
        at_the_edge = {"ros", "launch"} & set(one.path.parent.parts)
        if ROS_MODULE.fullmatch(one.module) and not at_the_edge:
            found.append(f"{one} outside a ros/ folder")
    return found


def test_every_package_has_its_arrows():
    assert set(MAY_IMPORT) == set(PYTHON_PACKAGES)


@pytest.mark.parametrize("package", sorted(MAY_IMPORT))
def test_imports_follow_the_arrows(package):
    assert breaches(package) == []


@pytest.mark.parametrize(
    ("package", "path", "code", "caught"),
    [
        ("sain_sim", "world.py", "from sain_model.priors import planar", True),
        ("sain_sim", "world.py", "from sain_core.scene import Scene", False),
        ("sain_core", "scene.py", "def f():\n    import sain_sim", True),
        ("sain_sim", "world.py", "import rclpy.node", True),
        ("sain_sim", "ros/sim_node.py", "import rclpy.node", False),
        ("sain_sim", "world.py", "from std_msgs.msg import Header", True),
        ("sain_sim", "world.py", "from sain_interfaces.msg import Scene", True),
        ("sain_sim", "ros/sim_node.py", "from sain_interfaces.msg import Scene", False),
        ("sain_sim", "world.py", "from .scene import Scene", False),
    ],
)
def test_the_check_sees_what_it_should(monkeypatch, tmp_path, package, path, code, caught):
    file = tmp_path / package / package / path
    file.parent.mkdir(parents=True)
    file.write_text(code)
    monkeypatch.setattr("tests.workspace.source_tree.SOURCE", tmp_path)
    assert bool(breaches(package)) == caught


def test_imports_are_read_with_their_place(tmp_path):
    (tmp_path / "a.py").write_text("import os.path, sys\nfrom . import b\nfrom json import loads\n")
    assert [(i.module, i.line) for i in imports_in(tmp_path / "a.py")] == [
        ("os", 1), ("sys", 1), ("json", 3),
    ]  # fmt: skip
    assert str(Import("os", SOURCE / "a.py", 1)) == f"{Path('a.py')}:1 imports os"
