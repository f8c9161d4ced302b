"""How long kernels take to compile, pushes to predict, and plans to make."""

import os
import resource
import subprocess
import sys
from tempfile import TemporaryDirectory
from typing import Final

from benchmarks.gates.table import Gate
from benchmarks.speed import planar_prior, planner, service_path
from benchmarks.timing import Shortest, one_core
from sain_model.dynamics.load import load_shipped

NOISE: Final = 0.1  # share of a time that two runs may differ by
PLANS: Final = ("defaults", "K = 1024, H = 15")


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
    return [Gate(name, seconds, "s", at_most=35.0, slack=NOISE)]


def priors() -> list[Gate]:
    """Measure the prior on one core."""
    options = planar_prior.Options()
    return [
        rate("two disks", planar_prior.prior_time(options, 1), 120_000),
        rate("a T", planar_prior.bodies_time(options, ("t",), 1), 85_500),
        rate(
            "three polygons",
            planar_prior.bodies_time(options, ("t", "l", "u"), 1),
            61_500,
        ),
    ]


def rate(bodies: str, push: Shortest, at_least: float) -> Gate:
    """Return the gate of pushes in a second of processor time."""
    return Gate(
        f"prior on one core, {bodies}",
        1.0 / push.processor,
        "pushes/s",
        at_least=at_least,
        slack=NOISE,
        more_is_better=True,
    )


def plans() -> list[Gate]:
    """Measure a default plan beside the floor of its network's products."""
    figures = planner.phases(load_shipped(), planner.Options())
    whole, over = figures[0], figures[-1]
    return [
        Gate("default plan", whole.value, "ms", slack=NOISE),
        Gate("default plan / floor of products", over.value, "", at_most=6.0, slack=NOISE),
    ]


def service() -> list[Gate]:
    """Measure plans behind the node beside those in process; starts a node."""
    figures = service_path.service_and_process(service_path.Options(scenes=4, repeats=6))
    pairs = zip(figures[2::3], PLANS, strict=True)
    title = "plan behind its node / in process"
    return [
        Gate(f"{title}, {name}", ratio.value, "", at_most=1.15, slack=0.05) for ratio, name in pairs
    ]
