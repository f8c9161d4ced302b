"""What dies or hangs is restarted; what ends as it was asked to is not."""

import os
import signal
import sys
import time
from collections.abc import Callable

import pytest

from sain_bringup.children import ProcessDiedError
from sain_bringup.processes import StopTimes, Supervisor

QUICK = StopTimes(interrupt=0.3, terminate=0.3, patience=0.5, kill=1.0)
LIVELY = """
import time
from sain_core.guarding import lifetime
print("up", flush=True)
lifetime.ready()
while True:
    lifetime.alive()
    time.sleep(lifetime.heartbeat_period() or 0.25)
"""
SPINNING = """
import time
from sain_core.guarding import lifetime
lifetime.ready()
while True:  # as a callback does that never returns
    pass
"""

JOINING = """
import os, signal, sys, threading, time
from sain_core.guarding import lifetime
asked = []
signal.signal(signal.SIGINT, lambda *_: asked.append(1))
lifetime.ready()
print("up", flush=True)
while not asked:
    lifetime.alive()
    time.sleep(0.05)
lifetime.stopping("joining the parts")
until = time.monotonic() + 3.0  # longer than anything else may take
while time.monotonic() < until and len(asked) < 2:
    lifetime.alive()
    time.sleep(0.05)
print("joined" if len(asked) == 1 else "parts are left", flush=True)
"""


@pytest.fixture
def told():
    return []


@pytest.fixture
def supervisor(tmp_path, told):
    with Supervisor(tmp_path, QUICK, tell=told.append) as made:
        yield made


def start(supervisor: Supervisor, code: str = LIVELY, name: str = "node") -> None:
    command = [sys.executable, "-c", code]
    supervisor.start(name, command, again=command)


def until(supervisor: Supervisor, condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 60.0
    while not condition():
        supervisor.check()
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def wait_until_ready(supervisor: Supervisor) -> None:
    until(supervisor, lambda: not supervisor.starting([c.name for c in supervisor.children]))


def test_a_killed_process_is_restarted_and_that_is_told(supervisor, told, tmp_path):
    start(supervisor)
    wait_until_ready(supervisor)
    first = supervisor.children[0].process.pid
    assert supervisor.back_at < 0
    os.kill(first, signal.SIGKILL)
    until(supervisor, lambda: bool(told))
    assert told[0].startswith("node was killed by SIGKILL; it was restarted, and is back after ")
    assert supervisor.children[0].process.pid != first
    assert (tmp_path / "node.log").read_text() == "up\nup\n"  # nothing of the first is lost
    assert 0 < supervisor.back_at <= time.monotonic()


@pytest.mark.parametrize("code", [LIVELY, SPINNING])
def test_a_process_that_hangs_is_noticed_within_a_second_and_restarted(supervisor, told, code):
    start(supervisor, code)
    wait_until_ready(supervisor)
    first = supervisor.children[0].process.pid
    begun = time.monotonic()
    if code == LIVELY:
        os.kill(first, signal.SIGSTOP)
    until(supervisor, lambda: supervisor.children[0].process.pid != first)
    assert 0.7 < time.monotonic() - begun < 15.0  # of a busy machine
    if code == LIVELY:
        until(supervisor, lambda: bool(told))
        assert "node gave no sign of life for 1." in told[0]


def test_a_process_that_only_waits_for_a_processor_is_left_alone(supervisor, told, monkeypatch):
    from sain_bringup import children

    start(supervisor, SPINNING)
    wait_until_ready(supervisor)
    monkeypatch.setattr(children, "waiting_times", lambda process: {"1": time.monotonic_ns()})
    first, enough = supervisor.children[0].process.pid, time.monotonic() + 1.5
    until(supervisor, lambda: time.monotonic() > enough)
    assert supervisor.children[0].process.pid == first and not told


def test_the_third_crash_within_a_minute_ends_it_with_the_reason(supervisor):
    start(supervisor)
    start(supervisor, name="other")
    wait_until_ready(supervisor)
    with pytest.raises(ProcessDiedError) as caught:
        for place in (0, 1, 0):
            os.kill(supervisor.children[place].process.pid, signal.SIGKILL)
            until(supervisor, lambda: supervisor.back_at == float("inf"))
            wait_until_ready(supervisor)
            supervisor.check()
    reason = "node was killed by SIGKILL, the last of 3 crashes within 60 s"
    assert caught.value.reason == reason
    assert caught.value.exit_code == 128 + signal.SIGKILL


@pytest.mark.parametrize("ending", ["raise SystemExit(0)", "raise SystemExit(130)"])
def test_one_that_ends_as_asked_is_not_restarted(supervisor, ending):
    start(supervisor, f"from sain_core.guarding import lifetime\nlifetime.ready()\n{ending}")
    with pytest.raises(ProcessDiedError, match="node ended with exit code"):
        until(supervisor, lambda: False)


def test_one_that_fails_at_its_start_is_not_restarted(supervisor):
    start(supervisor, "raise SystemExit('parameter seed is -1')")
    with pytest.raises(ProcessDiedError, match=r"exit code 1; .*\n.*seed is -1"):
        until(supervisor, lambda: False)


@pytest.mark.parametrize("closed_before", [True, False])
def test_joining_takes_as_long_as_it_takes_and_that_is_told(
    closed_before, supervisor, told, tmp_path
):
    command = [sys.executable, "-c", JOINING]
    supervisor.start("recorder", command, again=command, patient=True)
    wait_until_ready(supervisor)
    if closed_before:
        supervisor.close_files(0.1)
    assert supervisor.stop() == []
    assert (tmp_path / "recorder.log").read_text() == "up\njoined\n"
    assert told == ["recorder: joining the parts; Ctrl-C ends it before that is done"]
