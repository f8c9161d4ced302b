"""Listens to a graph, and prints what keeps it from working."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from time import monotonic
from typing import Any, Final, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.callback_groups import CallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rich.console import Console

from sain_bringup.conditions import LASTS, Conditions, described, show_line
from sain_core.cli.terminal import WaitingLine
from sain_core.errors import SainError
from sain_core.guarding.locks import is_held
from sain_core.guarding.ros.ownership import full_name, lock_name
from sain_core.guarding.untrusted import private_folder
from sain_core.ros.node_main import ERROR, OK, SEPARATOR, command_node, spin_until, steady_timer
from sain_core.ros.qos import RELIABLE
from sain_interfaces.msg import Scene
from sain_model.compute.kernel_store import describe_compilation

LOOK: Final = 0.25  # [s] between looks at the graph
ABSENT: Final = 2.0  # [s], after which a part is missing: discovery takes its time
SILENT: Final = 2.5  # [s] without a scene
PATIENCE: Final = 1.0  # [s] before a line says what is waited for
CAUSE: Final = "cause"  # a figure of warnings that need not last: several pushes showed them
SAIN: Final = "sain"  # `hardware_id` of our own nodes


class Part(NamedTuple):
    """A part of the graph that a command needs, with a topic that it publishes."""

    missing: str
    topic: str
    start: str


PLANNER: Final = Part("no planner in namespace", "plan", "start ros2 run sain_mppi mppi_node")
SCENES: Final = Part(
    "no source of scenes in namespace",
    "scene",
    "start ros2 run sain_sim sim_node, or scene_node where a robot's bodies have poses",
)


class _Untriggered(CallbackGroup):
    """Keeps subscriptions out of what the executor waits for."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        pass


class LatestMessage:
    """Takes the latest message of a topic when it is asked for; none of them wakes the executor."""

    def __init__(self, node: Node, kind: type, topic: str) -> None:
        self._subscription = node.create_subscription(
            kind, topic, print, QoSProfile(depth=1), callback_group=_Untriggered()
        )

    def take(self, raw: bool = False) -> Any:
        """Return what has come since the last look; None: nothing."""
        subscription = self._subscription
        with subscription.handle:
            found = subscription.handle.take_message(subscription.msg_type, raw)
        return None if found is None else found[0]


class SilentError(SainError):
    """A part of the graph is missing, or does not answer."""


