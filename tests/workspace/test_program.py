# ruff: noqa: E501 - a case is a line
"""`sain` without ROS: what `pip install .` installs, and what is said when more is asked."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.paths import ROOT
from tests.workspace.source_tree import PYPROJECT

VERSION = PYPROJECT["project"]["version"]
# What `pip install .` does not bring: ROS 2, the graph's packages and the extras.
NOT_INSTALLED = (
    "rclpy", "sain_interfaces", "std_msgs", "control_msgs", "tf2_msgs", "vision_msgs", "viser", "websockets", "trimesh", "example_robot_data", "pyarrow", "lerobot",
    "gym_pusht", "ray", "torch",
)  # fmt: skip


BLOCKED = """
import sys
from importlib.machinery import PathFinder

class Installed(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name.partition(".")[0] not in %r:
            return PathFinder.find_spec(name, path, target)

sys.meta_path = [Installed if finder is PathFinder else finder for finder in sys.meta_path]
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The environment that `pip install .` makes of a clone, its dependencies resolved by pip."""
    folder = tmp_path_factory.mktemp("installed")
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    for name in filter(lambda name: (ROOT / name).is_file(), tracked.stdout.splitlines()):
        (folder / "clone" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / "clone" / name)
    subprocess.run([sys.executable, "-m", "venv", folder / "empty"], check=True)
    pip_install(folder / "empty/bin", f"{folder}/clone")
    return folder / "empty/bin"


def pip_install(installed: Path, name: str) -> None:
    command = [installed / "pip", "install", "--quiet", name]
    subprocess.run(command, check=True, env=bare_environment(), cwd=installed)


def bare_environment() -> dict[str, str]:
    """The environment's variables without those of ./env."""
    own = ("PYTHON", "VIRTUAL_ENV", "LD_LIBRARY", "AMENT", "CMAKE", "ROS", "_ROS", "RMW", "COLCON")
    return {key: value for key, value in os.environ.items() if not key.startswith(own)}


def run_installed(installed: Path, folder: Path, *command: str) -> str:
    done = subprocess.run(
        [installed / command[0], *command[1:]],
        cwd=folder, env=bare_environment(), capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.mark.timeout(900)
def test_pip_install_is_enough_for_the_readme(installed, tmp_path):
    """As a person does it: version, help, the README's Python, collect, evaluate, train."""
    assert run_installed(installed, tmp_path, "sain", "--version") == f"sain {VERSION}\n"
    assert "sain COMMAND" in run_installed(installed, tmp_path, "sain", "--help")
    readme = (ROOT / "README.md").read_text()
    code = re.search(r"```python\n(.*?)```", readme, re.DOTALL)[1]
    prints = re.search(r"It prints `([^`]*)`", readme)[1]
    assert prints in run_installed(installed, tmp_path, "python", "-c", code).splitlines()
    run_installed(installed, tmp_path, "sain", "collect", "--episodes", "4", "--out", "data")
    one = ("--scenes", "1", "--scenario", "paper", "--controllers", "sain", "--out", "results")
    assert "paper" in run_installed(installed, tmp_path, "sain", "evaluate", *one)
    pip_install(installed, f"{installed.parents[1]}/clone[train]")
    run_installed(
        installed, tmp_path, "sain", "train", "data", "--epochs", "1", "--out", "runs/mine"
    )


@pytest.mark.timeout(900)
def test_make_dist_builds_checks_and_installs_what_is_released() -> None:
    done = subprocess.run(
        ["make", "--no-print-directory", "dist"], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("PASSED") == 2, "twine passes sdist and wheel"
    assert done.stdout.endswith(f"sain {VERSION}\n")


def run_without_ros(
    arguments: list[str], folder: Path, absent: tuple[str, ...] = NOT_INSTALLED
) -> subprocess.CompletedProcess[str]:
    """Run `sain` where only what `pip install .` brings can be imported, or all but some."""
    call = f"from sain_core.cli.program import main\nsys.exit(main({arguments!r}))\n"
    return subprocess.run(
        [sys.executable, "-c", BLOCKED % (absent,) + call],
        cwd=folder,
        capture_output=True,
        text=True,
    )


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["trian"], 2, "sain: there is no command 'trian' (did you mean 'train'?); see sain --help"),
        (["record"], 1, "sain record needs ROS 2 (rclpy), which is not installed here: run it"),
        (["sim_node"], 1, "sain sim_node needs ROS 2"),
        (
            ["train", "data", "--out", "runs"],
            1,
            "train needs PyTorch, which is not installed; install it with pip install '.[train]'",
        ),
        (["evaluate", "--scenes", "0"], 2, "evaluate: --scenes is 0; it must be at least 1"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_said(arguments, code, text, tmp_path):
    found = run_without_ros(arguments, tmp_path)
    assert found.returncode == code
    assert text in found.stderr and "Traceback" not in found.stderr


@pytest.mark.parametrize(
    ("absent", "arguments", "brings"),
    [
        ("viser", ["page_node"], "pip install viser websockets"),
        ("vision_msgs", ["scene_node"], "./env --with robots true"),
    ],
)
def test_a_package_that_not_every_installation_has_is_named(
    absent, arguments, brings, tmp_path, ros_domain
):
    found = run_without_ros(arguments, tmp_path, (absent,))
    assert found.returncode == 1
    text = f"{arguments[0]}: needs {absent}, which is not installed; {brings}"
    assert found.stderr.startswith(text) and len(found.stderr.splitlines()) == 1, found.stderr
