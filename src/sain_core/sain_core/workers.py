"""Work that several workers share: processes of this machine, or actors of a Ray cluster.

Both are backends of `joblib.Parallel`: docs/decisions/0054-workers-of-loky.md. The results depend
neither on the number of workers nor on their machines.
"""

import hashlib
import logging
import os
import re
import secrets
import signal
import socket
import tempfile
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from multiprocessing import resource_tracker
from pathlib import Path
from pickle import dumps, loads
from threading import Thread
from time import sleep
from typing import Any, Final

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky import get_reusable_executor
from joblib.externals.loky.process_executor import TerminatedWorkerError

from sain_core.config import Config, option
from sain_core.errors import ConfigError, SainError
from sain_core.provenance import versions

LOCAL: Final = "local"
AUTO: Final = "auto"
LOOK: Final = 0.2  # [s] between looks of a worker whether its owner lives
ROUND: Final = 16  # jobs of each actor of a cluster before their results come back
KNOCK_SECONDS: Final = 10.0
STORE_BYTES: Final = 100_000_000  # of a local cluster, for results on their way
# Ray reads these when it is imported. The first is, in spite of its name, what keeps a cluster on
# the loopback address; without a token Ray would write one to ~/.ray.
ALONE: Final = {
    "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",
    "RAY_AUTH_MODE": "token",
    "RAY_AUTH_TOKEN": secrets.token_hex(32),
}
INSTALL: Final = 'pip install ".[ray]" in the checkout, or pip install ray'


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


