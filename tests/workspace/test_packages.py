"""The packaging of the packages: complete, and of one mind with the code."""

import re
import sys

import pytest

from tests.paths import ROOT
from tests.workspace.source_tree import (
    PACKAGES,
    PYPROJECT,
    PYTHON_PACKAGES,
    SOURCE,
    depends,
    imports_of,
    manifest,
    optional,
    required,
)

VERSION = PYPROJECT["project"]["version"]
DISTRIBUTION_OF = {
    "cv2": "opencv-python-headless",
    "PIL": "pillow",
    "pybullet_data": "pybullet",
    "yaml": "pyyaml",
}
DOUBTFUL = {"python3-gymnasium-pip", "python3-mujoco-pip", "python3-torch"}  # of one package alone
KEY_OF = {  # the rosdep keys of distributions, in rosdep/python.yaml of ros/rosdistro
    "gymnasium": "python3-gymnasium-pip",
    "joblib": "python3-joblib",
    "matplotlib": "python3-matplotlib",
    "mujoco": "python3-mujoco-pip",
    "numba": "python3-numba",
    "numpy": "python3-numpy",
    "pillow": "python3-pil",
    "pybullet": "python3-pybullet-pip",
    "pyyaml": "python3-yaml",
    "rich": "python3-rich",
    "rosbags": "python3-rosbags-pip",
    "scipy": "python3-scipy",
    "shapely": "python3-shapely",
    "torch": "python3-torch",
    "torchvision": "python3-torchvision",
    "trimesh": "python3-trimesh-pip",
    "websockets": "python3-websockets",
}
WITHOUT_KEY = re.compile(r"<!-- without a rosdep key, [^:]*: (.*) -->")
ROS_MODULE = re.compile(r"rclpy|launch|launch_ros|ament_index_python|sain_.*|.*_msgs|.*_interfaces")


@pytest.mark.parametrize("package", PACKAGES)
def test_manifest(package):
    root = manifest(package)
    assert root.get("format") == "3"
    assert root.findtext("name") == package
    assert root.findtext("version") == VERSION
    assert root.findtext("license") == "Apache-2.0"
    assert root.findtext("description").strip()
    assert "@" in root.find("maintainer").get("email")
    assert root.findtext("export/build_type") == "ament_cmake"


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_every_package_is_in_the_wheel_and_in_a_colcon_workspace(package):
    setuptools = PYPROJECT["tool"]["setuptools"]
    assert setuptools["package-dir"][package] == f"src/{package}/{package}"
    assert f"src/{package}" in setuptools["packages"]["find"]["where"]
    assert (SOURCE / package / package / "__init__.py").exists()
    lines = (SOURCE / package / "CMakeLists.txt").read_text().splitlines()
    assert lines[1] == f"project({package} NONE)" and "register.cmake" in lines[-1]


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_ros_imports_are_declared(package):
    used = {i.module for i in imports_of(package) if ROS_MODULE.fullmatch(i.module)} - {package}
    declared = {name for name in depends(package) if ROS_MODULE.fullmatch(name)}
    assert used - declared == set(), "imported but not in package.xml"


def distributions_of(package):
    """The distributions that a package imports, ROS and Python itself aside."""
    modules = {i.module for i in imports_of(package)} - set(sys.stdlib_module_names)
    return {DISTRIBUTION_OF.get(m, m) for m in modules if not ROS_MODULE.fullmatch(m)}


def test_what_is_imported_is_asked_for_and_nothing_else():
    used = set().union(*map(distributions_of, PYTHON_PACKAGES))
    assert used - required() - optional() - {"torchvision"} == set(), (
        "imported, but not in pyproject.toml"
    )
    assert required() - used == set(), "asked for by pip install ., but not imported"


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_other_imports_are_declared_in_package_xml(package):
    used = distributions_of(package)
    elements = manifest(package).findall("exec_depend")
    keys = {e.text: e.get("condition") for e in elements if not ROS_MODULE.fullmatch(e.text)}
    assert {key for name, key in KEY_OF.items() if name in used} == set(keys)
    optional_keys = {key for name, key in KEY_OF.items() if name in used - required()}
    assert {key for key, condition in keys.items() if condition} <= optional_keys | DOUBTFUL
    named = WITHOUT_KEY.search((SOURCE / package / "package.xml").read_text())
    assert (named[1].split(", ") if named else []) == sorted(used - set(KEY_OF))


def test_the_page_installs_what_has_no_rosdep_key():
    page = (ROOT / "docs/reference/dependencies.md").read_text()
    lines = re.findall(r"^pip install ([^#\n]*)", page, re.MULTILINE)
    used = set().union(*map(distributions_of, PYTHON_PACKAGES)) - set(KEY_OF)
    assert {name for line in lines for name in line.split()} == used
