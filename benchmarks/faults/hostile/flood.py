"""Floods the nodes with hostile messages over DDS, from another process, and counts."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from benchmarks.faults.hostile.entries import Entry
from sain_core.errors import ErrorCode
from sain_core.ros.node_main import node_of
from sain_interfaces import action, msg

QUIET_S: Final = 2.0  # without anything new, before the counts are final
PATIENT_S: Final = 20.0  # likewise, where it is known how much is to come
PATIENCE_S: Final = 60.0
AT_ONCE: Final = 1000  # calls of a service


@dataclass
class Flood:
    """What became of the messages to one entry."""

    sent: int = 0
    arrived: int | None = None
    answered: int | None = None
    accepted: int = 0


class Flooder(Node):
    """Sends, hears the answers, and asks a node by its diagnostics what arrived."""

    def __init__(self, target: str, depth: int) -> None:
        """Send to this node, with queues of this length."""
        super().__init__("flooder", namespace="/sain")
        self.qos = QoSProfile(depth=depth)
        self.latched = QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._target = target
        self._values: dict[str, str] = {}
        self.results: list[int] = []  # codes of pushes
        self.pushes = 0  # that the planner sent
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, self.qos)
        self.create_subscription(msg.PushResult, "push_result", self._on_result, self.qos)
        if target == "mppi_node":
            self.create_subscription(msg.Push, "push", self._on_push, self.qos)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        for status in array.status:
            if node_of(status) == f"/sain/{self._target}":
                self._values = {value.key: value.value for value in status.values}

    def _on_result(self, result: msg.PushResult) -> None:
        self.results.append(result.error_code)

    def _on_push(self, push: msg.Push) -> None:
        self.pushes += 1

    def arrived(self, name: str) -> int | None:
        """Return how many messages the node's callback was called with; None: it does not say."""
        value = self._values.get(f"received_{name}")
        return None if value is None else int(value)

    def _since(self, entry: Entry, before: int) -> int | None:
        now = self.arrived(entry.name)
        return None if now is None else now - before

    def spin_while(self, busy: Callable[[], object]) -> None:
        """Handle what comes in while something is so, but not for ever."""
        end = time.monotonic() + PATIENCE_S
        while busy() and time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.05)

    def settle(self, look: Callable[[], object], enough: object = None) -> None:
        """Handle what comes in until something is enough, or has not changed for a while."""
        seen, since = look(), time.monotonic()
        quiet = QUIET_S if enough is None else PATIENT_S

        def changing() -> bool:
            nonlocal seen, since
            if (now := look()) != seen:
                seen, since = now, time.monotonic()
            return seen != enough and time.monotonic() - since < quiet

        self.spin_while(changing)

    def flood(self, entry: Entry, messages: Iterator[Any]) -> Flood:
        """Send messages to one entry as fast as possible; wait for what comes of them."""
        if entry.kind is action.Reach:
            return self._flood_action(entry, messages)
        if hasattr(entry.kind, "Request"):
            return self._flood_service(entry, messages)
        return self._flood_topic(entry, messages)

    def _flood_topic(self, entry: Entry, messages: Iterator[Any]) -> Flood:
        publisher = self.create_publisher(entry.kind, entry.name, self.latched)
        self.spin_while(lambda: not publisher.get_subscription_count())
        before, flood = self.arrived(entry.name) or 0, Flood()
        self.results.clear()
        self.pushes = 0
        for message in messages:
            flood.sent += 1
            if entry.name == "push":
                message.push_id = time.monotonic_ns()
            publisher.publish(message)
        all_came = (before + flood.sent, flood.sent) if entry.name == "push" else None
        self.settle(lambda: (self.arrived(entry.name), len(self.results)), all_came)
        flood.arrived = self._since(entry, before)
        flood.accepted = self.pushes
        if entry.name == "push":
            flood.answered = len(self.results)
            flood.accepted = self.results.count(ErrorCode.OK)
        self.destroy_publisher(publisher)
        return flood

    def _flood_service(self, entry: Entry, messages: Iterator[Any]) -> Flood:
        client = self.create_client(entry.kind, entry.name, qos_profile=self.qos)
        self.spin_while(lambda: not client.service_is_ready())
        before, flood = self.arrived(entry.name) or 0, Flood(answered=0)
        while batch := list(islice(messages, AT_ONCE)):
            futures = [client.call_async(message) for message in batch]
            flood.sent += len(futures)
            self._await(futures)
            self._count(flood, futures)
        self.settle(lambda: self.arrived(entry.name), before + flood.sent)
        flood.arrived = self._since(entry, before)
        self.destroy_client(client)
        return flood

    def _flood_action(self, entry: Entry, messages: Iterator[Any]) -> Flood:
        profiles = {
            f"{part}_service_qos_profile": self.qos for part in ("goal", "result", "cancel")
        }
        client = ActionClient(self, entry.kind, entry.name, **profiles)
        self.spin_while(lambda: not client.server_is_ready())
        before, flood = self.arrived(entry.name) or 0, Flood(answered=0)
        while batch := list(islice(messages, AT_ONCE)):
            futures = [client.send_goal_async(message) for message in batch]
            flood.sent += len(futures)
            self._await(futures)
            handles = [future.result() for future in futures if future.done()]
            accepted = [handle for handle in handles if handle.accepted]
            results = [handle.get_result_async() for handle in accepted]
            flood.answered = (flood.answered or 0) + len(handles) - len(accepted)
            self._await(results, known=False)
            for handle, future in zip(accepted, results, strict=True):
                if not future.done():  # one that can be served is still being planned for
                    handle.cancel_goal_async()
            self._await(results)
            wrapped = [future.result().result for future in results if future.done()]
            flood.answered += len(wrapped)
            flood.accepted += sum(result.error_code == ErrorCode.OK for result in wrapped)
        self.settle(lambda: self.arrived(entry.name), before + flood.sent)
        flood.arrived = self._since(entry, before)
        client.destroy()
        return flood

    def _count(self, flood: Flood, futures: list[Any]) -> None:
        done = [future.result() for future in futures if future.done()]
        flood.answered = (flood.answered or 0) + len(done)
        flood.accepted += sum(answer.error_code == ErrorCode.OK for answer in done)

    def _await(self, futures: list[Any], known: bool = True) -> None:
        """Wait for answers; `known` says whether all must come."""
        self.settle(lambda: sum(one.done() for one in futures), len(futures) if known else None)

    def close(self) -> None:
        """Stop."""
        self._executor.shutdown()
        self.destroy_node()
