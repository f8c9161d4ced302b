"""Workers with something to do, and the order in which their results come."""

import os
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Final, Generic

from sain_core.workers.work import Done, Job, Work

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
