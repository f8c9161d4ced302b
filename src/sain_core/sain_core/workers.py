"""Work that several workers share: this process, others of this machine, or a Ray cluster.

The processes are those of loky, which joblib brings: docs/decisions/0054-workers-of-loky.md.
What the work gives depends neither on the number of workers nor on where they are.
"""

import hashlib
import importlib
import logging
import os
import re
import secrets
import signal
import socket
import tempfile
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing import resource_tracker
from multiprocessing.util import Finalize
from pathlib import Path
from queue import Empty
from threading import Thread
from time import sleep
from types import ModuleType
from typing import Any, Final, Generic, Protocol, TypeVar

from joblib.externals.loky.process_executor import BrokenProcessPool, ProcessPoolExecutor

from sain_core.config import Config, option
from sain_core.errors import ConfigError, SainError
from sain_core.provenance import versions

Job = TypeVar("Job")
Done = TypeVar("Done")
JobIn = TypeVar("JobIn", contravariant=True)
DoneOut = TypeVar("DoneOut", covariant=True)

AHEAD: Final = 8  # jobs a worker may be ahead of the one that is waited for
LIVES: Final = 3  # workers that die one after another, with nothing done, before the work stops
LOOK: Final = 0.2  # [s] between looks of a worker whether its owner lives
ONE_THREAD: Final = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class WorkerOptions(Config):
    """Who does the work. What is written does not depend on it."""

    workers: int = option(
        1,
        "processes that share the work; planning takes longer with more of them than cores",
        minimum=1,
        maximum=4096,
    )
    ray: str = option(
        "",
        "Ray cluster of the workers: HOST:PORT; auto: this machine's; local: a new one on this"
        " machine",
    )


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


def run_on_workers(
    work: Work[Job, Done], jobs: Sequence[Job], options: WorkerOptions, ordered: bool = True
) -> Generator[Done, None, None]:
    """Do all jobs; yield their results in the order of the jobs, or else as they come.

    One worker without Ray is this process. Workers end with this process, killed or not.

    Raises:
        ConfigError: there is no such Ray cluster.
        SainError: a job cannot be done.
    """
    size = min(options.workers, len(jobs))
    if not jobs:
        return
    if options.ray:
        yield from run_on_ray(work, jobs, size, ordered, options.ray)
    elif size > 1:
        yield from run_on_processes(work, jobs, size, ordered)
    else:
        with closing(work.start()) as runner:
            yield from map(runner.run, jobs)


# --- processes of this machine --------------------------------------------------------------------


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
    """Workers that end with this process, also in the middle of a job."""

    def __init__(self, work: Work[Job, Done], size: int) -> None:
        """Begin without jobs; the first one starts so many processes."""
        self._work, self._size = work, size
        self._executor = ProcessPoolExecutor(
            size, initializer=_begin, initargs=(work.start, os.getpid()), env=ONE_THREAD
        )
        self._running: dict[Future[Done], Job] = {}

    def submit(self, job: Job) -> "Future[Done]":
        """Give a job to a worker that is free, as soon as one is."""
        with _interrupts_kept():  # the first job starts the processes
            future: Future[Done] = self._executor.submit(_do, job)
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
            names = " or ".join(map(self._work.name, [*self._running.values()][: self._size]))
            code = re.search(r"workers are \{(.*)\}", str(error))
            died = f"with exit code {code[1]}" if code else f": {error}"
            raise WorkerDiedError(f"{names} ended a worker {died}") from error
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
        with suppress(Empty):  # loky's thread ends with a traceback on jobs that wait still
            while self._running:
                self._executor._work_ids.get_nowait()
        self._executor.shutdown(kill_workers=bool(self._running))


@contextmanager
def _interrupts_kept() -> Iterator[None]:
    """Let Ctrl-C wait; processes that start during that never receive it, from the first moment."""
    resource_tracker.ensure_running()  # its start would let Ctrl-C through
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


_start: Callable[[], Runner[Any, Any]]  # of this process, which is a worker
_runner: Runner[Any, Any] | None = None


def _begin(start: Callable[[], Runner[Any, Any]], owner: int) -> None:
    """Get ready, in a worker."""
    global _start
    _start = start
    Thread(target=_end_with_owner, args=(owner,), daemon=True).start()


def _do(job: Any) -> Any:
    global _runner
    if _runner is None:
        _runner = _start()
        Finalize(None, _runner.close, exitpriority=1)
    return _runner.run(job)


def _end_with_owner(owner: int) -> None:
    """End this process, also in the middle of a job, soon after its owner has ended."""
    while os.getppid() == owner:
        sleep(LOOK)
    os.kill(os.getpid(), signal.SIGKILL)


# --- a Ray cluster: an optional extra, which nothing else imports ---------------------------------

LOCAL: Final = "local"
AUTO: Final = "auto"
SLOW: Final = "timed out during startup"  # in the words of Ray
KNOCK_SECONDS: Final = 10.0
RETRIES: Final = 2  # of a job whose worker died
STORE_BYTES: Final = 100_000_000  # for results on their way
TOKEN: Final = secrets.token_hex(32)  # of clusters on this machine
INSTALL: Final = 'pip install ".[ray]" in the checkout, or pip install ray'


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


