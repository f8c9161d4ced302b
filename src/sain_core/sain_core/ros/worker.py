"""Work that must not block the executor: one thread, with the outcome handed back to the node."""

from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from queue import SimpleQueue
from time import monotonic
from typing import Any, Final, TypeVar

from rclpy.node import Node

from sain_core.guarding import lifetime

LOOK: Final = 0.25  # [s] between looks at a job that is waited for
PATIENCE: Final = 60.0  # [s] that a job may take while the executor waits for it

T = TypeVar("T")
Outcome = tuple["Future[Any]", Callable[["Future[Any]"], object]]


class _Turn:
    """Lets a coroutine wait until the executor has seen to something else."""

    def __await__(self) -> Generator[None, None, None]:
        yield


class Worker:
    """Runs jobs one after another on a thread of its own, which is always the same one.

    What follows a job is called on the executor's thread like any callback, so that a node's
    state belongs to that thread alone.
    """

    def __init__(self, node: Node, name: str) -> None:
        """Start the thread."""
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix=name)
        self._outcomes: SimpleQueue[Outcome] = SimpleQueue()
        self._node = node
        self._before = node.create_timer(0.001, self._begin)  # a job may end before the node spins
        self._pending: set[Future[Any]] = set()
        self._closed = self._ended = False

    def submit(self, job: Callable[[], T], then: Callable[["Future[T]"], object]) -> None:
        """Run a job; call `then` with its future, done, on the executor's thread."""
        future = self._pool.submit(job)
        self._pending.add(future)
        future.add_done_callback(lambda done: self._finished(done, then))

    async def run(self, job: Callable[[], T]) -> T:
        """Run a job, with the executor free meanwhile; return its result.

        For callbacks that are coroutines, in a reentrant group: in another kind, the first one
        bars all others until it is done.
        """
        future = self._pool.submit(job)
        self._pending.add(future)
        future.add_done_callback(self._wake)
        while not future.done():
            await _Turn()
        self._pending.discard(future)
        try:
            return future.result()
        finally:
            del future  # else its error and this frame keep each other, and what the job was given

    @property
    def pending(self) -> int:
        """How many jobs were submitted and are not seen to yet."""
        return len(self._pending)

    def call(self, job: Callable[[], T]) -> T:
        """Run a job and wait for it: for short ones that the executor cannot go on without."""
        return self.wait(job).result()

    def wait(
        self, job: Callable[[], T], meanwhile: Callable[[], None] = lambda: None
    ) -> "Future[T]":
        """Run a job and wait for it, as `call`; return its future, done, whether well or not.

        `meanwhile` is called on this thread, a few times a second.
        """
        future = self._pool.submit(job)
        enough = monotonic() + PATIENCE
        while not wait([future], lifetime.heartbeat_period() or LOOK).done:
            meanwhile()
            if monotonic() < enough:  # the executor waits, and lives
                lifetime.alive()
        return future

    def drop(self) -> None:
        """Drop what has not begun, and do not call what follows any job."""
        self._closed = True
        for future in self._pending:
            future.cancel()

    def close(self, last: Callable[[], None] | None = None) -> None:
        """Drop what has not begun, wait for what has, then run one last job on the thread."""
        if self._ended:
            return
        self._ended = True
        self.drop()
        if last is not None:
            self.call(last)
        self._pool.shutdown(wait=True)

    def _finished(self, future: "Future[Any]", then: Callable[["Future[Any]"], object]) -> None:
        if not self._closed:
            self._outcomes.put((future, then))
            if (executor := self._node.executor) is not None:
                executor.create_task(self._hand_back)

    def _wake(self, _: "Future[Any]") -> None:
        if not self._closed and (executor := self._node.executor) is not None:
            executor.wake()

    def _begin(self) -> None:
        self._before.cancel()
        self._hand_back()

    def _hand_back(self) -> None:
        while not self._outcomes.empty():
            future, then = self._outcomes.get()
            self._pending.discard(future)
            then(future)
