"""Whatever is sent to a node is counted and answered, and no error in it ends the node.

The one place where an exception of a callback becomes a code and a message. What is larger than
`sain_core.guarding.ros.reception` allows is refused before the callback sees it.
"""

import inspect
import re
import traceback
from collections.abc import Awaitable, Callable
from concurrent.futures import Future
from dataclasses import dataclass
from time import monotonic
from typing import Any, Final, TypeVar

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.service_introspection import ServiceIntrospectionState
from rclpy.subscription import Subscription

from sain_core.errors import ErrorCode, InvalidInputError, SainError, TooMuchWorkError, error_reply
from sain_core.guarding.untrusted import LONGEST_NAME, MOST_BODIES, MOST_CORNERS, MOST_PARTS

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


LONGEST_TEXT: Final = 256  # characters, of a frame, a source or the name of a world
LONGEST_PATH: Final = 4096  # as Linux has it
LONGEST_ERROR: Final = 4096  # characters
MOST_SUPPORTS: Final = 256  # of a body
MOST_NUMBERS: Final = 2**26  # of one array: half a gigabyte

TEXTS: Final = {
    "name": LONGEST_NAME,
    "role": LONGEST_NAME,
    "shapes": LONGEST_NAME,
    "roles": LONGEST_NAME,
    "model": LONGEST_PATH,
    "error_message": LONGEST_ERROR,
}
"""Characters of a text, or of each text of an array; all others: `LONGEST_TEXT`."""

COUNTS: Final = {
    "bodies": MOST_BODIES,
    "disks": MOST_BODIES,
    "shapes": 1024,  # what the parameter max_disks may be
    "roles": 1024,
    "poses": MOST_BODIES,
    "keep": MOST_BODIES,
    "parts": MOST_PARTS,
    "points": MOST_CORNERS,
    "supports": MOST_SUPPORTS,
    "dimensions": 3,
}
"""Elements of an array; all others: `MOST_NUMBERS`."""

VALUES: Final = {"samples": 2**20, "batch": 2**20, "horizon": 1024, "past": 200}
"""Dimensions that a request states: K, B, H and P."""

SEQUENCE: Final = re.compile(r"sequence<(.+?)(?:, \d+)?>")
NUMERIC: Final = re.compile(r"u?int\d+|float|double|boolean|octet|char")
TEXT: Final = re.compile(r"w?string.*")


def check_sizes(message: Any) -> None:
    """Check every text, array and stated dimension of a message, also of those within it.

    Raises:
        InvalidInputError: a text that is too long, or an array with too many elements.
        TooMuchWorkError: a dimension of a request that is too large.
    """
    for name, kind, element in _fields_of(message):
        _check_field(name, getattr(message, name), kind, element)


def emptied(message: Any) -> Any:
    """Return a message with every text and array emptied that is too large, in place."""
    for name, kind, _ in _fields_of(message):
        if kind == "message":
            emptied(getattr(message, name))
        elif kind != "value":
            try:
                _check_field(name, getattr(message, name), kind, "number")
            except InvalidInputError:
                setattr(message, name, "" if kind == "text" else [])
    return message


def shortened(text: str) -> str:
    """Return an error's text, or the beginning of one that is too long and how long it was."""
    if len(text) <= LONGEST_ERROR:
        return text
    end = f" ... ({len(text)} characters)"
    return text[: LONGEST_ERROR - len(end)] + end


_fields: dict[type, list[tuple[str, str, str]]] = {}  # by class of message


def _fields_of(message: Any) -> list[tuple[str, str, str]]:
    """Return name, kind and kind of the elements of the fields that have a size."""
    if (fields := _fields.get(type(message))) is None:
        fields = _fields[type(message)] = []
        for name, kind in message.get_fields_and_field_types().items():
            if match := SEQUENCE.fullmatch(kind):
                fields.append((name, "array", _kind(match[1])))
            elif name in VALUES:
                fields.append((name, "value", ""))
            elif _kind(kind) != "number":
                fields.append((name, _kind(kind), ""))
    return fields


def _kind(kind: str) -> str:
    if TEXT.fullmatch(kind):
        return "text"
    return "number" if NUMERIC.match(kind) else "message"


def _check_field(name: str, value: Any, kind: str, element: str) -> None:
    if kind == "message":
        check_sizes(value)
    elif kind == "value":
        if value > VALUES[name]:
            raise TooMuchWorkError(f"{name} is {value}; at most {VALUES[name]} are accepted")
    else:
        texts = kind == "text"
        most = TEXTS.get(name, LONGEST_TEXT) if texts else COUNTS.get(name, MOST_NUMBERS)
        if len(value) > most:
            what = "characters" if texts else "elements"
            raise InvalidInputError(f"{name} has {len(value)} {what}; at most {most} are accepted")
        for one in value if element in ("text", "message") else ():
            _check_field(name, one, element, "")


LINGER: Final = 3.0  # [s] that a problem is shown after the last bad message, and good ones since
REPEAT: Final = 10.0  # [s] between two lines of the log on one topic while its messages are bad

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


@dataclass
class _Ignored:
    """What was wrong with the messages of a topic, and when [s] the last came and was logged."""

    text: str
    came: float
    logged: float


class Reception:
    """Takes what is sent to one node. Make and call it on the executor's thread."""

    def __init__(self, node: Node) -> None:
        """Take nothing yet."""
        self._node = node
        self._received: dict[str, int] = {}
        self._defects = 0
        self._last_trace = ""
        self._ignored: dict[str, _Ignored] = {}  # by topic

    @property
    def trouble(self) -> str:
        """What is wrong with messages that are ignored, in words; empty: nothing."""
        return "; ".join(one.text for one in self._ignored.values())

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
    ) -> Subscription:
        """Subscribe; `refuse` answers a message that is too large or that fails the callback.

        Without it, such a message is ignored: logged once, and shown as `trouble`.
        """
        handle = self.guarded(topic, callback, refuse or self._ignore(topic))
        return self._node.create_subscription(kind, topic, handle, qos)

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
            else:
                self._forgive(name)

        return take

    def _forgive(self, topic: str) -> None:
        before = self._ignored.get(topic)
        if before is not None and monotonic() > before.came + LINGER:
            del self._ignored[topic]

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
        def ignore(_: Any, error: BaseException) -> None:
            now, text = monotonic(), f"a message on {topic} is ignored: {shortened(str(error))}"
            before = self._ignored.get(topic)
            repeats = before is not None and now < before.logged + REPEAT
            if not repeats:
                self._node.get_logger().warning(text)
            logged = before.logged if before is not None and repeats else now
            self._ignored[topic] = _Ignored(text, now, logged)

        return ignore
