"""A small file from which a node goes on after a crash, as if nothing had happened."""

import base64
import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, TypeVar

from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.documents import read_json
from sain_core.guarding.untrusted import PARTIAL, is_file

M = TypeVar("M")
MOST_ID: Final = 2**64 - 1  # in messages
ANEW: Final = "remove it to begin anew"
PATIENCE: Final = 10.0  # [s], for subscribers that may be gone for good


class StateFile:
    """Holds the latest state of one node, in JSON: messages as base64 of their CDR.

    It outlives the process, not the machine: nothing waits until it is on the disk.
    """

    def __init__(self, node: Node, path: str) -> None:
        """Keep the state of a node at this path; empty: nowhere."""
        self._node = node
        self._path = Path(path) if path else None

    def __bool__(self) -> bool:
        """Tell whether the state is kept at all."""
        return self._path is not None

    def __str__(self) -> str:
        """Return its path."""
        return str(self._path or "nothing")

    def read(self) -> dict[str, Any]:
        """Return what was written last, if anything.

        Raises `DatasetError`: it is not such a file; `OutputError`: it is a link, a device or a
        folder.
        """
        if self._path is None or not is_file(self._path):
            return {}
        try:
            state = read_json(self._path)
        except (OSError, UntrustedFileError) as error:
            raise DatasetError(
                f"{self._path} is not the state of a node: {error}; {ANEW}"
            ) from error
        if not isinstance(state, dict):
            raise DatasetError(f"{self._path} is not the state of a node: it is no object; {ANEW}")
        return state

    @contextmanager
    def decoding(self) -> Iterator[None]:
        """Turn errors of decoding what was read into a `DatasetError` with the path."""
        try:
            yield
        except KeyError as error:
            raise DatasetError(f"{self._path} is damaged: it has no {error}; {ANEW}") from error
        except (DatasetError, OverflowError, TypeError, ValueError) as error:
            raise DatasetError(f"{self._path} is damaged: {error}; {ANEW}") from error

    def write(self, **state: Any) -> None:
        """Replace the state by what JSON can hold; a full disk is reported, and stops nothing."""
        if self._path is None:
            return
        partial = self._path.with_name(f".{self._path.name}.{os.getpid()}{PARTIAL}")
        try:
            is_file(self._path)  # what is none is never replaced
            self._path.parent.mkdir(parents=True, exist_ok=True)
            partial.unlink(missing_ok=True)
            with partial.open("x", encoding="utf-8") as file:
                json.dump(state, file)
            partial.replace(self._path)
        except OSError as error:
            self._node.get_logger().error(
                f"a crash now would lose the state: cannot write {self._path}:"
                f" {error.strerror or error}",
                throttle_duration_sec=10.0,
            )


def id_in(state: Mapping[str, Any], name: str) -> int:
    """Return an id or a count of a state; raises `ValueError` where it is none."""
    value = int(state[name])
    if not 0 <= value <= MOST_ID:
        raise ValueError(f"{name} is {value}; allowed: 0 to {MOST_ID}")
    return value


def text_of(message: Any) -> str:
    """Return a message as text."""
    return base64.b64encode(serialize_message(message)).decode("ascii")


def message_of(kind: type[M], text: Any) -> M:
    """Return the message that a text holds; raises `DatasetError`: it holds none."""
    try:
        message: M = deserialize_message(base64.b64decode(str(text), validate=True), kind)
    except Exception as error:  # rclpy's own errors have no common base
        raise DatasetError(f"no message of type {kind.__name__}: {error}") from error
    return message


class Subscribers:
    """Waits until a topic has as many subscribers as before a crash."""

    def __init__(self, node: Node, topic: str, before: int) -> None:
        """Wait for so many; 0: for none."""
        self._node, self._topic, self._missing = node, node.resolve_topic_name(topic), before
        self._latest = time.monotonic() + PATIENCE

    def count(self) -> int:
        """Return how many there are now."""
        return int(self._node.count_subscribers(self._topic))

    def complete(self) -> bool:
        """Return True if all are back, or have had their time."""
        if self._missing and (count := self.count()) < self._missing:
            if time.monotonic() <= self._latest:
                return False
            self._node.get_logger().warning(
                f"continues with {count} of {self._missing} subscribers of {self._topic}"
            )
        self._missing = 0
        return True
