"""A process ends in time although the middleware holds the interpreter and never comes back."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sain_core.guarding.lifetime import ending_within

STUCK = "ctypes.PyDLL(None).sleep(60)"  # holds the interpreter: no thread of Python runs meanwhile
STUCK_AT_EXIT = f"import ctypes, atexit\natexit.register(lambda: {STUCK})\n"
RECORD = f"""
import ctypes, sys
from sain_bags.commands import record
from sain_bags.ros.recorder import Recorder
Recorder.destroy_node = lambda self: {STUCK}
sys.argv = ["record", "--out", "bag"]
sys.exit(record())
"""


def run(code: str, folder: Path) -> tuple[int, float]:
    start = time.monotonic()
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, timeout=50)
    return done.returncode, time.monotonic() - start


@pytest.mark.parametrize("code", [0, 1, 130])
def test_what_hangs_ends_with_the_exit_code_of_what_was_done(code: int, tmp_path: Path) -> None:
    inside = f"with ending_within(0.3, {code}):\n    {STUCK}\n"
    ended, seconds = run(
        f"import ctypes\nfrom sain_core.guarding.lifetime import ending_within\n{inside}", tmp_path
    )
    assert ended == code and seconds < 20.0


def test_what_ends_in_time_goes_on() -> None:
    for _ in range(3):
        with ending_within(0.2):
            pass
    time.sleep(0.4)  # or else this process would be gone by now


def test_a_command_ends_although_the_interpreter_cannot(tmp_path: Path, ros_domain: int) -> None:
    code = "import sys\nfrom sain_bringup.commands import reset\n"
    code += "sys.argv = ['reset', '--timeout', '0.1']\nsys.exit(reset())\n"
    ended, seconds = run(STUCK_AT_EXIT + code, tmp_path)
    assert ended == 1 and seconds < 30.0


def test_a_recording_is_whole_although_the_middleware_hangs(
    tmp_path: Path, ros_domain: int
) -> None:
    with subprocess.Popen([sys.executable, "-c", RECORD], cwd=tmp_path) as recorder:
        deadline = time.monotonic() + 30.0
        while not list(tmp_path.glob("bag/*.mcap")) and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(1.0)
        os.kill(recorder.pid, signal.SIGINT)
        start = time.monotonic()
        assert recorder.wait(timeout=20) == 0
    assert 3.0 < time.monotonic() - start < 10.0  # it did hang
    assert (tmp_path / "bag/metadata.yaml").exists()
