"""The packaging of the packages: complete, and of one mind with the code."""

import importlib
import re
import sys

import pytest

from tests.paths import ROOT
from tests.workspace.source_tree import (
    PACKAGES,
    PYTHON_PACKAGES,
    SOURCE,
    console_scripts,
    depends,
    imports_of,
    manifest,
    requirements_of,
    setup_arguments,
)

VERSION = "0.1.0"
SCRIPTS = [
    (p, name, target) for p in PYTHON_PACKAGES for name, target in console_scripts(p).items()
]
DISTRIBUTION_OF = {
    "cv2": "opencv-python-headless",
    "PIL": "pillow",
    "gym_pusht": "gym-pusht",
    "mcap_ros2": "mcap-ros2-support",
    "pybullet_data": "pybullet",
    "yaml": "pyyaml",
}
DATA = {"example-robot-data"}  # nothing to import
KEY_OF = {  # the rosdep keys of distributions, in rosdep/python.yaml of ros/rosdistro
    "gymnasium": "python3-gymnasium-pip",
    "h5py": "python3-h5py",
    "joblib": "python3-joblib",
    "matplotlib": "python3-matplotlib",
    "mcap-ros2-support": "mcap-ros2-support",
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
    "tensorboardX": "python3-tensorboardX-pip",
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
    build_type = "ament_python" if package in PYTHON_PACKAGES else "ament_cmake"
    assert root.findtext("export/build_type") == build_type


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_setup_files(package):
    folder = SOURCE / package
    arguments = setup_arguments(package)
    assert arguments["version"] == VERSION
    assert arguments["license"] == "Apache-2.0"
    assert (folder / "resource" / package).exists()
    assert (folder / package / "__init__.py").exists()
    scripts = f"$base/lib/{package}"
    assert (folder / "setup.cfg").read_text() == (
        f"[develop]\nscript_dir={scripts}\n[install]\ninstall_scripts={scripts}\n"
    )


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_ros_imports_are_declared(package):
    used = {i.module for i in imports_of(package) if ROS_MODULE.fullmatch(i.module)} - {package}
    declared = {name for name in depends(package) if ROS_MODULE.fullmatch(name)}
    assert used - declared == set(), "imported but not in package.xml"


def distributions_of(package):
    """The distributions that a package imports, ROS and Python itself aside."""
    modules = {i.module for i in imports_of(package)} - set(sys.stdlib_module_names)
    return {DISTRIBUTION_OF.get(m, m) for m in modules if not ROS_MODULE.fullmatch(m)}


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_other_imports_are_declared_in_setup_py(package):
    assert requirements_of(package) - DATA == distributions_of(package)


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_other_imports_are_declared_in_package_xml(package):
    used, required = distributions_of(package), set(setup_arguments(package)["install_requires"])
    elements = manifest(package).findall("exec_depend")
    keys = {e.text: e.get("condition") for e in elements if not ROS_MODULE.fullmatch(e.text)}
    assert keys == {
        KEY_OF[name]: None if name in required else "$SAIN_EXTRAS == all"
        for name in used & set(KEY_OF)
    }
    named = WITHOUT_KEY.search((SOURCE / package / "package.xml").read_text())
    assert (named[1].split(", ") if named else []) == sorted(used - set(KEY_OF))


def test_the_page_installs_what_has_no_rosdep_key():
    page = (ROOT / "docs/reference/dependencies.md").read_text()
    lines = re.findall(r"^pip install ([^#\n]*)", page, re.MULTILINE)
    required = {name for p in PYTHON_PACKAGES for name in setup_arguments(p)["install_requires"]}
    used = {name for p in PYTHON_PACKAGES for name in distributions_of(p)} - set(KEY_OF)
    assert [line.split() for line in lines] == [sorted(used & required), sorted(used - required)]


@pytest.mark.parametrize(("package", "name", "target"), SCRIPTS)
def test_executables_exist_and_can_be_started(package, name, target):
    module, function = target.split(":")
    assert module.startswith(f"{package}.")
    assert callable(getattr(importlib.import_module(module), function))
