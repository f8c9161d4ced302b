"""Nothing is left running, whatever processes do; what dies or hangs is restarted."""

import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from sain_bringup.children import ProcessDiedError
from sain_bringup.processes import StopTimes, Supervisor

QUICK = StopTimes(interrupt=0.3, terminate=0.3, patience=0.5, kill=1.0)
SLEEP = [sys.executable, "-IS", "-c", "import time; print('up', flush=True); time.sleep(600)"]
DEAF = """
import signal, time
signal.signal(signal.SIGINT, signal.SIG_IGN)
{more}
print('up', flush=True)
time.sleep(600)
"""
ORDERLY = """
import os, signal, sys, time
def end(*_):
    os.write(1, b'closing\\n')  # no print: the signal may come while 'up' is being printed
    time.sleep(0.3)
    os.write(1, b'closed\\n')
    sys.exit(0)
signal.signal(signal.SIGINT, end)
print('up', flush=True)
time.sleep(600)
"""

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


def python(code: str) -> list[str]:
    return [sys.executable, "-IS", "-c", code]


def gone(process_id: int) -> bool:
    """Whether a process ended; one that nobody waited for yet counts."""
    try:
        state = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return True
    return state == "Z"


def until(condition: Callable[[], bool], supervisor: Supervisor | None = None) -> None:
    """Wait until something is so, and have a supervisor look after its processes meanwhile."""
    deadline = time.monotonic() + 60.0
    while not condition():
        if supervisor is not None:
            supervisor.check()
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def wait_for(log: Path, text: str) -> None:
    until(lambda: log.exists() and text in log.read_text())


def test_a_process_that_dies_is_reported_with_its_last_words(tmp_path):
    with Supervisor(tmp_path, QUICK) as supervisor:
        supervisor.start("steady", SLEEP)
        supervisor.start(
            "frail", python("print('first', flush=True); raise SystemExit('out of luck')")
        )
        until(lambda: supervisor.children[1].process.poll() is not None)
        with pytest.raises(ProcessDiedError, match=r"frail ended with exit code 1.*") as caught:
            supervisor.check()
        steady = supervisor.children[0]
    assert "first\nout of luck" in str(caught.value)
    assert gone(steady.process.pid)


@pytest.mark.parametrize(
    ("more", "killed"), [("", []), ("signal.signal(signal.SIGTERM, signal.SIG_IGN)", ["deaf"])]
)
def test_a_process_that_ignores_signals_ends_all_the_same(more, killed, tmp_path):
    supervisor = Supervisor(tmp_path, QUICK)
    supervisor.start("deaf", python(DEAF.format(more=more)))
    (child,) = supervisor.children
    wait_for(child.log, "up")
    assert supervisor.stop() == killed
    assert child.process.returncode == (-signal.SIGKILL if killed else -signal.SIGTERM)


def test_children_of_children_end_too(tmp_path):
    code = f"""
        import subprocess, sys
        grandchild = subprocess.Popen([sys.executable, "-IS", "-c", {DEAF.format(more="")!r}])
        print(grandchild.pid, flush=True)
    """
    supervisor = Supervisor(tmp_path, QUICK)
    supervisor.start("parent", python(textwrap.dedent(code)))  # dies, and leaves one behind
    (child,) = supervisor.children
    wait_for(child.log, "\n")
    grandchild = int(child.log.read_text().splitlines()[0])
    supervisor.stop()
    until(lambda: gone(grandchild))


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_children_end_when_the_supervisor_is_killed(number, tmp_path):
    code = f"""
        import sys, time
        from pathlib import Path
        from sain_bringup.processes import Supervisor
        supervisor = Supervisor(Path({str(tmp_path)!r}))
        supervisor.start("child", {SLEEP!r})
        print(supervisor.children[0].process.pid, flush=True)
        time.sleep(600)
    """
    owner = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code)], stdout=subprocess.PIPE, text=True
    )
    child = int(owner.stdout.readline())
    wait_for(tmp_path / "child.log", "up")
    assert not gone(child)
    owner.send_signal(number)
    owner.wait()
    owner.stdout.close()
    until(lambda: gone(child))


