"""The set-up: what it refuses, and that nothing half-made is ever used."""

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests.paths import ROOT
from tests.workspace.command import run

COMMANDS_OF_THE_SCRIPTS = """
    basename bash cat cksum dirname env flock grep mkdir mktemp mv readlink rm sed sleep tail xargs
""".split()  # noqa: SIM905


@pytest.fixture
def tools_only(tmp_path):
    """Makes a PATH that has only the named commands and what the scripts themselves use."""

    def make(*extra: str) -> str:
        folder = tmp_path / "bin"
        folder.mkdir()
        for name in (*COMMANDS_OF_THE_SCRIPTS, *extra):
            (folder / name).symlink_to(shutil.which(name))
        return str(folder)

    return make


def python_that(tmp_path: Path, when_making_a_venv: str) -> str:
    """An interpreter that passes the checks and then does the given thing for a venv."""
    path = tmp_path / "python3.11"
    path.write_text(f'#!/bin/sh\n[ "$1" = -c ] && exit 0\n{when_making_a_venv}\n')
    path.chmod(0o755)
    return str(path)


def assert_refused(checkout: Path, result, *words: str) -> None:
    assert result.returncode == 1
    assert result.stdout == ""
    assert result.stderr.startswith("./env: ")
    assert result.stderr.count("\n") == 1
    for word in words:
        assert word in result.stderr
    assert not (checkout / ".venv").exists()


@pytest.mark.parametrize(
    "name", ["with space", "dollar$", "quote'", "colon:", "star*", "back\\slash"]
)
def test_a_path_that_cmake_cannot_work_in(make_checkout, name):
    checkout = make_checkout(name)
    assert_refused(checkout, run(checkout / "env", "true"), name, "move the checkout")


@pytest.mark.parametrize(
    ("there", "missing", "package"),
    [
        (("g++", "make", "cmake"), "gcc", "build-essential"),
        (("gcc", "make", "cmake"), "g++", "build-essential"),
        (("gcc", "g++", "cmake"), "make", "build-essential"),
        (("gcc", "g++", "make"), "cmake", "build-essential"),
        (("gcc", "g++", "make", "cmake"), "python3.11", "python3.11-venv"),
    ],
)
def test_a_missing_tool(make_checkout, tools_only, there, missing, package):
    checkout = make_checkout()
    result = run(checkout / "env", "true", PATH=tools_only(*there), ROS_DISTRO=None)
    assert_refused(
        checkout, result, f"needs {missing}", f"sudo apt install {package.split('-')[0]}", package
    )


def test_an_environment_of_the_user_is_left_alone(make_checkout):
    checkout = make_checkout()
    mine = checkout / ".venv" / "mine.txt"
    mine.parent.mkdir()
    mine.write_text("mine")
    shutil.copy(ROOT / "Makefile", checkout)
    for command in ([checkout / "env", "true"], ["make", "--no-print-directory", "clean"]):
        result = run(*command, cwd=checkout)
        assert result.returncode != 0
        assert ".venv is not SAIN's" in result.stderr.splitlines()[0]
    assert mine.read_text() == "mine"


# --- failing, being interrupted, and waiting ----------------------------------------------------


def test_a_failed_step_is_named_with_the_end_of_its_log(make_checkout, tmp_path):
    checkout = make_checkout()
    python = python_that(tmp_path, "seq 100; echo the disk is full; exit 1")
    result = run(checkout / "env", "true", SAIN_PYTHON=python)
    assert result.returncode == 1
    assert "Failed: Python environment" in result.stderr
    assert "the disk is full" in result.stderr
    assert result.stderr.count("\n") < 20
    assert not (checkout / ".venv/stamps/base").exists()


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_run_ends_what_it_started_and_leaves_nothing(make_checkout, tmp_path, by):
    checkout = make_checkout()
    told = tmp_path / "pid"
    python = python_that(tmp_path, f"mkdir -p {checkout}/.venv; echo $$ >{told}; sleep 60")
    process = start_set_up(checkout, python)
    wait_until(lambda: told.exists() and told.read_text())
    os.killpg(process.pid, by)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 130
    assert "Interrupted" in err
    assert not (checkout / ".venv").exists()
    wait_until(lambda: not Path("/proc", told.read_text().strip()).exists())


def test_a_second_run_waits_for_the_first(make_checkout, tmp_path):
    checkout = make_checkout()
    holder = ["flock", checkout / "ros2_ws/.setup.lock", "sh", "-c", "echo held; read _"]
    first = subprocess.Popen(holder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert first.stdout.readline() == "held\n"
    second = start_set_up(checkout, python_that(tmp_path, f"echo ran >>{tmp_path}/ran; exit 1"))
    assert "waiting" in second.stderr.readline()
    assert not (tmp_path / "ran").exists()
    first.communicate("\n", timeout=20)
    second.communicate(timeout=20)
    assert (tmp_path / "ran").read_text() == "ran\n"


def start_set_up(checkout: Path, python: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        # nohup and a shell's & have signals ignored, which a shell that inherits it cannot undo
        ["env", "--default-signal=INT,HUP", checkout / "env", "true"],
        env={**os.environ, "SAIN_PYTHON": python},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # a process group of its own, as a terminal gives it
    )


def wait_until(condition, timeout_s: float = 20.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.05)
