"""Workers of a Ray cluster. Ray is an optional extra: nothing else imports it."""

import importlib
import logging
import os
import secrets
import socket
import tempfile
from collections.abc import Callable, Iterator, Sequence
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
    environment,
)

LOCAL: Final = "local"
AUTO: Final = "auto"
KNOCK_SECONDS: Final = 10.0
RETRIES: Final = 2  # of a job whose worker died
STORE_BYTES: Final = 100_000_000  # for results on their way
TOKEN: Final = secrets.token_hex(32)  # of clusters on this machine
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
                ray.init(**_settings(address, workers, folder))
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
    limits = dict.fromkeys(THREAD_LIMITS, "1")
    return {**silent, **alone, **limits, "RAY_AUTH_TOKEN": TOKEN, "TMPDIR": folder}


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
