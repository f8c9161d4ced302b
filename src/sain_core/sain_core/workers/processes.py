"""Workers that are processes of this machine."""

import logging
import multiprocessing
import os
import signal
import sys
from collections import Counter
from collections.abc import Callable
from contextlib import closing, suppress
from multiprocessing import connection
from threading import Thread
from time import sleep
from typing import Any, Final, NamedTuple

from sain_core.errors import SainError
from sain_core.workers.pool import THREAD_LIMITS, WorkerPool, environment
from sain_core.workers.work import Done, Job, Runner, Work

LIVES: Final = 3  # workers that a job may cost before the work stops
GRACE: Final = 5.0  # [s] for a worker to clear up when its owner has died

log = logging.getLogger(__name__)


class _Worker(NamedTuple):
    process: Any  # a spawned process
    pipe: connection.Connection


class ProcessPool(WorkerPool[Job, Done]):
    """Processes of this machine; one that dies is replaced and its job is done again."""

    def __init__(self, size: int, work: Work[Job, Done]) -> None:
        """Start so many processes."""
        super().__init__(size, work)
        self._context = multiprocessing.get_context("spawn")
        self._deaths: Counter[int] = Counter()
        self._idle += [self._start() for _ in range(size)]

    def begin(self, number: int, job: Job) -> None:
        """Give a job to a process that is free."""
        worker = self._idle.pop()
        self._busy[worker.pipe] = (worker, number, job)
        with suppress(BrokenPipeError):  # it died while idle: `finished` will see
            worker.pipe.send(job)

    def finished(self) -> list[tuple[int, Done]]:
        """Wait for processes that have ended a job; see `WorkerPool`."""
        results = []
        for pipe in connection.wait(list(self._busy)):
            worker, number, job = self._busy.pop(pipe)
            try:
                answer = worker.pipe.recv()
            except (EOFError, ConnectionResetError):
                self._replace(worker, number, job)
                continue
            self._idle.append(worker)
            if isinstance(answer, SainError):
                raise answer
            results.append((number, answer))
        return results

    def _replace(self, worker: _Worker, number: int, job: Job) -> None:
        """Give the job of a worker that died to a new one."""
        worker.pipe.close()
        worker.process.join()
        self._deaths[number] += 1
        code, name = worker.process.exitcode, self._work.name(job)
        if self._deaths[number] == LIVES:
            raise SainError(
                f"{name} ended {LIVES} workers, the last with exit code"
                f" {code}{self._work.after_a_stop}"
            )
        log.warning("a worker died (exit code %s); %s is run again", code, name)
        self._idle.append(self._start())
        self.begin(number, job)

    def _start(self) -> _Worker:
        pipe, its_end = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(its_end, self._work.start))
        with environment(dict.fromkeys(THREAD_LIMITS, "1")):  # read once, when a worker starts
            process.start()
        its_end.close()  # so that a worker's death closes the pipe
        return _Worker(process, pipe)

    def close(self) -> None:
        """End the processes, also in the middle of a job."""
        for worker, _, _ in self._busy.values():
            worker.process.terminate()
        for worker in self._workers:
            worker.pipe.close()  # ends the idle ones
            worker.process.join()


def _serve(pipe: connection.Connection, start: Callable[[], Runner[Any, Any]]) -> None:
    """Do the jobs that come through a pipe until it closes, as it does when its owner dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the owner, who ends us
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())  # clears up
    Thread(target=_end_with_owner, daemon=True).start()
    with closing(start()) as runner, suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            pipe.send(_result(runner, pipe.recv()))


def _end_with_owner() -> None:
    """End this process, also in the middle of a job, as soon as its owner has ended."""
    owner = multiprocessing.parent_process()
    if owner is not None:
        owner.join()
        os.kill(os.getpid(), signal.SIGTERM)
        sleep(GRACE)
        os._exit(1)


def _result(runner: Runner[Any, Any], job: Any) -> Any:
    try:
        return runner.run(job)
    except SainError as error:
        return error
