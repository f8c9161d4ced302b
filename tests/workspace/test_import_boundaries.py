"""The arrows between the packages: who may import whom, and where ROS may be imported."""

import re

import pytest

from tests.workspace.source_tree import imports_of

BELOW = {
    "sain_core", "sain_arm", "sain_sim", "sain_model", "sain_mppi", "sain_bags", "sain_eval",
    "sain_vision",
}  # fmt: skip
MAY_IMPORT = {
    "sain_core": set(),
    "sain_arm": {"sain_core"},
    "sain_sim": {"sain_core", "sain_arm"},
    "sain_model": {"sain_core"},
    "sain_mppi": {"sain_core"},
    "sain_bags": {"sain_core"},
    "sain_vision": {"sain_core", "sain_arm"},
    "sain_eval": {"sain_core", "sain_sim", "sain_model", "sain_mppi", "sain_bags"},
    "sain_lab": BELOW,
    "sain_gym": BELOW | {"sain_lab"},
    "sain_live": BELOW | {"sain_lab", "sain_bringup"},
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


@pytest.mark.parametrize("package", sorted(MAY_IMPORT))
def test_imports_follow_the_arrows(package):
    assert breaches(package) == []
