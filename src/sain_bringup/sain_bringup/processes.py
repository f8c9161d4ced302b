"""Starts the processes of a graph, restarts one that dies or hangs, and leaves none behind.

Every process leads a session of its own: a Ctrl-C in the terminal reaches only the supervisor,
which then ends all of them in order; and whatever a process started itself ends with it.
"""

import signal
import time
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import Final, NamedTuple, Self

from sain_bringup.children import Child, RestartLimits

POLL: Final = 0.02  # [s]
HURRIED: Final = 1.2  # [s], the longest wait after a second signal


class StopTimes(NamedTuple):
    """How long the end waits [s] before a harder signal is sent. In all below 3 s."""

    interrupt: float = 1.2  # after SIGINT
    terminate: float = 0.3  # after SIGTERM
    patience: float = 0.7  # more for what has a file to close
    kill: float = 0.2  # after SIGKILL


UNHURRIED: Final = StopTimes(interrupt=15.0)  # nobody waits, and a recording is to be closed


class Supervisor:
    """Owns a set of processes. Use it as a context manager: leaving it ends all of them."""

    def __init__(
        self,
        log_folder: Path,
        times: StopTimes = StopTimes(),
        restarts: RestartLimits = RestartLimits(),
        tell: Callable[[str], None] = lambda text: None,
    ) -> None:
        """Log to ``<log_folder>/<name>.log``, one file a process; `tell` hears of restarts."""
        self._log_folder = log_folder
        self._times, self._restarts, self._tell = times, restarts, tell
        self._children: list[Child] = []
        self._crashes: deque[float] = deque()
        self._back_at = -inf
        self._asked: set[int] = set()  # process ids of those that were asked to close their files
        self._hurried = False  # a signal came while all are ended

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
        given = (environment or {}, patient, tuple(again))
        self._children.append(Child(name, tuple(command), log, *given, self._restarts))

    def starting(self, names: Collection[str]) -> list[str]:
        """Return which of these processes have not said that they are ready."""
        for child in self._children:
            child.heartbeats.hear(child.process.pid)
        return [c.name for c in self._children if c.name in names and not c.heartbeats.ready]

    def heard_at(self, names: Collection[str]) -> float:
        """Return when one of these that is not ready gave its last sign of life [s]; or -inf."""
        waited_for = [c for c in self._children if c.name in names and not c.heartbeats.ready]
        return max((c.heartbeats.heard_at(c.process.pid) for c in waited_for), default=-inf)

    def last_words(self, name: str) -> str:
        """Return what a process said last, to be added to an error about it; empty: no process."""
        return "".join(child.last_words() for child in self._children if child.name == name)

    def check(self) -> None:
        """Restart what has died or hangs. Call it often.

        Raises:
            ProcessDiedError: a process died that is not to be restarted, was not ready yet, ended
                as if asked to, or is one of too many within a short time. It names the process,
                how it ended, and its log's last lines.
        """
        for child in self._children:
            if trouble := child.trouble():
                self._count_crash(child, trouble)
                child.restart(trouble)
            elif child.fault and child.heartbeats.ready:
                self._back_at = time.monotonic()
                back = (
                    f"it was restarted, and is back after {self._back_at - child.failed_at:.1f} s"
                )
                self._tell(f"{child.name} {child.fault}; {back}")
                child.fault = ""

    def _count_crash(self, child: Child, trouble: str) -> None:
        """Raise `ProcessDiedError` where a process that died or hangs is not to be restarted."""
        if not child.has_crashed:
            raise child.death(trouble)
        now, limits = time.monotonic(), self._restarts
        self._crashes.append(now)
        while now - self._crashes[0] > limits.window:
            self._crashes.popleft()
        if (count := len(self._crashes)) >= limits.crashes:
            several = f", the last of {count} crashes within {limits.window:g} s"
            raise child.death(trouble + (several if count > 1 else ""))

    def close_files(self, patience: float) -> None:
        """Let those end that have a file to close, while those that they listen to still live.

        What was said last may have to be sent again, and only who said it can do so.
        """
        closing = [child for child in self._running() if child.patient]
        for child in closing:
            self._ask(child)
        self._wait(patience, closing)

    def stop(self, times: StopTimes | None = None) -> list[str]:
        """End all processes: SIGINT, then SIGTERM, then SIGKILL, each to whole process groups.

        A process that says what it does before it ends gets the time, unless a signal comes in
        `signals_noted`. Return the names of those that had to be killed.
        """
        times = times or self._times
        killed: list[str] = []
        for child in self._running():
            self._ask(child)
        for number, patience in (
            (None, times.interrupt),
            (signal.SIGTERM, times.terminate),
            (signal.SIGKILL, times.patience),
        ):
            killed += self._force(number, [c for c in self._running() if not c.patient])
            self._wait(patience, self._children)
        self._wait_for_files()
        if self._hurried:
            self._force(signal.SIGINT, self._running())
            self._wait(times.patience, self._children)
        killed += self._force(signal.SIGKILL, self._running())
        self._wait(times.kill, self._children)
        for child in self._children:
            child.send(signal.SIGKILL)  # what a process may have left behind
            child.heartbeats.close()
        self._children.clear()
        return killed

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End all processes; a second Ctrl-C ends only the wait for what closes its files."""
        with self.signals_noted():
            self.stop()

    @contextmanager
    def signals_noted(self) -> Iterator[None]:
        """Let signals do nothing but end the wait for those that close their files."""
        numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        before = {number: signal.signal(number, self._hurry) for number in numbers}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _hurry(self, *_: object) -> None:
        self._hurried = True

    def _ask(self, child: Child) -> None:
        """Send SIGINT; once only to who closes a file, for whom the second one means: at once."""
        if child.process.pid not in self._asked:
            child.send(signal.SIGINT)
        if child.patient:
            self._asked.add(child.process.pid)

    @staticmethod
    def _force(number: signal.Signals | None, children: list[Child]) -> list[str]:
        """Send a signal; return whom it kills."""
        for child in children:
            if number is not None:
                child.send(number)
        return [child.name for child in children] if number == signal.SIGKILL else []

    def _wait_for_files(self) -> None:
        """Wait while a process says what it does before it ends, and gives signs of life."""
        told: set[str] = set()
        while closing := [(c, doing) for c in self._running() if (doing := c.closing())]:
            if self._hurried:
                return
            for child, doing in closing:
                if doing not in told:
                    told.add(doing)
                    self._tell(f"{child.name}: {doing}; Ctrl-C ends it before that is done")
            time.sleep(POLL)

    def _running(self) -> list[Child]:
        return [child for child in self._children if child.process.poll() is None]

    def _wait(self, patience: float, children: list[Child]) -> None:
        started = time.monotonic()
        while time.monotonic() - started < min(patience, HURRIED if self._hurried else inf):
            if all(child.process.poll() is not None for child in children):
                return
            time.sleep(POLL)