def test_a_second_interrupt_does_not_disturb_the_end(tmp_path):
    code = f"""
        import os, signal, threading
        from pathlib import Path
        from sain_bringup.processes import Supervisor

        def interrupt_the_end():
            while supervisor.children[0].log.read_text() == "up\\n":  # it is not ending yet
                pass
            os.kill(os.getpid(), signal.SIGINT)

        with Supervisor(Path({str(tmp_path)!r})) as supervisor:
            supervisor.start("orderly", {python(ORDERLY)!r})
            print(supervisor.children[0].process.pid, flush=True)
            while "up" not in supervisor.children[0].log.read_text():
                pass
            threading.Thread(target=interrupt_the_end).start()
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, timeout=60
    )
    assert done.stderr == ""
    assert gone(int(done.stdout))
    assert (tmp_path / "orderly.log").read_text() == "up\nclosing\nclosed\n"


def test_a_command_that_does_not_exist_is_reported(tmp_path):
    with Supervisor(tmp_path, QUICK) as supervisor:
        supervisor.start("ghost", [str(tmp_path / "no-such-program")])
        until(lambda: supervisor.children[0].process.poll() is not None)
        with pytest.raises(ProcessDiedError, match="No such file"):
            supervisor.check()


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


def wait_until_ready(supervisor: Supervisor) -> None:
    until(lambda: not supervisor.starting([c.name for c in supervisor.children]), supervisor)


def test_a_killed_process_is_restarted_and_that_is_told(supervisor, told, tmp_path):
    start(supervisor)
    wait_until_ready(supervisor)
    first = supervisor.children[0].process.pid
    assert supervisor.back_at < 0
    os.kill(first, signal.SIGKILL)
    until(lambda: bool(told), supervisor)
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
    until(lambda: supervisor.children[0].process.pid != first, supervisor)
    assert 0.7 < time.monotonic() - begun < 15.0  # of a busy machine
    if code == LIVELY:
        until(lambda: bool(told), supervisor)
        assert "node gave no sign of life for 1." in told[0]


def test_a_process_that_only_waits_for_a_processor_is_left_alone(supervisor, told, monkeypatch):
    from sain_bringup import children

    start(supervisor, SPINNING)
    wait_until_ready(supervisor)
    monkeypatch.setattr(children, "waiting_times", lambda process: {"1": time.monotonic_ns()})
    first, enough = supervisor.children[0].process.pid, time.monotonic() + 1.5
    until(lambda: time.monotonic() > enough, supervisor)
    assert supervisor.children[0].process.pid == first and not told


def test_no_process_is_restarted_because_the_machine_stood_still(supervisor, told):
    start(supervisor)
    wait_until_ready(supervisor)
    first = supervisor.children[0].process.pid
    os.kill(first, signal.SIGSTOP)
    time.sleep(2.0)  # nobody looks
    supervisor.check()
    os.kill(first, signal.SIGCONT)
    enough = time.monotonic() + 1.5
    until(lambda: time.monotonic() > enough, supervisor)
    assert supervisor.children[0].process.pid == first and not told


def test_the_third_crash_within_a_minute_ends_it_with_the_reason(supervisor):
    start(supervisor)
    start(supervisor, name="other")
    wait_until_ready(supervisor)
    with pytest.raises(ProcessDiedError) as caught:
        for place in (0, 1, 0):
            os.kill(supervisor.children[place].process.pid, signal.SIGKILL)
            until(lambda: supervisor.back_at == float("inf"), supervisor)
            wait_until_ready(supervisor)
            supervisor.check()
    reason = "node was killed by SIGKILL, the last of 3 crashes within 60 s"
    assert caught.value.reason == reason
    assert caught.value.exit_code == 128 + signal.SIGKILL


@pytest.mark.parametrize("ending", ["raise SystemExit(0)", "raise SystemExit(130)"])
def test_one_that_ends_as_asked_is_not_restarted(supervisor, ending):
    start(supervisor, f"from sain_core.guarding import lifetime\nlifetime.ready()\n{ending}")
    with pytest.raises(ProcessDiedError, match="node ended with exit code"):
        until(lambda: False, supervisor)


def test_one_that_fails_at_its_start_is_not_restarted(supervisor):
    start(supervisor, "raise SystemExit('parameter seed is -1')")
    with pytest.raises(ProcessDiedError, match=r"exit code 1; .*\n.*seed is -1"):
        until(lambda: False, supervisor)


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
