"""How long kernels take to compile, pushes to predict, and plans to make."""

import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from tempfile import TemporaryDirectory
from typing import Final

from benchmarks.gates.table import Gate
from benchmarks.report import Figure
from benchmarks.speed import planar_prior, planner, service_path
from benchmarks.timing import Shortest
from sain_model.dynamics.load import load_shipped

NOISE: Final = 0.1  # share of a time that two runs may differ by
RATIOS: Final = (("defaults", "1.33"), ("K = 1024, H = 15", "1.18"))
LATENCIES: Final = {"anywhere": 50.0, "push_t": 62.0, "rearrange_4": 150.0}  # [ms], p95
EPISODES: Final = 4


def measure() -> list[Gate]:
    """Measure on this machine, which should do nothing else."""
    return [*kernels(), *priors(), *plans(), *service()]


def kernels() -> list[Gate]:
    """Compile all kernels from nothing, on one core."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    with TemporaryDirectory() as folder, one_core():
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        command = [sys.executable, "-m", "sain_model.cli.kernels"]
        subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=True)
    now = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime
    name = "kernels from nothing, processor time"
    return [Gate(name, seconds, "s", "92", at_most=35.0, slack=NOISE)]


@contextmanager
def one_core() -> Iterator[None]:
    """Let processes that are started meanwhile have one core."""
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


def priors() -> list[Gate]:
    """Measure the prior on one core."""
    options = planar_prior.Options()
    return [
        rate("two disks", planar_prior.prior_time(options, 1), "172,000", 120_000),
        rate("a T", planar_prior.bodies_time(options, ("t",), 1), "half of 171,000", 85_500),
        rate(
            "three polygons",
            planar_prior.bodies_time(options, ("t", "l", "u"), 1),
            "half of 123,000",
            61_500,
        ),
    ]


def rate(bodies: str, push: Shortest, before: str, at_least: float) -> Gate:
    """Return the gate of pushes in a second of processor time."""
    return Gate(
        f"prior on one core, {bodies}",
        1.0 / push.processor,
        "pushes/s",
        before,
        at_least=at_least,
        slack=NOISE,
        more_is_better=True,
    )


def plans() -> list[Gate]:
    """Measure a default plan beside the floor of its network's products."""
    figures = planner.phases(load_shipped(), planner.Options())
    whole, over = figures[0], figures[-1]
    return [
        Gate("default plan", whole.value, "ms", "31", slack=NOISE),
        Gate("default plan / floor of products", over.value, "", "11", at_most=6.0, slack=NOISE),
    ]


def service() -> list[Gate]:
    """Measure plans behind the node beside those in process; starts a node."""
    figures = service_path.service_and_process(service_path.Options(scenes=4, repeats=6))
    pairs = zip(figures[2::3], RATIOS, strict=True)
    title = "plan behind its node / in process"
    return [
        Gate(f"{title}, {name}", ratio.value, "", before, at_most=1.15, slack=0.05)
        for ratio, (name, before) in pairs
    ]


def measure_graph() -> list[Gate]:
    """Measure from the settled scene to the push on the whole graph, in real time."""
    gates = []
    for scenario, most in LATENCIES.items():
        episodes = EPISODES if scenario != "rearrange_4" else 2
        p95 = slowest(service_path.closed_loop(scenario, episodes, real_time=True))
        name = f"{scenario}: settled scene to push, p95"
        gates.append(Gate(name, p95, "ms", f"{most:g}", at_most=most, slack=NOISE))
    return gates


def slowest(figures: list[Figure]) -> float:
    """Return the 95th percentile of the latency among median and p95 of each time."""
    pairs = zip(figures[::2], figures[1::2], strict=True)
    return next(p95.value for median, p95 in pairs if service_path.LATENCY in median.name)
