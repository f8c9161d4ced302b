"""Pools of workers that run the episodes of a collection.

Results come back in order, so that what is written does not depend on the pool.
"""

import logging
import multiprocessing
import os
import signal
import sys
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from multiprocessing import connection
from typing import Any, Final, NamedTuple

from sain_core.errors import SainError
from sain_sim.collecting.episode import EpisodeConfig, EpisodeResult, EpisodeRunner

AHEAD: Final = 8  # episodes a worker may be ahead of the one that is waited for
LIVES: Final = 3  # workers that an episode may cost before the collection stops

log = logging.getLogger(__name__)


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


class WorkerPool(ABC):
    """Workers, each of which runs one episode at a time."""

    def __init__(self, size: int) -> None:
        """Begin without workers; there are to be so many."""
        self.size = size
        self._idle: list[Any] = []
        self._busy: dict[Any, tuple[Any, int]] = {}  # by what is waited for: worker and episode

    @property
    def free(self) -> int:
        """How many workers have nothing to do."""
        return len(self._idle)

    @property
    def _workers(self) -> list[Any]:
        return [*self._idle, *(worker for worker, _ in self._busy.values())]

    @abstractmethod
    def begin(self, episode: int) -> None:
        """Give an episode to a worker that is free."""

    @abstractmethod
    def finished(self) -> list[tuple[int, EpisodeResult]]:
        """Wait until there are episodes that have ended, and return them.

        Raises:
            SainError: one cannot be run, or ends every worker that tries.
        """

    @abstractmethod
    def close(self) -> None:
        """End the workers, also in the middle of an episode."""


def in_order(pool: WorkerPool, episodes: range) -> Iterator[EpisodeResult]:
    """Run episodes on a pool; yield their results in order."""
    waiting = deque(episodes)
    done: dict[int, EpisodeResult] = {}
    for wanted in episodes:
        while wanted not in done:
            while waiting and pool.free and waiting[0] < wanted + AHEAD * pool.size:
                pool.begin(waiting.popleft())
            done.update(pool.finished())
        yield done.pop(wanted)


class _Worker(NamedTuple):
    process: Any  # a spawned process
    pipe: connection.Connection


class ProcessPool(WorkerPool):
    """Processes of this machine; one that dies is replaced and its episode is run again."""

    def __init__(self, size: int, seed: int, config: EpisodeConfig) -> None:
        """Start so many processes for a collection with this seed."""
        super().__init__(size)
        self._context = multiprocessing.get_context("spawn")
        self._arguments = (seed, config)
        self._deaths: Counter[int] = Counter()
        self._idle += [self._start() for _ in range(size)]

    def begin(self, episode: int) -> None:
        """Give an episode to a process that is free."""
        worker = self._idle.pop()
        self._busy[worker.pipe] = (worker, episode)
        with suppress(BrokenPipeError):  # it died while idle: `finished` will see
            worker.pipe.send(episode)

    def finished(self) -> list[tuple[int, EpisodeResult]]:
        """Wait for processes that have ended an episode; see `WorkerPool`."""
        results = []
        for pipe in connection.wait(list(self._busy)):
            worker, episode = self._busy.pop(pipe)
            try:
                answer = worker.pipe.recv()
            except (EOFError, ConnectionResetError):
                self._replace(worker, episode)
                continue
            self._idle.append(worker)
            if isinstance(answer, SainError):
                raise answer
            results.append((episode, answer))
        return results

    def _replace(self, worker: _Worker, episode: int) -> None:
        """Give the episode of a worker that died to a new one."""
        worker.pipe.close()
        worker.process.join()
        self._deaths[episode] += 1
        code = worker.process.exitcode
        if self._deaths[episode] == LIVES:
            raise SainError(
                f"episode {episode} ended {LIVES} workers, the last with exit code {code}; what is"
                " in the folder is whole, and the same command goes on from there"
            )
        log.warning("a worker died (exit code %s); episode %d is run again", code, episode)
        self._idle.append(self._start())
        self.begin(episode)

    def _start(self) -> _Worker:
        pipe, its_end = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(its_end, *self._arguments))
        process.start()
        its_end.close()  # so that a worker's death closes the pipe
        return _Worker(process, pipe)

    def close(self) -> None:
        """End the processes, also in the middle of an episode."""
        for worker, _ in self._busy.values():
            worker.process.terminate()
        for worker in self._workers:
            worker.pipe.close()  # ends the idle ones
            worker.process.join()


def _serve(pipe: connection.Connection, seed: int, config: EpisodeConfig) -> None:
    """Run the episodes that come through a pipe until it closes, as it does when its owner dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the owner, who ends us
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # clears up
    runner = EpisodeRunner(seed, config)
    with suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            pipe.send(_result(runner, pipe.recv()))


def _result(runner: EpisodeRunner, episode: int) -> EpisodeResult | SainError:
    try:
        return runner.run(episode)
    except SainError as error:
        return error
