"""`tools/ros2` starts executables as the real command does, and says what to do for the rest."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

REPORTER = """#!{python} -IS
import json, os, signal, sys, time
print(json.dumps({{"pid": os.getpid(), "arguments": sys.argv[1:], "from": {origin!r}}}), flush=True)
if "wait" in sys.argv:
    signal.signal(signal.SIGINT, lambda *_: sys.exit(42))
    print("waiting", flush=True)
    time.sleep(30)
"""


def install(prefix: Path, package: str, executable: str) -> None:
    """An executable that tells of itself, in an ament prefix."""
    index = prefix / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True, exist_ok=True)
    (index / package).touch()
    path = prefix / "lib" / package / executable
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(REPORTER.format(python=sys.executable, origin=prefix.name))
    path.chmod(0o755)


@pytest.fixture
def overlay(tmp_path):
    install(tmp_path / "over", "arm", "reach")
    install(tmp_path / "under", "arm", "reach")
    install(tmp_path / "under", "table", "stand")
    (tmp_path / "under/lib/table/notes.txt").write_text("no executable")
    return tmp_path


@pytest.fixture
def ros2(overlay, root):
    def start(*arguments: str) -> subprocess.Popen[str]:
        environment = dict(os.environ, AMENT_PREFIX_PATH=f"{overlay}/over:{overlay}/under:/nowhere")
        command = [str(root / "tools" / "ros2"), *arguments]
        return subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    return start


def finish(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=20)
    return process.returncode, out, err


def test_run_forwards_arguments_and_becomes_the_executable(ros2):
    arguments = ["--help", "a b", "--ros-args", "-r", "__ns:=/sain", "", "--prefix"]
    process = ros2("run", "arm", "reach", *arguments)
    code, out, _ = finish(process)
    assert code == 0
    assert json.loads(out) == {"pid": process.pid, "arguments": arguments, "from": "over"}


def test_signals_and_exit_codes_are_the_executable_s(ros2):
    process = ros2("run", "arm", "reach", "wait")
    process.stdout.readline()
    assert process.stdout.readline() == "waiting\n"
    process.send_signal(signal.SIGINT)
    assert finish(process)[0] == 42


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "leg", "reach"), "Package 'leg' not found\n"),
        (("run", "arm", "stand"), "No executable found\n"),
        (("run", "table", "notes.txt"), "No executable found\n"),
        (("pkg", "executables", "leg"), "Package 'leg' not found\n"),
    ],
)
def test_what_does_not_exist_is_named_as_the_real_command_does(ros2, arguments, message):
    assert finish(ros2(*arguments)) == (1, "", message)


def test_executables_are_listed(ros2, overlay):
    assert finish(ros2("pkg", "executables"))[1] == "arm reach\ntable stand\n"
    assert finish(ros2("pkg", "executables", "table"))[1] == "table stand\n"
    full = finish(ros2("pkg", "executables", "--full-path", "arm"))[1]
    assert full == f"{overlay}/over/lib/arm/reach\n"


@pytest.mark.parametrize(
    ("arguments", "instead"),
    [
        (("topic", "echo", "/sain/scene"), "ros2 run sain_bringup watch"),
        (("topic", "pub", "/sain/push", "x"), "ros2 run sain_bringup push"),
        (("bag", "record", "-a"), "ros2 run sain_bags record"),
        (("bag", "info", "x"), "ros2 run sain_bags info"),
        (("launch", "sain_bringup", "closed_loop.launch.py"), "ros2 run sain_bringup closed_loop"),
        (("doctor",), "install ROS 2 Jazzy"),
        (("--version",), "install ROS 2 Jazzy"),
    ],
)
def test_the_rest_gets_one_line_that_says_what_to_do(ros2, arguments, instead):
    code, out, err = finish(ros2(*arguments))
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert instead in err


def test_an_unknown_name_gets_the_nearest_one(ros2):
    assert finish(ros2("run", "arm", "reac")) == (
        1, "", "No executable found (did you mean 'reach'?)\n"
    )  # fmt: skip
    assert finish(ros2("run", "tabel", "stand")) == (
        1, "", "Package 'tabel' not found (did you mean 'table'?)\n"
    )  # fmt: skip
    assert finish(ros2("run", "arm", "xyz")) == (1, "", "No executable found\n")
