"""How long calls take, measured side by side."""

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Shortest:
    """Shortest times of a call [s]."""

    wall: float
    processor: float
    """of all cores together: hardly depends on who else uses the machine"""


def fastest(works: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, Shortest]:
    """Return the shortest times of each, taken in turns; the first is not counted."""
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in works}
    for _ in range(repeats + 1):
        for name, work in works.items():
            begun, used = time.perf_counter(), time.process_time()
            work()
            times[name].append((time.perf_counter() - begun, time.process_time() - used))
    return {name: Shortest(*np.min(values[1:], axis=0)) for name, values in times.items()}


@contextmanager
def one_core() -> Iterator[None]:
    """Let this process, and those that it starts, have one core."""
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)
