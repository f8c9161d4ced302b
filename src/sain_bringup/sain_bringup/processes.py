"""Starts the processes of a graph, restarts one that dies or hangs, and leaves none behind.

Every process leads a session of its own: a Ctrl-C in the terminal reaches only the supervisor,
which then ends all of them in order; and whatever a process started itself ends with it.
"""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Final

from sain_bringup.heartbeats import HeartbeatConfig, Heartbeats
from sain_core.config import Config, option
from sain_core.errors import INTERRUPTED, OutputError, SainError

CHILD: Final = Path(__file__).with_name("child.py")
POLL: Final = 0.02  # [s]
LAST_LINES: Final = 12
ASKED_TO_END: Final = (0, INTERRUPTED, -signal.SIGINT)  # codes of a process that did not crash


class ProcessDiedError(SainError):
    """A process of the graph ended though nobody asked it to; ``exit_code`` is a shell's."""

    def __init__(self, text: str, exit_code: int) -> None:
        """Say what happened."""
        super().__init__(text)
        self.exit_code = exit_code


@dataclass(frozen=True)
class RestartConfig(HeartbeatConfig):
    """When a process is restarted, and when no more."""

    crashes: int = option(3, "crashes in a row of short time that end the graph", minimum=1)
    window: float = option(60.0, "that time", unit="s", minimum=0.0)


@dataclass(frozen=True)
class StopConfig(Config):
    """How patient the end is: after these times a harder signal is sent. In all below 3 s."""

    interrupt: float = option(1.2, "time to end after SIGINT", unit="s", minimum=0.0)
    terminate: float = option(0.3, "time to end after SIGTERM", unit="s", minimum=0.0)
    patience: float = option(0.7, "more time for what has a file to close", unit="s", minimum=0.0)
    kill: float = option(0.2, "time to be gone after SIGKILL", unit="s", minimum=0.0)


@dataclass(frozen=True)
class Child:
    """One process, its name and where it logs to.

    Attributes:
        patient: it has a file to close, and is not hurried before the others are gone.
        again: what restarts it; nothing: its end is the graph's.
        fault: why it was restarted, and when.
    """

    name: str
    process: "subprocess.Popen[bytes]"
    log: Path
    heartbeats: Heartbeats
    environment: dict[str, str]
    patient: bool = False
    again: tuple[str, ...] = ()
    fault: tuple[str, float] | None = None

    def last_lines(self, count: int = LAST_LINES) -> str:
        """Return the end of its log."""
        text = self.log.read_text(encoding="utf-8", errors="replace")
        lines = [line for line in text.splitlines() if line.strip()]
        return "\n".join(lines[-count:])

    @property
    def exit_code(self) -> int:
        """Its exit code as a shell has it."""
        code = self.process.returncode or 0
        return code if code >= 0 else 128 - code

    def describe_end(self) -> str:
        """Return in words how it ended."""
        code = self.process.returncode
        if code is not None and code < 0:
            return f"was killed by {signal.Signals(-code).name}"
        return f"ended with exit code {code}"

    def trouble(self) -> str:
        """Return in words what is wrong with it; empty: nothing."""
        if self.process.poll() is not None:
            return self.describe_end()
        self.heartbeats.hear(self.process.pid)
        started = self.heartbeats.ready or self.fault is not None  # the first start has its time
        return self.heartbeats.fault(self.process.pid) if started else ""


