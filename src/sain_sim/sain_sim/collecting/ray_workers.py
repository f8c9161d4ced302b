"""Episodes on a Ray cluster. Ray is an optional extra: nothing else imports it."""

import functools
import hashlib
import logging
import secrets
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import sain_core
import sain_sim
from sain_core.errors import ConfigError, SainError
from sain_core.provenance import versions
from sain_sim.collecting.episode import EpisodeConfig, EpisodeResult, EpisodeRunner
from sain_sim.collecting.workers import WorkerPool, environment
from sain_sim.world.engines import ENGINES

LOCAL: Final = "local"
AUTO: Final = "auto"
KNOCK_SECONDS: Final = 10.0
RETRIES: Final = 2  # of an episode whose worker died
STORE_BYTES: Final = 100_000_000  # for results on their way; an episode has a few thousand
INSTALL: Final = 'pip install "sain_sim[ray]", or pip install ray'


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
    return {**silent, **alone, "RAY_AUTH_TOKEN": _token(), "TMPDIR": folder}


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


def software(engine: str) -> dict[str, str]:
    """Return what decides about the bytes of an episode in an engine."""
    sources = hashlib.sha256()
    used = [name for name in (ENGINES[engine].module,) if name]
    for package in (sain_core, sain_sim):
        assert package.__file__ is not None
        for path in sorted(Path(package.__file__).parent.rglob("*.py")):
            sources.update(path.read_bytes())
    return {**versions("numpy", "pybullet", *used), "sain": sources.hexdigest()[:12]}


class RayRunner(EpisodeRunner):
    """An `EpisodeRunner` that also tells which software it runs on."""

    def software(self) -> dict[str, str]:
        """Return what decides about the bytes of an episode."""
        return software(self._config.truth.engine)


class RayPool(WorkerPool):
    """Actors of a cluster, one CPU each; one that dies is replaced and its episode run again."""

    def __init__(self, ray: ModuleType, size: int, seed: int, config: EpisodeConfig) -> None:
        """Start the actors.

        Raises:
            ConfigError: a machine of the cluster has other software, whose bytes could differ.
        """
        super().__init__(size)
        self._ray = ray
        remote = ray.remote(num_cpus=1, max_restarts=-1, max_task_retries=RETRIES)(RayRunner)
        self._idle += [remote.remote(seed, config) for _ in range(size)]
        own = software(config.truth.engine)
        for found in self._get([actor.software.remote() for actor in self._idle]):
            if found != own:
                raise ConfigError(
                    f"a machine of the cluster has {found}, this one {own}; with other"
                    " software the same seed may give other bytes"
                )

    def begin(self, episode: int) -> None:
        """Give an episode to an actor that is free."""
        actor = self._idle.pop()
        self._busy[actor.run.remote(episode)] = (actor, episode)

    def finished(self) -> list[tuple[int, EpisodeResult]]:
        """Wait for an actor that has ended its episode; see `WorkerPool`."""
        ready, _ = self._ray.wait(list(self._busy), num_returns=1)
        results = []
        for reference in ready:
            actor, episode = self._busy.pop(reference)
            results.append((episode, self._get(reference)))
            self._idle.append(actor)
        return results

    def _get(self, references: Any) -> Any:
        try:
            return self._ray.get(references)
        except self._ray.exceptions.RayTaskError as error:
            cause = error.cause
            raise cause if isinstance(cause, SainError) else SainError(f"Ray: {error}") from error
        except self._ray.exceptions.RayError as error:
            raise SainError(
                f"Ray: {error}; what is in the folder is whole, and the same command goes on"
            ) from error

    def close(self) -> None:
        """End the actors, also in the middle of an episode."""
        for actor in self._workers:
            self._ray.kill(actor)
