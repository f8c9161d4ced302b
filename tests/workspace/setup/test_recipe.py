"""`./env` notices what has to be rebuilt, and rebuilds no more than that."""

from pathlib import Path

import pytest

from tests.workspace.command import run

MISSING = ("tf2_msgs", "vision_msgs")


def recipe_of(checkout: Path) -> str:
    script = f"root={checkout}; . {checkout}/tools/recipe.sh; workspace_recipe"
    return run("bash", "-euc", script).stdout


@pytest.mark.parametrize(
    ("path", "rebuilds"),
    [
        ("src/a/msg/A.msg", True),
        ("src/a/srv/A.srv", True),
        ("src/a/package.xml", True),
        ("src/a/setup.py", True),
        ("src/a/setup.cfg", True),
        ("src/a/CMakeLists.txt", True),
        ("src/a/resource/a", True),
        ("requirements/ros.in", True),
        ("requirements/python.in", False),
        ("src/a/a/node.py", False),
        ("src/a/launch/a.launch.py", False),
        ("src/a/config/a.yaml", False),
        ("src/a/config/a.rviz", False),
        ("tools/missing/tf2_msgs/msg/A.msg", True),
    ],
)
def test_edits_that_need_a_rebuild(make_checkout, path, rebuilds):
    checkout = make_checkout()
    file = checkout / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("before\n")
    before = recipe_of(checkout)
    assert before == recipe_of(checkout) != ""
    file.write_text("after\n")
    assert (recipe_of(checkout) != before) == rebuilds


@pytest.mark.parametrize(
    ("path", "rebuilds"),
    [("src/a/launch/b.launch.py", True), ("src/a/config/b.rviz", True), ("src/a/a/node.py", False)],
)
def test_new_files_that_need_a_rebuild(make_checkout, path, rebuilds):
    checkout = make_checkout()
    before = recipe_of(checkout)
    (checkout / path).parent.mkdir(parents=True)
    (checkout / path).touch()
    assert (recipe_of(checkout) != before) == rebuilds


def test_only_packages_that_changed_are_rebuilt(make_checkout):
    checkout = make_checkout()
    for package in ("edited", "kept", "removed"):
        (checkout / "src" / package).mkdir()
        (checkout / "src" / package / "setup.py").write_text("before\n")
    (checkout / "ros2_ws/install").mkdir()
    (checkout / "ros2_ws/install/recipe").write_text(recipe_of(checkout))
    (checkout / "src/edited/setup.py").write_text("after\n")
    (checkout / "src/removed/setup.py").unlink()
    (checkout / "tools/missing/tf2_msgs/package.xml").write_text("after\n")
    (checkout / "src/added").mkdir()
    (checkout / "src/added/setup.py").touch()
    sources = f"root={checkout}; . $root/tools/recipe.sh; . $root/tools/setup.sh"
    result = run("bash", "-uc", f"{sources}; cd $workspace; changed_packages")
    assert result.stdout.split() == ["added", "edited", "removed", "tf2_msgs"]


@pytest.mark.parametrize(
    ("sourced", "installed", "built"),
    [(False, False, True), (False, True, False), (True, False, False)],
)
def test_missing_messages_are_built_only_where_there_are_none(
    make_checkout, sourced, installed, built
):
    checkout = make_checkout()
    for package in MISSING if installed else ():
        (checkout / ".venv/share" / package).mkdir(parents=True)
    script = f"root={checkout}; . $root/tools/recipe.sh; workspace_recipe"
    prefix = "/opt/ros/jazzy" if sourced else None
    found = run("bash", "-euc", script, ROS_DISTRO="jazzy", AMENT_PREFIX_PATH=prefix).stdout
    assert [f"{package}/package.xml" in found for package in MISSING] == [built, built]


@pytest.mark.parametrize(
    ("distribution", "prefixes", "kind"),
    [
        ("jazzy", "/opt/ros/jazzy", "system"),
        ("jazzy", "/home/me/ws/install/a:/opt/ros/jazzy", "system"),
        ("humble", "/opt/ros/humble", "wheels"),
        ("jazzy", "/home/me/sain/.venv", "wheels"),
        (None, None, "wheels"),
    ],
)
def test_a_sourced_jazzy_install_is_used(root, distribution, prefixes, kind):
    script = f"root={root}; . $root/tools/recipe.sh; ros_kind"
    result = run("bash", "-euc", script, ROS_DISTRO=distribution, AMENT_PREFIX_PATH=prefixes)
    assert result.stdout == f"{kind}\n"
