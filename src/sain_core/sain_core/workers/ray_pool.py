"""Workers of a Ray cluster. Ray is an optional extra: nothing else imports it."""

import functools
import logging
import os
import secrets
import socket
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from sain_core.errors import ConfigError, SainError
from sain_core.workers.pool import (
    THREAD_LIMITS,
    Done,
    Job,
    Runner,
    Software,
    Work,
    WorkerPool,
    environment,
)

LOCAL: Final = "local"
AUTO: Final = "auto"
KNOCK_SECONDS: Final = 10.0
RETRIES: Final = 2  # of a job whose worker died
STORE_BYTES: Final = 100_000_000  # for results on their way
INSTALL: Final = 'pip install "sain_core[ray]", or pip install ray'


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
    _knock(address)
    with (
        tempfile.TemporaryDirectory(prefix="sain-ray-", ignore_cleanup_errors=True) as folder,
        environment(_environment(address, folder)),
    ):
        ray = _import_ray()
        try:
            cpus = _connect(ray, address, _settings(address, workers, folder))
            if cpus < workers:
                raise ConfigError(
                    f"workers is {workers}; each needs a CPU, and the cluster has {cpus}"
                )
            yield ray
        finally:
            ray.shutdown()


def _connect(ray: ModuleType, address: str, settings: dict[str, Any]) -> int:
    """Connect to a cluster and return how many CPUs it has."""
    try:
        ray.init(**settings)
        return int(ray.cluster_resources().get("CPU", 0))
    except (ConnectionError, TimeoutError, ValueError, RuntimeError) as error:
        raise ConfigError(f"no Ray cluster at {address!r}: {error}") from error


def _knock(address: str) -> None:
    """Raise `ConfigError` when nothing listens at HOST:PORT; Ray would try for minutes."""
    if address in (LOCAL, AUTO):
        return
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host, int(port)), timeout=KNOCK_SECONDS).close()
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"no Ray cluster at {address!r}: {error}; give HOST:PORT, {AUTO} or {LOCAL}"
        ) from error


def _import_ray() -> ModuleType:
    try:
        import ray
    except ImportError:
        raise ConfigError(f"--ray needs Ray, which is not installed: {INSTALL}") from None
    return ray


def _environment(address: str, folder: str) -> dict[str, str]:
    """Return the variables that Ray reads: it reports to no one; a local one is for us alone."""
    silent = {"RAY_USAGE_STATS_ENABLED": "0"}
    if address != LOCAL:
        return silent
    # The first is, in spite of its name, what keeps any system's Ray on the loopback address;
    # without a token of ours Ray would write one to ~/.ray.
    alone = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0", "RAY_AUTH_MODE": "token"}
    limits = dict.fromkeys(THREAD_LIMITS, "1")
    return {**silent, **alone, **limits, "RAY_AUTH_TOKEN": _token(), "TMPDIR": folder}


@functools.cache
def _token() -> str:
    return secrets.token_hex(32)


def _settings(address: str, workers: int, folder: str) -> dict[str, Any]:
    quiet = {"log_to_driver": False, "logging_level": logging.ERROR}
    if address != LOCAL:
        return {"address": address, **quiet}
    return {
        "address": LOCAL,
        "num_cpus": workers,
        "include_dashboard": False,
        "object_store_memory": STORE_BYTES,
        "_plasma_directory": folder,
        "_temp_dir": folder,
        "_node_ip_address": "127.0.0.1",
        **quiet,
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
        return software.found()


class RayPool(WorkerPool[Job, Done]):
    """Actors of a cluster, one CPU each; one that dies is replaced and its job done again."""

    def __init__(self, ray: ModuleType, size: int, work: Work[Job, Done]) -> None:
        """Start the actors.

        Raises:
            ConfigError: a machine of the cluster has other software, whose bytes could differ.
        """
        super().__init__(size, work)
        self._ray = ray
        remote = ray.remote(num_cpus=1, max_restarts=-1, max_task_retries=RETRIES)(RayWorker)
        self._idle += [remote.remote(work.start, str(Path.cwd())) for _ in range(size)]
        own = work.software.found()
        asked = [actor.software.remote(work.software) for actor in self._idle]
        for found in self._get(asked):
            if found != own:
                raise ConfigError(
                    f"a machine of the cluster has {found}, this one {own}; with other"
                    " software the same seed may give other bytes"
                )

    def begin(self, number: int, job: Job) -> None:
        """Give a job to an actor that is free."""
        actor = self._idle.pop()
        self._busy[actor.run.remote(job)] = (actor, number, job)

    def finished(self) -> list[tuple[int, Done]]:
        """Wait for an actor that has ended its job; see `WorkerPool`."""
        ready, _ = self._ray.wait(list(self._busy), num_returns=1)
        results = []
        for reference in ready:
            actor, number, _ = self._busy.pop(reference)
            results.append((number, self._get(reference)))
            self._idle.append(actor)
        return results

    def _get(self, references: Any) -> Any:
        try:
            return self._ray.get(references)
        except self._ray.exceptions.RayTaskError as error:
            cause = error.cause
            raise cause if isinstance(cause, SainError) else SainError(f"Ray: {error}") from error
        except self._ray.exceptions.RayError as error:
            raise SainError(f"Ray: {error}{self._work.after_a_stop}") from error

    def close(self) -> None:
        """End the actors, also in the middle of a job."""
        for actor in self._workers:
            self._ray.kill(actor)
