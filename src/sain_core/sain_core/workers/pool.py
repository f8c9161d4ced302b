"""Work that processes of this machine share, on top of `concurrent.futures`."""

import hashlib
import logging
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing.util import Finalize
from pathlib import Path
from threading import Thread
from time import monotonic, sleep
from typing import Any, Final, Generic, Protocol, TypeVar

from sain_core.errors import SainError
from sain_core.provenance import versions

Job = TypeVar("Job")
Done = TypeVar("Done")
JobIn = TypeVar("JobIn", contravariant=True)
DoneOut = TypeVar("DoneOut", covariant=True)

AHEAD: Final = 8  # jobs a worker may be ahead of the one that is waited for
LIVES: Final = 3  # workers that die one after another, with nothing done, before the work stops
GRACE: Final = 5.0  # [s] for a worker to clear up when its owner has died
CLOSING: Final = 1.0  # [s], likewise when the work ends before it is done
THREAD_LIMITS: Final = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)

log = logging.getLogger(__name__)


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
        """Call this function."""
        self.run = function

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

    def here(self) -> dict[str, str]:
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
        resumes: whether the same command continues after a stop.
    """

    start: Callable[[], Runner[Job, Done]]
    software: Software
    name: Callable[[Job], str]
    resumes: bool = True

    @property
    def after_a_stop(self) -> str:
        """The end of an error that stops the work."""
        whole = "; what is in the folder is whole, and the same command goes on from there"
        return whole if self.resumes else ""


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


class WorkerDiedError(SainError):
    """A worker that ended in the middle of a job."""


def run_on_processes(
    work: Work[Job, Done], jobs: Sequence[Job], size: int, ordered: bool
) -> Iterator[Done]:
    """Do jobs in so many processes; yield their results, in order or as they come.

    Where a worker dies, all are replaced, and the jobs that are not done are done again.

    Raises:
        SainError: a job cannot be done, or ends every worker that tries.
    """
    left, deaths = dict(enumerate(jobs)), 0
    while left:
        with closing(Processes(work, size)) as processes:
            try:
                for number, result in processes.results(left, ordered):
                    del left[number]
                    deaths = 0
                    yield result
            except WorkerDiedError as error:
                deaths += 1
                if deaths == LIVES:
                    raise SainError(
                        f"{LIVES} workers died, the last one: {error}{work.after_a_stop}"
                    ) from error
                log.warning("%s; its jobs are done again", error)


class Processes(Generic[Job, Done]):
    """An executor whose workers end with this process, also in the middle of a job."""

    def __init__(self, work: Work[Job, Done], size: int) -> None:
        """Begin without jobs; the first one starts so many processes."""
        self._work, self._size = work, size
        spawn = multiprocessing.get_context("spawn")
        self._executor = ProcessPoolExecutor(size, spawn, _begin, (work.start,))
        self._running: dict[Future[Done], Job] = {}
        self._processes: list[Any] = []

    def submit(self, job: Job) -> "Future[Done]":
        """Give a job to a worker that is free, as soon as one is."""
        with environment(dict.fromkeys(THREAD_LIMITS, "1")):
            future: Future[Done] = self._executor.submit(_do, job)
        # It starts them one by one, and forgets them all when one dies.
        self._processes = list(
            dict.fromkeys([*self._processes, *self._executor._processes.values()])
        )
        self._running[future] = job
        return future

    def result(self, future: "Future[Done]") -> Done:
        """Wait for the result of a job.

        Raises:
            SainError: the job cannot be done.
            WorkerDiedError: a worker died, of which nobody knows in which of the jobs.
        """
        try:
            result = future.result()
        except BrokenProcessPool as error:
            # The executor ends the others with SIGTERM; they exit with 0, or of the signal.
            ended = {*map(_exit_code, self._processes)} - {0, None}
            code = next(iter(ended - {-signal.SIGTERM} or ended), 0)
            names = map(self._work.name, list(self._running.values())[: self._size])
            raise WorkerDiedError(
                f"{' or '.join(names)} ended a worker with exit code {code}"
            ) from error
        finally:
            if future.done() and not isinstance(future.exception(), BrokenProcessPool):
                del self._running[future]
        return result

    def results(self, jobs: Mapping[int, Job], ordered: bool) -> Iterator[tuple[int, Done]]:
        """Yield numbers and results of numbered jobs."""
        numbers: dict[Future[Done], int] = {}
        waiting = iter(list(jobs.items()))
        while True:
            while len(numbers) < AHEAD * self._size and (pair := next(waiting, None)):
                numbers[self.submit(pair[1])] = pair[0]
            if not numbers:
                return
            first = next(iter(numbers))
            done = [first] if ordered else wait(numbers, return_when=FIRST_COMPLETED).done
            for future in done:
                yield numbers.pop(future), self.result(future)

    def close(self) -> None:
        """End the workers, also in the middle of a job."""
        if self._running:
            for process in self._processes:
                process.terminate()
            for process in self._processes:
                process.join(CLOSING)
                process.kill()
        self._executor.shutdown(cancel_futures=True)


def _exit_code(process: Any) -> int | None:
    """Wait for a process to end; return its exit code."""
    process.join()
    end = monotonic() + CLOSING
    while process.exitcode is None and monotonic() < end:
        sleep(0.001)  # a thread of the executor has collected it, and is about to store it
    code: int | None = process.exitcode
    return code


_runner: Runner[Any, Any]  # of this process, which is a worker


def _begin(start: Callable[[], Runner[Any, Any]]) -> None:
    """Get ready, in a worker."""
    global _runner
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the owner, who ends us
    Thread(target=_end_with_owner, daemon=True).start()
    _runner = start()
    clear_up = Finalize(None, _runner.close, exitpriority=1)

    def end(*_: object) -> None:
        try:
            clear_up()
        finally:
            os._exit(0)

    signal.signal(signal.SIGTERM, end)


def _do(job: Any) -> Any:
    return _runner.run(job)


def _end_with_owner() -> None:
    """End this process, also in the middle of a job, as soon as its owner has ended."""
    owner = multiprocessing.parent_process()
    if owner is not None:
        owner.join()
        os.kill(os.getpid(), signal.SIGTERM)
        sleep(GRACE)
        os._exit(1)
