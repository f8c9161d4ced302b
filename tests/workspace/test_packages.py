"""The packaging of the nine packages: complete, and of one mind with the code."""

import importlib
import re
import sys

import pytest

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
    "PIL": "pillow",
    "gym_pusht": "gym-pusht",
    "mcap_ros2": "mcap-ros2-support",
    "pybullet_data": "pybullet",
    "yaml": "pyyaml",
}
ROS_MODULE = re.compile(r"rclpy|launch|launch_ros|ament_index_python|sain_.*|.*_msgs|.*_interfaces")


def test_all_ten_are_found():
    assert PACKAGES == (
        "sain_bags", "sain_bringup", "sain_core", "sain_eval", "sain_gym",
        "sain_interfaces", "sain_live", "sain_model", "sain_mppi", "sain_sim",
    )  # fmt: skip


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
def test_every_folder_with_code_is_a_package(package):
    """setup.py finds packages by their __init__.py: a folder without one would not be installed."""
    folders = {path.parent for path in (SOURCE / package / package).rglob("*.py")}
    assert [str(f) for f in folders if not (f / "__init__.py").exists()] == []


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_ros_imports_are_declared(package):
    used = {i.module for i in imports_of(package) if ROS_MODULE.fullmatch(i.module)} - {package}
    declared = {name for name in depends(package) if ROS_MODULE.fullmatch(name)}
    assert used - declared == set(), "imported but not in package.xml"


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_other_imports_are_declared(package):
    modules = {i.module for i in imports_of(package)} - set(sys.stdlib_module_names)
    used = {DISTRIBUTION_OF.get(m, m) for m in modules if not ROS_MODULE.fullmatch(m)}
    assert requirements_of(package) == used


@pytest.mark.parametrize(("package", "name", "target"), SCRIPTS)
def test_executables_exist_and_can_be_started(package, name, target):
    module, function = target.split(":")
    assert module.startswith(f"{package}.")
    assert callable(getattr(importlib.import_module(module), function))


def test_message_packages_are_declared_where_they_are_built():
    definitions = [
        *SOURCE.glob("sain_interfaces/msg/*.msg"),
        *SOURCE.glob("sain_interfaces/srv/*.srv"),
        *SOURCE.glob("sain_interfaces/action/*.action"),
    ]
    assert len(definitions) >= 11
    used = {
        name for path in definitions for name in re.findall(r"^(\w+)/\w+", path.read_text(), re.M)
    }
    used |= (
        {"builtin_interfaces"}
        if any("Time " in path.read_text() for path in definitions)
        else set()
    )
    used |= {"action_msgs"} if any(path.suffix == ".action" for path in definitions) else set()
    listed = re.search(
        r"DEPENDENCIES ([^)]*)\)", (SOURCE / "sain_interfaces/CMakeLists.txt").read_text()
    )
    assert used == set(listed[1].split())
    assert used <= depends("sain_interfaces")
