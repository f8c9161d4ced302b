"""Work that must not block the executor: one thread, with the outcome handed back to the node."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from queue import SimpleQueue
from typing import Any, TypeVar

from rclpy.node import Node

T = TypeVar("T")
Outcome = tuple["Future[Any]", Callable[["Future[Any]"], None]]


class Worker:
    """Runs jobs one after another on a thread of its own, which is always the same one.

    What follows a job is called on the executor's thread like any callback, so that a node's
    state belongs to that thread alone.
    """

    def __init__(self, node: Node, name: str) -> None:
        """Start the thread."""
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix=name)
        self._outcomes: SimpleQueue[Outcome] = SimpleQueue()
        self._guard = node.create_guard_condition(self._hand_back)
        self._pending: set[Future[Any]] = set()
        self._closed = False

    def submit(self, job: Callable[[], T], then: Callable[["Future[T]"], None]) -> None:
        """Run a job; call `then` with its future, done, on the executor's thread."""
        future = self._pool.submit(job)
        self._pending.add(future)
        future.add_done_callback(lambda done: self._finished(done, then))

    def call(self, job: Callable[[], T]) -> T:
        """Run a job and wait for it: for short ones that the executor cannot go on without."""
        return self._pool.submit(job).result()

    def close(self, last: Callable[[], None] | None = None) -> None:
        """Drop what has not begun, wait for what has, then run one last job on the thread."""
        if self._closed:
            return
        self._closed = True
        for future in self._pending:
            future.cancel()
        if last is not None:
            self.call(last)
        self._pool.shutdown(wait=True)

    def _finished(self, future: "Future[Any]", then: Callable[["Future[Any]"], None]) -> None:
        if not self._closed:
            self._outcomes.put((future, then))
            self._guard.trigger()

    def _hand_back(self) -> None:
        while not self._outcomes.empty():
            future, then = self._outcomes.get()
            self._pending.discard(future)
            then(future)
