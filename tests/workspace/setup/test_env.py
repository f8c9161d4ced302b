"""`./env`: what it runs commands with."""

import os
import subprocess

import pytest

from tests.paths import ROOT
from tests.workspace.command import run


def test_exit_code_arguments_and_folder_are_the_caller_s(root, tmp_path):
    result = run(
        root / "env",
        "sh",
        "-c",
        'pwd; printf "<%s>" "$@"; exit 7',
        "_",
        "a b",
        "",
        "*",
        cwd=tmp_path,
    )
    assert result.returncode == 7
    assert result.stdout == f"{tmp_path}\n<a b><><*>"
    assert result.stderr == ""


def test_works_through_a_symbolic_link(root, tmp_path):
    (tmp_path / "link").symlink_to(root / "env")
    result = run(tmp_path / "link", "sh", "-c", "echo $VIRTUAL_ENV", cwd=tmp_path)
    assert result.stdout == f"{root}/.venv\n"


def test_without_a_command_it_says_what_it_is_for(root):
    assert run(root / "env").returncode == 2
    result = run(root / "env", "--help")
    assert result.returncode == 0
    assert result.stdout.startswith("./env CMD")


@pytest.mark.parametrize(
    ("variable", "given", "seen"),
    [
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", None, "LOCALHOST"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET", "SUBNET"),
        ("ROS_LOG_DIR", None, f"{ROOT}/ros2_ws/log/ros"),
        ("ROS_LOG_DIR", "/tmp/logs", "/tmp/logs"),
        ("MPLCONFIGDIR", None, f"{ROOT}/.venv/matplotlib"),
        ("MPLCONFIGDIR", "/tmp/fonts", "/tmp/fonts"),
        ("OMP_NUM_THREADS", None, "1"),
        ("OMP_NUM_THREADS", "4", "4"),
        ("RMW_IMPLEMENTATION", None, "rmw_fastrtps_cpp"),
        ("ROS_DISTRO", None, "jazzy"),
    ],
)
def test_defaults_yield_to_the_user(root, variable, given, seen):
    assert run(root / "env", "printenv", variable, **{variable: given}).stdout == f"{seen}\n"


@pytest.mark.parametrize("variable", ["PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH"])
def test_one_inside_the_other_adds_nothing(root, variable):
    once = run(root / "env", "printenv", variable)
    twice = run(root / "env", root / "env", "printenv", variable)
    assert once.stdout == twice.stdout != ""


def test_what_the_user_had_on_the_paths_stays_behind_ours(root):
    result = run(root / "env", "printenv", "PYTHONPATH", PYTHONPATH="/mine", AMENT_PREFIX_PATH=None)
    assert result.stdout.endswith(":/mine\n")


def test_another_distribution_s_libraries_are_kept_out(root):
    if "/opt/ros/jazzy" in os.environ.get("AMENT_PREFIX_PATH", ""):
        pytest.skip("a full Jazzy install is in use")
    humble = "/opt/ros/humble/lib/python3.10/site-packages"
    result = run(
        root / "env", "printenv", "PYTHONPATH", "AMENT_PREFIX_PATH",
        PYTHONPATH=humble, AMENT_PREFIX_PATH="/opt/ros/humble", ROS_DISTRO="humble",
    )  # fmt: skip
    assert result.stdout.count("\n") == 2
    assert "humble" not in result.stdout


def test_the_middleware_and_the_numerics_live_in_one_process(root):
    """And Python starts once: the wheels would start it again, were the library path not set."""
    code = "import rclpy, torch, numba, pybullet, sain_interfaces.msg, os; print(os.getpid())"
    process = subprocess.Popen(
        [str(root / "env"), "python", "-c", code], stdout=subprocess.PIPE, text=True
    )
    out, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    assert out.splitlines()[-1] == str(process.pid)
