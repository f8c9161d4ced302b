"""Workers of this machine: what they do, and the order in which their results come."""

import hashlib
import logging
import multiprocessing
import os
import signal
import sys
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing import connection
from pathlib import Path
from threading import Thread
from time import sleep
from typing import Any, Final, Generic, NamedTuple, Protocol, TypeVar

from sain_core.errors import SainError
from sain_core.provenance import versions

Job = TypeVar("Job")
Done = TypeVar("Done")
JobIn = TypeVar("JobIn", contravariant=True)
DoneOut = TypeVar("DoneOut", covariant=True)


class Runner(Protocol[JobIn, DoneOut]):
    """Does jobs, one after the other, and keeps between them what it needs."""

    def run(self, job: JobIn, /) -> DoneOut:
        """Do a job; a `SainError` is one of the whole work."""
        ...

    def close(self) -> None:
        """Release what it keeps."""
        ...


class FunctionRunner(Generic[Job, Done]):
    """A `Runner` that calls a function and keeps nothing."""

    def __init__(self, function: Callable[[Job], Done]) -> None:
        """Store the function."""
        self._function = function

    def run(self, job: Job) -> Done:
        """Do a job."""
        return self._function(job)

    def close(self) -> None:
        """There is nothing to release."""


@dataclass(frozen=True)
class Software:
    """What decides about the bytes that work gives.

    Attributes:
        sources: packages whose Python files count.
        packages: distributions whose versions count.
    """

    sources: tuple[str, ...]
    packages: tuple[str, ...]

    def found(self) -> dict[str, str]:
        """Return it as it is on this machine."""
        digest = hashlib.sha256()
        for name in self.sources:
            spec = find_spec(name)
            assert spec is not None and spec.origin is not None
            for path in sorted(Path(spec.origin).parent.rglob("*.py")):
                digest.update(path.read_bytes())
        return {**versions(*self.packages), "sain": digest.hexdigest()[:12]}


@dataclass(frozen=True)
class Work(Generic[Job, Done]):
    """Work that workers share.

    Attributes:
        start: makes, in a worker, what does the jobs; it can be pickled.
        software: what the results depend on.
        name: returns the name of a job for errors.
        goes_on: whether the same command continues after a stop.
    """

    start: Callable[[], Runner[Job, Done]]
    software: Software
    name: Callable[[Job], str]
    goes_on: bool = True

    @property
    def after_a_stop(self) -> str:
        """The end of an error that stops the work."""
        whole = "; what is in the folder is whole, and the same command goes on from there"
        return whole if self.goes_on else ""


AHEAD: Final = 8  # jobs a worker may be ahead of the one that is waited for
THREAD_LIMITS: Final = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


@contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables for a while; processes that start meanwhile inherit them."""
    before = dict(os.environ)
    os.environ.update(values)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


class WorkerPool(ABC, Generic[Job, Done]):
    """Workers, each of which does one job at a time. Jobs have numbers."""

    def __init__(self, size: int, work: Work[Job, Done]) -> None:
        """Begin without workers; there are to be so many."""
        self.size, self._work = size, work
        self._idle: list[Any] = []
        self._busy: dict[Any, tuple[Any, int, Job]] = {}  # by what is waited for

    @property
    def free(self) -> int:
        """How many workers have nothing to do."""
        return len(self._idle)

    @property
    def _workers(self) -> list[Any]:
        return [*self._idle, *(worker for worker, _, _ in self._busy.values())]

    @abstractmethod
    def begin(self, number: int, job: Job) -> None:
        """Give a job to a worker that is free."""

    @abstractmethod
    def finished(self) -> list[tuple[int, Done]]:
        """Wait until there are jobs that have ended; return their numbers and results.

        Raises:
            SainError: one cannot be done, or ends every worker that tries.
        """

    @abstractmethod
    def close(self) -> None:
        """End the workers, also in the middle of a job."""


def in_order(pool: WorkerPool[Job, Done], jobs: Sequence[Job]) -> Iterator[Done]:
    """Do jobs on a pool; yield their results in order."""
    waiting = deque(enumerate(jobs))
    done: dict[int, Done] = {}
    for wanted in range(len(jobs)):
        while wanted not in done:
            while waiting and pool.free and waiting[0][0] < wanted + AHEAD * pool.size:
                pool.begin(*waiting.popleft())
            done.update(pool.finished())
        yield done.pop(wanted)


def as_finished(pool: WorkerPool[Job, Done], jobs: Sequence[Job]) -> Iterator[Done]:
    """Do jobs on a pool; yield their results as they come."""
    waiting = deque(enumerate(jobs))
    left = len(jobs)
    while left:
        while waiting and pool.free:
            pool.begin(*waiting.popleft())
        for _, result in pool.finished():
            left -= 1
            yield result


LIVES: Final = 3  # workers that a job may cost before the work stops
GRACE: Final = 5.0  # [s] for a worker to clear up when its owner has died

log = logging.getLogger(__name__)


class _Worker(NamedTuple):
    process: Any  # a spawned process
    pipe: connection.Connection


class ProcessPool(WorkerPool[Job, Done]):
    """Processes of this machine; one that dies is replaced and its job is done again."""

    def __init__(self, size: int, work: Work[Job, Done]) -> None:
        """Start so many processes."""
        super().__init__(size, work)
        self._context = multiprocessing.get_context("spawn")
        self._deaths: Counter[int] = Counter()
        self._idle += [self._start() for _ in range(size)]

    def begin(self, number: int, job: Job) -> None:
        """Give a job to a process that is free."""
        worker = self._idle.pop()
        self._busy[worker.pipe] = (worker, number, job)
        with suppress(BrokenPipeError):  # it died while idle: `finished` will see
            worker.pipe.send(job)

    def finished(self) -> list[tuple[int, Done]]:
        """Wait for processes that have ended a job; see `WorkerPool`."""
        results = []
        for pipe in connection.wait(list(self._busy)):
            worker, number, job = self._busy.pop(pipe)
            try:
                answer = worker.pipe.recv()
            except (EOFError, ConnectionResetError):
                self._replace(worker, number, job)
                continue
            self._idle.append(worker)
            if isinstance(answer, SainError):
                raise answer
            results.append((number, answer))
        return results

    def _replace(self, worker: _Worker, number: int, job: Job) -> None:
        """Give the job of a worker that died to a new one."""
        worker.pipe.close()
        worker.process.join()
        self._deaths[number] += 1
        code, name = worker.process.exitcode, self._work.name(job)
        if self._deaths[number] == LIVES:
            raise SainError(
                f"{name} ended {LIVES} workers, the last with exit code"
                f" {code}{self._work.after_a_stop}"
            )
        log.warning("a worker died (exit code %s); %s is run again", code, name)
        self._idle.append(self._start())
        self.begin(number, job)

    def _start(self) -> _Worker:
        pipe, its_end = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(its_end, self._work.start))
        with environment(dict.fromkeys(THREAD_LIMITS, "1")):  # read once, when a worker starts
            process.start()
        its_end.close()  # so that a worker's death closes the pipe
        return _Worker(process, pipe)

    def close(self) -> None:
        """End the processes, also in the middle of a job."""
        for worker, _, _ in self._busy.values():
            worker.process.terminate()
        for worker in self._workers:
            worker.pipe.close()  # ends the idle ones
            worker.process.join()


def _serve(pipe: connection.Connection, start: Callable[[], Runner[Any, Any]]) -> None:
    """Do the jobs that come through a pipe until it closes, as it does when its owner dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the owner, who ends us
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # clears up
    Thread(target=_end_with_owner, daemon=True).start()
    with closing(start()) as runner, suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            pipe.send(_result(runner, pipe.recv()))


def _end_with_owner() -> None:
    """End this process, also in the middle of a job, as soon as its owner has ended."""
    owner = multiprocessing.parent_process()
    if owner is not None:
        owner.join()
        os.kill(os.getpid(), signal.SIGTERM)
        sleep(GRACE)
        os._exit(1)


def _result(runner: Runner[Any, Any], job: Any) -> Any:
    try:
        return runner.run(job)
    except SainError as error:
        return error
