"""A command in a process of its own: what it says, how long it takes, how much memory."""

import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

PATIENCE: Final = 60.0  # [s], after which a command is ended
MEMORY: Final = 4 << 30  # [bytes], more than this process has
LOOK: Final = 0.005  # [s]
READ, REFUSED, UNTIDY, TRACEBACK, ENDLESS = "read", "refused", "untidy", "traceback", "endless"


@dataclass(frozen=True)
class Measured:
    """What one command did."""

    state: str
    megabytes: float
    seconds: float  # of the processor, which does not depend on what else the machine does
    waited: float  # [s] of the clock on the wall
    code: int
    text: str  # on standard error


def measure(run: Callable[[], int | None]) -> Measured:
    """Run a command in a process of its own."""
    sys.stdout.flush()
    with tempfile.TemporaryFile() as output, tempfile.TemporaryFile() as printed:
        began = time.monotonic()
        child = os.fork()
        if not child:
            _be_child(run, printed.fileno(), output.fileno())
        ended, status, usage = 0, 0, None
        while not ended and time.monotonic() < began + PATIENCE:
            ended, status, usage = os.wait4(child, os.WNOHANG)
            time.sleep(0 if ended else LOOK)
        waited = time.monotonic() - began
        if not ended:
            os.kill(child, signal.SIGKILL)
            _, status, usage = os.wait4(child, 0)
        printed.seek(0)
        is_silent = not printed.read(64).strip()
        output.seek(0)
        text = output.read(1 << 20).decode(errors="replace")
    assert usage is not None
    code = os.waitstatus_to_exitcode(status)
    state = ENDLESS if not ended else _judge(code, text, is_silent)
    seconds = usage.ru_utime + usage.ru_stime
    return Measured(state, usage.ru_maxrss / 1024, seconds, waited, code, text)


def _be_child(run: Callable[[], int | None], printed: int, output: int) -> None:
    code = 70
    try:
        size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
        os.dup2(printed, 1)
        os.dup2(output, 2)
        sys.stdout = os.fdopen(1, "w", closefd=False)
        sys.stderr = os.fdopen(2, "w", closefd=False)
        code = run() or 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:  # noqa: BLE001
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _judge(code: int, text: str, is_silent: bool) -> str:
    if "Traceback (most recent call last)" in text or code < 0 or code >= 70:
        return TRACEBACK
    if code in (0, 3):
        return READ
    lines = [line for line in text.strip().splitlines() if not line.startswith("[WARN]")]
    return REFUSED if len(lines) == 1 or (not lines and not is_silent) else UNTIDY