class Supervisor:
    """Owns a set of processes. Use it as a context manager: leaving it ends all of them."""

    def __init__(
        self,
        log_folder: Path,
        config: StopConfig = StopConfig(),
        restarts: RestartConfig = RestartConfig(),
        tell: Callable[[str], None] = lambda text: None,
    ) -> None:
        """Log to ``<log_folder>/<name>.log``, one file a process; `tell` hears of restarts."""
        self._log_folder = log_folder
        self._config = config
        self._restarts = restarts
        self._tell = tell
        self._children: list[Child] = []
        self._crashes: deque[float] = deque()
        self._back_at = -inf

    @property
    def children(self) -> tuple[Child, ...]:
        """All processes that were started and not stopped, dead ones too."""
        return tuple(self._children)

    @property
    def back_at(self) -> float:
        """The time [s] when the last process came back that had crashed; ``inf``: one is not."""
        return inf if any(child.fault for child in self._children) else self._back_at

    def start(
        self,
        name: str,
        command: Sequence[str],
        environment: dict[str, str] | None = None,
        patient: bool = False,
        again: Sequence[str] = (),
    ) -> None:
        """Start a process, with more variables than this one has; for the rest see `Child`.

        Raises:
            OutputError: its log cannot be written.
        """
        log = self._log_folder / f"{name}.log"
        try:
            self._log_folder.mkdir(parents=True, exist_ok=True)
            log.write_bytes(b"")
        except OSError as error:
            raise OutputError(f"cannot start {name} with its log {log}: {error}") from error
        given = environment or {}
        process, heartbeats = self._run(name, command, log, given)
        child = Child(name, process, log, heartbeats, given, patient, tuple(again))
        self._children.append(child)

    def _run(
        self, name: str, command: Sequence[str], log: Path, environment: dict[str, str]
    ) -> tuple["subprocess.Popen[bytes]", Heartbeats]:
        heartbeats = Heartbeats(self._restarts)
        more = {"PYTHONUNBUFFERED": "1", **heartbeats.environment, **environment}
        try:
            with log.open("ab") as stream:
                process = subprocess.Popen(
                    [sys.executable, "-IS", str(CHILD), str(os.getpid()), *command],
                    stdin=subprocess.DEVNULL,
                    stdout=stream,
                    stderr=subprocess.STDOUT,
                    env={**os.environ, **more},
                    start_new_session=True,
                )
        except OSError as error:
            raise OutputError(f"cannot start {name} with its log {log}: {error}") from error
        return process, heartbeats

    def starting(self, names: Collection[str]) -> list[str]:
        """Return which of these processes have not said that they are ready."""
        for child in self._children:
            child.heartbeats.hear(child.process.pid)
        return [c.name for c in self._children if c.name in names and not c.heartbeats.ready]

    def check(self) -> None:
        """Restart what has died or hangs. Call it often.

        Raises:
            ProcessDiedError: a process died that is not to be restarted, was not ready yet, ended
                as if asked to, or is one of too many within a short time. It names the process,
                how it ended, its log and that log's last lines.
        """
        for place, child in enumerate(self._children):
            if trouble := child.trouble():
                self._children[place] = self._mended(child, trouble)
            elif child.fault is not None and child.heartbeats.ready:
                why, since = child.fault
                seconds = time.monotonic() - since
                self._tell(
                    f"{child.name} {why}; it was restarted, and is back after {seconds:.1f} s"
                )
                self._children[place] = replace(child, fault=None)

    def _mended(self, child: Child, trouble: str) -> Child:
        """Return a child anew that died or hangs."""
        code = child.process.poll()
        started = child.heartbeats.ready or child.fault is not None
        if not child.again or code in ASKED_TO_END or not started:
            raise self._death(child, trouble, "")
        now = time.monotonic()
        self._crashes.append(now)
        while now - self._crashes[0] > self._restarts.window:
            self._crashes.popleft()
        if (count := len(self._crashes)) >= self._restarts.crashes:
            within = f", the last of {count} crashes within {self._restarts.window:g} s"
            raise self._death(child, trouble, within if count > 1 else "")
        _signal_group(child, signal.SIGKILL)  # what hangs, and what it left behind
        child.process.wait()
        child.heartbeats.close()
        since = now if child.fault is None else child.fault[1]
        process, heartbeats = self._run(child.name, child.again, child.log, child.environment)
        return replace(child, process=process, heartbeats=heartbeats, fault=(trouble, since))

    def _death(self, child: Child, trouble: str, more: str) -> ProcessDiedError:
        said = child.last_lines()
        text = f"{child.name} {trouble}{more}"
        text += f"; the end of {child.log}:\n{said}" if said else " and said nothing"
        return ProcessDiedError(text, child.exit_code)

    def close_files(self, patience: float) -> None:
        """Let those end that have a file to close, while those that they listen to still live.

        What was said last may have to be sent again, and only who said it can do so.
        """
        closing = [child for child in self._running() if child.patient]
        for child in closing:
            _signal_group(child, signal.SIGINT)
        self._wait(patience, closing)

    def stop(self, config: StopConfig | None = None) -> list[str]:
        """End all processes: SIGINT, then SIGTERM, then SIGKILL, each to whole process groups.

        Return the names of those that had to be killed.
        """
        config = config or self._config
        killed: list[str] = []
        for number, patience, everyone in (
            (signal.SIGINT, config.interrupt, True),
            (signal.SIGTERM, config.terminate, False),
            (signal.SIGKILL, config.patience, False),
            (signal.SIGKILL, config.kill, True),
        ):
            for child in self._running():
                if everyone or not child.patient:
                    _signal_group(child, number)
                    killed += [child.name] if number == signal.SIGKILL else []
            self._wait(patience, self._children)
        for child in self._children:
            _signal_group(child, signal.SIGKILL)  # what a process may have left behind
            child.heartbeats.close()
        self._children.clear()
        return killed

    def __enter__(self) -> "Supervisor":
        """Return the supervisor."""
        return self

    def __exit__(self, *_: object) -> None:
        """End all processes; a second Ctrl-C does not disturb that."""
        with _signals_ignored():
            self.stop()

    def _running(self) -> list[Child]:
        return [child for child in self._children if child.process.poll() is None]

    @staticmethod
    def _wait(patience: float, children: list[Child]) -> None:
        deadline = time.monotonic() + patience
        while time.monotonic() < deadline:
            if all(child.process.poll() is not None for child in children):
                return
            time.sleep(POLL)


def _signal_group(child: Child, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child.process.pid, number)


@contextlib.contextmanager
def _signals_ignored() -> Iterator[None]:
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, signal.SIG_IGN) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
