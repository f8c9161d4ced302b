"""Whatever is sent to a node is counted and answered, and no error in it ends the node.

The one place where an exception of a callback becomes a code and a message. What is larger than
`sain_core.ros.limits` allows is refused before the callback sees it.
"""

import inspect
import traceback
from collections.abc import Awaitable, Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.service import Service

from sain_core.errors import ErrorCode, SainError, error_reply
from sain_core.ros.limits import check_sizes, emptied, shortened
from sain_core.ros.qos import SERVICE

T = TypeVar("T")
Refuse = Callable[[Any, BaseException], None]


def outcome(work: Callable[[], T]) -> "Future[T]":
    """Do something; return its future, done, whether well or not."""
    future: Future[T] = Future()
    try:
        future.set_result(work())
    except Exception as error:  # noqa: BLE001 - whoever asks for the outcome sees it
        future.set_exception(error)
    return future


class Reception:
    """Takes what is sent to one node. Make and call it on the executor's thread."""

    def __init__(self, node: Node) -> None:
        """Take nothing yet."""
        self._node = node
        self._received: dict[str, int] = {}
        self._defects = 0
        self._last_trace = ""

    @property
    def figures(self) -> dict[str, int]:
        """What each callback was called with so far, and how many unexpected errors there were."""
        return {f"received_{name}": count for name, count in self._received.items()} | {
            "defects": self._defects
        }

    def listen(
        self,
        kind: type,
        topic: str,
        callback: Callable[[Any], None],
        qos: QoSProfile,
        refuse: Refuse | None = None,
    ) -> None:
        """Subscribe; `refuse` answers a message that is too large or that fails the callback.

        Without it, why the message is ignored is logged.
        """
        handle = self.guarded(topic, callback, refuse or self._ignore(topic))
        self._node.create_subscription(kind, topic, handle, qos)

    def guarded(
        self, name: str, callback: Callable[[Any], None], refuse: Refuse
    ) -> Callable[[Any], None]:
        """Return a callback for messages that lets no error out."""
        self._received[name] = 0

        def take(message: Any) -> None:
            self._received[name] += 1
            try:
                check_sizes(message)
                callback(message)
            except Exception as error:  # noqa: BLE001 - an error is an answer
                self.log_defect(error)
                refuse(message, error)

        return take

    def serve(
        self,
        kind: Any,
        name: str,
        callback: Callable[[Any, Any], Any],
        group: CallbackGroup | None = None,
    ) -> Service:
        """Offer a service; an error becomes the reply's ``error_code`` and ``error_message``."""
        self._received[name] = 0

        async def answer(request: Any, response: Any) -> Any:
            self._received[name] += 1
            try:
                check_sizes(request)
                answered = callback(request, response)
                if inspect.isawaitable(answered):
                    await answered
                response.error_code = int(ErrorCode.OK)
            except Exception as error:  # noqa: BLE001 - an error is an answer
                response.error_code, response.error_message = self.explain(error)
            return response

        return self._node.create_service(
            kind, name, answer, qos_profile=SERVICE, callback_group=group
        )

    def act(
        self,
        name: str,
        execute: Callable[[Any], Awaitable[Any]],
        refuse: Callable[[Any, int, str], Any],
    ) -> Callable[[Any], Awaitable[Any]]:
        """Return what executes an action; `refuse` makes its result of an error's code and text."""
        self._received[name] = 0

        async def run(handle: Any) -> Any:
            self._received[name] += 1
            try:
                check_sizes(handle.request)
                return await execute(handle)
            except Exception as error:  # noqa: BLE001 - an error is an answer
                emptied(handle.request)  # which is kept as long as the result
                return refuse(handle, *self.explain(error))

        return run

    def explain(self, error: BaseException) -> tuple[int, str]:
        """Return code and message for an error; one that should never happen is logged."""
        self.log_defect(error)
        code, message = error_reply(error)
        return code, shortened(message)

    def log_defect(self, error: BaseException) -> None:
        """Leave a trace of what should never happen; a `SainError` tells enough by itself.

        The same one again is only counted.
        """
        if isinstance(error, SainError):
            return
        self._defects += 1
        trace = "".join(traceback.format_exception(error))
        if trace != self._last_trace:
            self._node.get_logger().error(shortened(trace))
        self._last_trace = trace

    def _ignore(self, topic: str) -> Refuse:
        def ignore(message: Any, error: BaseException) -> None:
            text = shortened(str(error))
            self._node.get_logger().error(f"a message on {topic} is ignored: {text}")

        return ignore
