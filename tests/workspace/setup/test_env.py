"""`./env`: what it runs commands with."""

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


def test_the_middleware_and_the_numerics_live_in_one_process(root):
    """And Python starts once: the wheels would start it again, were the library path not set."""
    code = "import rclpy, torch, numba, pybullet, sain_interfaces.msg, os; print(os.getpid())"
    process = subprocess.Popen(
        [str(root / "env"), "python", "-c", code], stdout=subprocess.PIPE, text=True
    )
    out, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    assert out.splitlines()[-1] == str(process.pid)
