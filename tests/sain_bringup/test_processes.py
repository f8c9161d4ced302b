"""Nothing is left running, whatever the processes do."""

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


def python(code: str) -> list[str]:
    return [sys.executable, "-IS", "-c", code]


def gone(process_id: int) -> bool:
    """Whether a process ended; one that nobody waited for yet counts."""
    try:
        state = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return True
    return state == "Z"


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20.0
    while not condition():
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
