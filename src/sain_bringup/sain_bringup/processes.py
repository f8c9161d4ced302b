"""Starts the processes of a graph, notices when one dies, and leaves none behind.

Every process leads a session of its own: a Ctrl-C in the terminal reaches only the supervisor,
which then ends all of them in order; and whatever a process started itself ends with it.
"""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sain_core.config import Config, option
from sain_core.errors import OutputError, SainError

CHILD: Final = Path(__file__).with_name("child.py")
POLL: Final = 0.02  # [s]
LAST_LINES: Final = 12
READY: Final = b": ready: "  # in the log line of a node that has started


class ProcessDiedError(SainError):
    """A process of the graph ended though nobody asked it to."""


@dataclass(frozen=True)
class StopConfig(Config):
    """How patient the end is: after these times a harder signal is sent. In all below 3 s."""

    interrupt: float = option(1.2, "time to end after SIGINT", unit="s", minimum=0.0)
    terminate: float = option(0.3, "time to end after SIGTERM", unit="s", minimum=0.0)
    patience: float = option(0.7, "more time for what has a file to close", unit="s", minimum=0.0)
    kill: float = option(0.2, "time to be gone after SIGKILL", unit="s", minimum=0.0)


@dataclass(frozen=True)
class Child:
    """One process, its name and where it logs to."""

    name: str
    process: "subprocess.Popen[bytes]"
    log: Path
    patient: bool  # it has a file to close: not hurried before the others are gone

    @property
    def is_ready(self) -> bool:
        """Whether a node has logged that it is."""
        return READY in self.log.read_bytes()

    def last_lines(self, count: int = LAST_LINES) -> str:
        """Return the end of its log."""
        text = self.log.read_text(encoding="utf-8", errors="replace")
        lines = [line for line in text.splitlines() if line.strip()]
        return "\n".join(lines[-count:])

    def describe_end(self) -> str:
        """Return in words how it ended."""
        code = self.process.returncode
        if code is not None and code < 0:
            return f"was killed by {signal.Signals(-code).name}"
        return f"ended with exit code {code}"


class Supervisor:
    """Owns a set of processes. Use it as a context manager: leaving it ends all of them."""

    def __init__(self, log_folder: Path, config: StopConfig = StopConfig()) -> None:
        """Log to ``<log_folder>/<name>.log``, one file a process."""
        self._log_folder = log_folder
        self._config = config
        self._children: list[Child] = []

    @property
    def children(self) -> tuple[Child, ...]:
        """All processes that were started and not stopped, dead ones too."""
        return tuple(self._children)

    def start(
        self,
        name: str,
        command: Sequence[str],
        environment: dict[str, str] | None = None,
        patient: bool = False,
    ) -> None:
        """Start a process, with more variables than this one has; `patient`: see `Child`.

        Raises:
            OutputError: its log cannot be written.
        """
        log = self._log_folder / f"{name}.log"
        wrapped = [sys.executable, "-IS", str(CHILD), str(os.getpid()), *command]
        try:
            self._log_folder.mkdir(parents=True, exist_ok=True)
            with log.open("wb") as stream:
                process = subprocess.Popen(
                    wrapped,
                    stdin=subprocess.DEVNULL,
                    stdout=stream,
                    stderr=subprocess.STDOUT,
                    env={**os.environ, "PYTHONUNBUFFERED": "1", **(environment or {})},
                    start_new_session=True,
                )
        except OSError as error:
            raise OutputError(f"cannot start {name} with its log {log}: {error}") from error
        self._children.append(Child(name, process, log, patient))

    def starting(self, names: Collection[str]) -> list[str]:
        """Return which of these processes have not logged that they are ready."""
        return [one.name for one in self._children if one.name in names and not one.is_ready]

    def check(self) -> None:
        """Raise when a process has died.

        Raises:
            ProcessDiedError: naming it, how it ended, its log and that log's last lines.
        """
        for child in self._children:
            if child.process.poll() is not None:
                lines = child.last_lines()
                raise ProcessDiedError(
                    f"{child.name} {child.describe_end()}; the end of {child.log}:\n{lines}"
                    if lines
                    else f"{child.name} {child.describe_end()} and said nothing"
                )

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