class GraphListener:
    """Prints each warning and error of the nodes once, and which part of the graph is missing."""

    def __init__(
        self,
        node: Node,
        show: Callable[[str], None],
        parts: tuple[Part, ...] = (PLANNER, SCENES),
        waiting: Callable[[str], bool] = lambda message: False,
        starts: bool = False,
    ) -> None:
        """Listen from now on.

        Args:
            node: that listens.
            show: prints a line.
            parts: that have to be there.
            waiting: called with each warning of the planner, "" if there is none; returns whether
                it is shown elsewhere.
            starts: whether this command starts the parts; no other graph is the one that is meant.
        """
        self._starts = starts
        self.node, self.parts, self._show, self._waiting = node, parts, show, waiting
        self._conditions = Conditions()
        self._scenes = LatestMessage(node, Scene, "scene") if SCENES in parts else None
        self._scene_at = monotonic()
        self._planner = node.resolve_topic_name("mppi_node")
        diagnostics = self._on_diagnostics
        node.create_subscription(DiagnosticArray, "/diagnostics", diagnostics, RELIABLE)
        steady_timer(node, LOOK, self._look)

    def absence(self, part: Part) -> str:
        """Return the line to print where nothing publishes the topic of a part; "": it is there."""
        node, topic = self.node, self.node.resolve_topic_name(part.topic)
        if node.count_publishers(topic):
            return ""
        missing = f"{part.missing} {node.get_namespace()}"
        if self._starts:
            return f"{missing} yet; wait, or look at its log"
        domain = node.context.get_domain_id()
        if spaces := self._other_namespaces(part):
            return f"{missing}, but one in {spaces[0]}: add --ros-args -r __ns:={spaces[0]}"
        space = node.get_namespace()
        if domains := [other for other in domains_of(space) if other != domain]:
            other = f"but a graph in domain {domains[0]}: export ROS_DOMAIN_ID={domains[0]}"
            return f"{missing} of domain {domain}, {other}"
        return f"{missing}: {part.start}; ROS_DOMAIN_ID is {domain} here"

    def _other_namespaces(self, part: Part) -> list[str]:
        found = self.node.get_topic_names_and_types()
        ours = [name for name, kinds in found if any(kind.startswith(SAIN) for kind in kinds)]
        topics = [name for name in ours if name.endswith(f"/{part.topic}")]
        published = [name for name in topics if self.node.count_publishers(name)]
        return [name.rpartition("/")[0] or "/" for name in published]

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self._report(status)

    def _report(self, status: DiagnosticStatus) -> None:
        node, _, _ = str(status.name).partition(SEPARATOR)
        space, _, name = node.rpartition("/")
        own = space == self.node.get_namespace().rstrip("/")
        if status.hardware_id == SAIN and not own:
            return  # of another graph
        text = "" if status.level == OK else status.message or "reports an error without a text"
        if node == self._planner and self._waiting(text):
            text = ""
        line = text and described(name if own else node, text)
        at_once = status.level == ERROR or any(pair.key == CAUSE for pair in status.values)
        self._conditions.report(status.name, line, 0.0 if at_once else LASTS)

    def _look(self) -> None:
        for part in self.parts:
            self._conditions.report(part.topic, self.absence(part), lasts=ABSENT)
        if self._scenes is not None:
            self._conditions.report("silence", self._silence(self._scenes), lasts=0.0)
        for line in self._conditions.take():
            self._show(line)

    def _silence(self, scenes: LatestMessage) -> str:
        """Return the line for scenes that do not come though a node should publish them."""
        now, topic = monotonic(), self.node.resolve_topic_name(SCENES.topic)
        sources = self.node.get_publishers_info_by_topic(topic)
        if scenes.take(raw=True) is not None or not sources:
            self._scene_at = now
        if now - self._scene_at < SILENT:
            return ""
        names = " and ".join(sorted({full_name(one) for one in sources}))
        return f"no scene on {topic} for 3 s: {names} should publish it; look at its log"


def domains_of(namespace: str) -> list[int]:
    """Return the ROS domains of this computer in which a graph of this user has a namespace."""
    pattern = re.compile(re.escape(lock_name("N", namespace)).replace("N", r"(\d+)", 1))
    found = ((pattern.fullmatch(path.name), path) for path in private_folder().iterdir())
    return sorted(int(match[1]) for match, path in found if match and is_held(path))


class GraphWait:
    """Waits for something in a graph for so long [s], and shows what it waits for."""

    def __init__(
        self, node: Node, console: Console, timeout_s: float, parts: tuple[Part, ...], **more: Any
    ) -> None:
        """Listen with a node; `parts` and `more` are as in `GraphListener`."""
        self.line = WaitingLine(console, PATIENCE)
        self._timeout_s = timeout_s
        self._listener = GraphListener(node, partial(show_line, console), parts, **more)

    def __call__(self, done: Callable[[], bool], what: str) -> None:
        """Spin until something is done; time for compiling kernels is extra.

        Raises:
            SilentError: it did not come in time; with the first part of the graph that is missing.
        """
        listener, timeout_s = self._listener, self._timeout_s
        end = monotonic() + timeout_s
        with self.line:
            while not spin_until(listener.node, done, LOOK):
                if compilation := describe_compilation():
                    end = monotonic() + timeout_s
                elif monotonic() >= end:
                    missing = (listener.absence(part) for part in listener.parts)
                    problem = next(filter(None, missing), f"{what} has not come")
                    raise SilentError(f"{problem} (waited {timeout_s:g} s)")
                more = f": {compilation}" if compilation else f", at most {timeout_s:g} s"
                self.line.say(f"waiting for {what}{more}")


@contextmanager
def listening(name: str, show: Callable[[str], None]) -> Iterator[Callable[[float], None]]:
    """Listen with a node of this name; gives a function that listens for so long [s]."""
    with command_node(name) as node:
        GraphListener(node, show, starts=True)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        try:
            yield lambda seconds: executor.spin_once(timeout_sec=seconds)
        finally:
            executor.shutdown()