class FunctionRunner:
    """Does jobs by a function, and keeps nothing between them."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        """Call this function."""
        self.run = function

    def close(self) -> None:
        """Do nothing."""


@dataclass(frozen=True)
class Work:
    """Work that workers share, and what decides about the bytes that it gives."""

    start: Callable[[], Any]  # makes, in a worker, what does jobs by `run` until `close`
    sources: tuple[str, ...] = ()  # packages whose Python files count
    packages: tuple[str, ...] = ()  # distributions whose versions count

    def software(self) -> dict[str, str]:
        """Return what decides, as it is on this machine."""
        digest = hashlib.sha256()
        for name in self.sources:
            spec = find_spec(name)
            assert spec is not None and spec.origin is not None
            for path in sorted(Path(spec.origin).parent.rglob("*.py")):
                digest.update(path.read_bytes())
        return {**versions(*self.packages), "sain": digest.hexdigest()[:12]}


def run_on_workers(
    work: Work, jobs: Sequence[Any], options: WorkerOptions, ordered: bool = True
) -> Generator[Any, None, None]:
    """Do all jobs; yield their results in the order of the jobs, or else as they come.

    One worker without Ray is this process. Workers end with this process, killed or not. Raises
    `ConfigError`: no such Ray cluster, or a machine of it has other software; `SainError`: a job
    cannot be done, or a worker died.
    """
    size = min(options.workers, len(jobs))
    if options.ray and jobs:
        with ray_cluster(options.ray, size):
            for first in range(0, len(jobs), ROUND * size):
                calls = _calls(work, jobs[first : first + ROUND * size])
                yield from Parallel(size, "ray", batch_size=1)(calls)
    elif size > 1:
        yield from _in_processes(work, jobs, size, ordered)
    elif jobs:
        with closing(work.start()) as runner:
            yield from map(runner.run, jobs)


def _in_processes(
    work: Work, jobs: Sequence[Any], size: int, ordered: bool
) -> Generator[Any, None, None]:
    """Do jobs in so many processes; to close this ends them, also in the middle of a job."""
    kind = "generator" if ordered else "generator_unordered"
    owner = {"initializer": _end_with, "initargs": (os.getpid(),)}
    with parallel_config("loky", inner_max_num_threads=1, **owner), _interrupts_kept():
        parallel = Parallel(size, return_as=kind, batch_size=1, max_nbytes=None)
        results, done = parallel(_calls(work, jobs)), 0
    try:
        for result in results:
            yield result
            done += 1
    except TerminatedWorkerError as error:
        code = "".join(re.findall(r"\{(.*)\}", str(error)))
        raise SainError(
            f"a worker process died with exit code {code} after {done} of {len(jobs)} jobs; where"
            " memory is short, use fewer workers"
        ) from error
    finally:
        with warnings.catch_warnings():  # joblib counts the jobs that are not needed any more
            warnings.simplefilter("ignore")
            results.close()
        get_reusable_executor(reuse=True).shutdown(kill_workers=True)


@contextmanager
def _interrupts_kept() -> Iterator[None]:
    """Let Ctrl-C wait; processes that start during that never receive it."""
    resource_tracker.ensure_running()  # its start would let Ctrl-C through
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with(owner: int) -> None:
    """End this worker, also in the middle of a job, soon after its owner has ended."""

    def look() -> None:
        while os.getppid() == owner:
            sleep(LOOK)
        os.kill(os.getpid(), signal.SIGKILL)

    Thread(target=look, daemon=True).start()


def _calls(work: Work, jobs: Sequence[Any]) -> Iterator[Any]:
    task = dumps((work, work.software(), str(Path.cwd())))
    return (delayed(_do)(task, job) for job in jobs)


def _do(task: bytes, job: Any) -> Any:
    return _runner(task).run(job)


@cache
def _runner(task: bytes) -> Any:
    """Return what does the jobs, in a worker."""
    work, software, folder = loads(task)
    if (here := work.software()) != software:
        raise ConfigError(
            f"a machine of the cluster has {here}, the first one {software}; with other software"
            " the same seed may give other bytes"
        )
    with suppress(OSError):  # another machine may not have it
        os.chdir(folder)
    return work.start()


@contextmanager
def ray_cluster(address: str, workers: int) -> Iterator[None]:
    """Make a Ray cluster with so many CPUs the backend "ray" of joblib, and its errors ours.

    The address "local" starts one on this machine for as long as it is needed, reachable from this
    machine alone; "auto" is the one that runs on this machine; else HOST:PORT.
    """
    if address not in (LOCAL, AUTO):
        _knock(address)
    os.environ.update(RAY_USAGE_STATS_ENABLED="0", **(ALONE if address == LOCAL else {}))
    try:
        import ray
        from ray.util.joblib import register_ray
    except ImportError:
        raise ConfigError(f"--ray needs Ray, which is not installed: {INSTALL}") from None
    try:
        with ExitStack() as end:
            scratch = tempfile.TemporaryDirectory(prefix="sain-ray-", ignore_cleanup_errors=True)
            folder = end.enter_context(scratch)
            end.callback(ray.shutdown)
            ray.init(**_settings(address, workers, folder))
            if (cpus := int(ray.cluster_resources().get("CPU", 0))) < workers:
                raise ConfigError(f"workers is {workers}; each needs a CPU, the cluster has {cpus}")
            register_ray()
            yield
    except ConnectionError as error:
        raise ConfigError(f"no Ray cluster at {address!r}: {error}") from error
    except ray.exceptions.RayTaskError as error:
        raise (error.cause if isinstance(error.cause, SainError) else error) from None
    except ray.exceptions.RayError as error:  # such as an actor that died
        raise SainError(f"Ray cluster {address!r}: {str(error).splitlines()[0]}") from error


def _settings(address: str, workers: int, folder: str) -> dict[str, Any]:
    quiet = {"address": address, "log_to_driver": False, "logging_level": logging.ERROR}
    if address != LOCAL:
        return quiet
    alone = {"_node_ip_address": "127.0.0.1", "_temp_dir": folder, "include_dashboard": False}
    return {**quiet, **alone, "num_cpus": workers, "object_store_memory": STORE_BYTES}


def _knock(address: str) -> None:
    """Refuse HOST:PORT where nothing listens; Ray would try for minutes."""
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host, int(port)), timeout=KNOCK_SECONDS).close()
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"no Ray cluster at {address!r}: {error}; give HOST:PORT, {AUTO} or {LOCAL}"
        ) from error