@contextmanager
def ray_cluster(address: str, workers: int) -> Iterator[ModuleType]:
    """Connect to a Ray cluster and yield Ray itself; disconnect in the end.

    Args:
        address: "local": start one on this machine for as long as it is needed, in a temporary
            folder and reachable from this machine alone; "auto": the one that runs on this
            machine; else HOST:PORT.
        workers: CPUs that are needed.

    Raises:
        ConfigError: Ray is not installed, nothing answers, or the cluster is too small.
    """
    if address not in (LOCAL, AUTO):
        _knock(address)
    with (
        tempfile.TemporaryDirectory(prefix="sain-ray-", ignore_cleanup_errors=True) as folder,
        environment(_environment(address, folder)),
    ):
        try:
            import ray
        except ImportError:
            raise ConfigError(f"--ray needs Ray, which is not installed: {INSTALL}") from None
        try:
            try:
                _join(ray, _settings(address, workers, folder))
                cpus = int(ray.cluster_resources().get("CPU", 0))
            except (ConnectionError, TimeoutError, ValueError, RuntimeError) as error:
                raise ConfigError(f"no Ray cluster at {address!r}: {error}") from error
            if cpus < workers:
                raise ConfigError(
                    f"workers is {workers}; each needs a CPU, and the cluster has {cpus}"
                )
            yield ray
        finally:
            ray.shutdown()


def _join(ray: Any, settings: dict[str, Any]) -> None:
    """Start or join a cluster; where a busy machine takes more than Ray's 30 s, once again.

    Raises:
        TimeoutError: it was not up in time.
    """
    for left in (1, 0):
        try:
            ray.init(**settings)
        except Exception as error:  # Ray has no class of its own for it
            if SLOW not in str(error):
                raise
            ray.shutdown()
            if not left:
                raise TimeoutError(str(error)) from error
        else:
            return


def _knock(address: str) -> None:
    """Raise `ConfigError` when nothing listens at HOST:PORT; Ray would try for minutes."""
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host, int(port)), timeout=KNOCK_SECONDS).close()
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"no Ray cluster at {address!r}: {error}; give HOST:PORT, {AUTO} or {LOCAL}"
        ) from error


def _environment(address: str, folder: str) -> dict[str, str]:
    """Return the variables that Ray reads: it reports to no one; a local one is for us alone."""
    silent = {"RAY_USAGE_STATS_ENABLED": "0"}
    if address != LOCAL:
        return silent
    # The first is, in spite of its name, what keeps any system's Ray on the loopback address;
    # without a token of ours Ray would write one to ~/.ray.
    alone = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0", "RAY_AUTH_MODE": "token"}
    return {**silent, **alone, **ONE_THREAD, "RAY_AUTH_TOKEN": TOKEN, "TMPDIR": folder}


def _settings(address: str, workers: int, folder: str) -> dict[str, Any]:
    quiet = {"address": address, "log_to_driver": False, "logging_level": logging.ERROR}
    if address != LOCAL:
        return quiet
    return {
        **quiet,
        "num_cpus": workers,
        "include_dashboard": False,
        "object_store_memory": STORE_BYTES,
        "_plasma_directory": folder,
        "_temp_dir": folder,
        "_node_ip_address": "127.0.0.1",
    }


class RayWorker:
    """A `Runner` on a machine of the cluster, which also tells which software it runs on."""

    def __init__(self, start: Callable[[], Runner[Any, Any]], folder: str) -> None:
        """Start it, in the folder that paths are relative to where there is one."""
        with suppress(OSError):
            os.chdir(folder)
        self._runner = start()

    def run(self, job: Any) -> Any:
        """Do a job."""
        return self._runner.run(job)

    def software(self, software: Software) -> dict[str, str]:
        """Return what decides about the bytes of results."""
        return software.here()


def run_on_ray(
    work: Work[Job, Done], jobs: Sequence[Job], size: int, ordered: bool, address: str
) -> Iterator[Done]:
    """Do jobs in so many actors of a cluster, one CPU each; yield their results.

    An actor that dies is replaced, and its job done again.

    Raises:
        ConfigError: see `ray_cluster`; or a machine has other software, whose bytes could differ.
        SainError: a job cannot be done.
    """
    with ray_cluster(address, size) as ray:
        actors = start_actors(ray, size, work)
        pool = importlib.import_module("ray.util").ActorPool(actors)
        try:
            results = pool.map if ordered else pool.map_unordered
            yield from results(lambda actor, job: actor.run.remote(job), jobs)
        except ray.exceptions.RayTaskError as error:
            cause = error.cause
            raise cause if isinstance(cause, SainError) else SainError(f"Ray: {error}") from error
        except ray.exceptions.RayError as error:
            raise SainError(f"Ray: {error}{work.after_a_stop}") from error
        finally:
            for actor in actors:  # also in the middle of a job
                ray.kill(actor)


def start_actors(ray: ModuleType, size: int, work: Work[Any, Any]) -> list[Any]:
    """Start actors; raise `ConfigError` where their software is not the one here."""
    remote = ray.remote(num_cpus=1, max_restarts=-1, max_task_retries=RETRIES)(RayWorker)
    actors = [remote.remote(work.start, str(Path.cwd())) for _ in range(size)]
    own = work.software.here()
    for other in ray.get([actor.software.remote(work.software) for actor in actors]):
        if other != own:
            raise ConfigError(
                f"a machine of the cluster has {other}, this one {own}; with other software the"
                " same seed may give other bytes"
            )
    return actors
