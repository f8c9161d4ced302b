"""Whatever is sent to a node is counted and answered, and no error in it ends the node.

The one place where an exception of a callback becomes a code and a message. A message that is too
large is refused before the callback sees it; `sain_core.wire` checks shapes and numbers.
"""

import inspect
import traceback
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from math import inf
from time import monotonic
from typing import Any, Final, TypeVar

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rclpy.service import Service
from rclpy.service_introspection import ServiceIntrospectionState
from rclpy.subscription import Subscription

from sain_core.errors import ErrorCode, InvalidInputError, SainError, error_reply

SERVICE = QoSProfile(depth=4000)
"""Requests and answers of a service that may be asked faster than it answers. A client that asks
for more than 10 things at once needs such a queue, too."""

STATES: Final = {
    "disabled": ServiceIntrospectionState.OFF,
    "metadata": ServiceIntrospectionState.METADATA,
    "contents": ServiceIntrospectionState.CONTENTS,
}


def introspect(node: Node, service: Service, level: str) -> None:
    """Publish each request and answer on ``<service>/_service_event``, as `STATES` names it."""
    if level != "disabled":
        service.configure_introspection(node.get_clock(), SERVICE, STATES[level])


LONGEST_ERROR: Final = 4096  # characters
MOST_BYTES: Final = 2**20  # of a message, serialized
LARGE_BYTES: Final = 2**29  # of one with an image, or with the scenes of many pushes


def check_size(message: Any, most: int = MOST_BYTES) -> None:
    """Raise `InvalidInputError` for a message that is too large; it is emptied, but for ids."""
    if not _is_surely_within(message, most) and (size := len(serialize_message(message))) > most:
        _empty(message)
        raise InvalidInputError(f"the message has {size} bytes; at most {most} are accepted")


def _is_surely_within(message: Any, most: int) -> bool:
    """Return True where a bound on the size shows it: to serialize 10 MB takes 35 ms."""
    bound, rest = 0, [message]
    while rest and bound <= most:
        value = rest.pop()
        bound += 16  # a number, or a length, with what aligns it
        if isinstance(value, str):
            bound += 4 * len(value)
        elif isinstance(value, list):
            rest += value
        elif hasattr(value, "get_fields_and_field_types"):
            rest += [getattr(value, name) for name in value.get_fields_and_field_types()]
        elif hasattr(value, "__len__"):  # an array of numbers
            bound += memoryview(value).nbytes
    return bound <= most


def _empty(message: Any) -> None:
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if hasattr(value, "get_fields_and_field_types"):
            _empty(value)
        elif "string" in kind or kind.startswith("sequence"):
            setattr(message, name, value[:0])


def shortened(text: str) -> str:
    """Return an error's text, or the beginning of one that is too long and how long it was."""
    if len(text) <= LONGEST_ERROR:
        return text
    end = f" ... ({len(text)} characters)"
    return text[: LONGEST_ERROR - len(end)] + end


LINGER: Final = 3.0  # [s] that a problem is shown after the last bad message, and good ones since

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


def take_waiting(subscription: Subscription) -> None:
    """Call back now with each message that has come; an executor takes one in each of its turns."""
    for _ in range(subscription.qos_profile.depth):
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        if taken is None:
            return
        subscription.callback(taken[0])


class Reception:
    """Takes what is sent to one node. Make and call it on the executor's thread."""

    def __init__(self, node: Node) -> None:
        """Take nothing yet."""
        self._node = node
        self._received: dict[str, int] = {}
        self._defects = 0
        self._last_trace = ""
        self._ignored: dict[str, tuple[str, float]] = {}  # why and when [s] the last was, by topic

    @property
    def trouble(self) -> str:
        """What is wrong with messages that are ignored, in words; empty: nothing."""
        return "; ".join(text for text, _ in self._ignored.values())

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
        most: int = MOST_BYTES,
    ) -> Subscription:
        """Subscribe; `refuse` answers a message over `most` bytes, or that fails the callback.

        Without it, such a message is ignored: the first is logged, and all show as `trouble`.
        """
        handle = self.guarded(topic, callback, refuse, most)
        return self._node.create_subscription(kind, topic, handle, qos)

    def guarded(
        self,
        name: str,
        callback: Callable[[Any], None],
        refuse: Refuse | None = None,
        most: int = MOST_BYTES,
    ) -> Callable[[Any], None]:
        """Return a callback for messages that lets no error out; see `listen`."""
        self._received[name] = 0
        refuse = refuse or self._ignore(name)

        def take(message: Any) -> None:
            self._received[name] += 1
            try:
                check_size(message, most)
                callback(message)
            except Exception as error:  # noqa: BLE001 - an error is an answer
                if not self._node.context.ok():
                    return  # Ctrl-C came within the callback: there is no one to answer any more
                self.log_defect(error)
                refuse(message, error)
            else:
                if monotonic() > self._ignored.get(name, ("", inf))[1] + LINGER:
                    del self._ignored[name]

        return take

    def serve(
        self,
        kind: Any,
        name: str,
        callback: Callable[[Any, Any], Any],
        group: CallbackGroup | None = None,
        most: int = MOST_BYTES,
    ) -> Service:
        """Offer a service; an error becomes the reply's ``error_code`` and ``error_message``.

        A request over `most` bytes is one.
        """
        self._received[name] = 0

        async def answer_later(request: Any, response: Any) -> Any:
            with self._answering(name, response):
                check_size(request, most)
                await callback(request, response)
            return response

        def answer(request: Any, response: Any) -> Any:
            with self._answering(name, response):
                check_size(request, most)
                callback(request, response)
            return response

        take = answer_later if inspect.iscoroutinefunction(callback) else answer
        return self._node.create_service(
            kind, name, take, qos_profile=SERVICE, callback_group=group
        )

    @contextmanager
    def _answering(self, name: str, response: Any) -> Iterator[None]:
        self._received[name] += 1
        try:
            yield
            response.error_code = int(ErrorCode.OK)
        except Exception as error:  # noqa: BLE001 - an error is an answer
            response.error_code, response.error_message = self.explain(error)

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
                check_size(handle.request)  # it is kept as long as the result
                return await execute(handle)
            except Exception as error:  # noqa: BLE001 - an error is an answer
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
        def ignore(_: Any, error: BaseException) -> None:
            text = f"a message on {topic} is ignored: {shortened(str(error))}"
            if topic not in self._ignored:
                self._node.get_logger().warning(text)
            self._ignored[topic] = text, monotonic()

        return ignore
