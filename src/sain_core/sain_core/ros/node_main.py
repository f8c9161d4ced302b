"""What every node has: its process, timers, latched topics, and its state on ``/diagnostics``.

A status is named ``node: task``, as diagnostic_updater names it, so aggregators can group by node.
"""

import ctypes
import gc
import logging
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Final, NoReturn

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import ROSInterruptException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import ok, try_shutdown

from sain_core.errors import INTERRUPTED, ConfigError, SainError
from sain_core.guarding import lifetime
from sain_core.guarding.lifetime import ending_within, release, stay_on_this_host
from sain_core.ros.parameters import check_parameter_files
from sain_core.ros.qos import RELIABLE

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
SEPARATOR: Final = ": "  # of node and task

SIMULATED: Final = Parameter("use_sim_time", value=True)
"""``parameter_overrides=[SIMULATED]`` makes a node whose stamps are simulated time."""


def steady_timer(node: Node, period_s: float, callback: Callable[[], None]) -> None:
    """Call back once in each period [s] of wall time, whatever ``use_sim_time`` is."""
    node.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))


class Diagnostics:
    """Publishes the state of one node. Make and call it from the executor's thread."""

    def __init__(
        self,
        node: Node,
        task: str,
        period_s: float = 1.0,
        now: Callable[[], Time] | None = None,
        more: Callable[[], Mapping[str, object]] = dict,
    ) -> None:
        """Report for this node's task, first as starting.

        `now` replaces its clock for the stamps; `more` are figures as they are when published.
        """
        self._more = more
        self._values: Mapping[str, object] = {}
        self._now = now or (lambda: node.get_clock().now().to_msg())
        name = f"{node.get_fully_qualified_name()}{SEPARATOR}{task}"
        self._status = DiagnosticStatus(level=OK, name=name, message="starting", hardware_id="sain")
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", RELIABLE)
        steady_timer(node, period_s, self.publish)

    def set(self, level: bytes, message: str, **values: object) -> None:
        """Say how the node is doing, with figures of interest."""
        changed = (level, message) != (self._status.level, self._status.message)
        self._status.level = level
        self._status.message = message
        self._values = values
        if changed:
            self.publish()

    def publish(self) -> None:
        """Publish the state as it was last set."""
        values = {**self._values, **self._more()}
        self._status.values = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
        message = DiagnosticArray(status=[self._status])
        message.header.stamp = self._now()
        self._publisher.publish(message)


def node_of(status: DiagnosticStatus) -> str:
    """Return the full name of the node that a status is of."""
    return str(status.name).partition(SEPARATOR)[0]


NAMESPACE = "sain"
"""Where nodes live unless ``--ros-args -r __ns:=/other`` says otherwise."""

RCL_SOURCE = re.compile(r", at /\S+:\d+")
"""Where in its own source an error of rcl was raised: of no use to the reader."""

SPIN = 0.05
"""[s] between looks at what is waited for."""

MMAP_THRESHOLD, MMAP_BYTES = -3, 4 << 20
TRIM_THRESHOLD, TRIM_BYTES = -1, 16 << 20
ARENA_MAX, ARENAS = -8, 1
"""What mallopt(3) takes. By itself glibc keeps memory of up to 64 MB once that much was freed, in
each of several arenas: the threads of the middleware have their own.
"""
TRIM_PERIOD = 5.0
"""[s] after which free pages are returned, which takes less than 0.1 ms."""

TURN: Final = 0.5
"""[s], the longest wait for an event."""

GRACE: Final = 1.0
"""[s] that a callback has after Ctrl-C, until it is interrupted: what it has taken is not lost."""

INTERRUPTS = (ExternalShutdownException, ROSInterruptException)


def run_node(make_node: Callable[[], Node], name: str) -> int:
    """Run a node until it is interrupted; return the process's exit code: 130 during its start.

    When it has started, its attribute ``ready`` is logged, if it has one. Its end may take as long
    as its attribute ``patience`` says [s].

    A mistake in the settings or the start is reported in one line on standard error: 1. An error
    later on is a defect and leaves its traceback.
    """
    node = None
    code = INTERRUPTED
    give_memory_back()
    spins = False

    def on_interrupt(number: int, frame: FrameType | None) -> None:
        """Let a callback end before a second Ctrl-C and `GRACE`: rcl itself ends the spinning."""
        signal.signal(signal.SIGALRM, signal.default_int_handler)
        if not spins or signal.setitimer(signal.ITIMER_REAL, GRACE)[0]:
            signal.default_int_handler(number, frame)

    try:
        signal.signal(signal.SIGINT, on_interrupt)  # rcl's handler, which comes next, calls it
        with ros_context(SignalHandlerOptions.ALL):
            executor = executor_of(make_node)
            try:
                node = make_node()
                gc.freeze()  # or else a full collection stops the node: with PyTorch for 160 ms
                executor.add_node(node)
                code = 0
                if ready := getattr(node, "ready", ""):
                    node.get_logger().info(f"ready: {ready}")
                lifetime.ready()
                trim_memory(node)
                if (period := lifetime.heartbeat_period()) > 0.0:
                    steady_timer(node, period, lifetime.alive)
                spins = True
                spin(executor)
            except Exception as error:
                if ok() and not isinstance(error, INTERRUPTS):
                    raise
                # A signal that comes during the start invalidates what is being made: rcl raises.
            finally:
                spins = False
                signal.setitimer(signal.ITIMER_REAL, 0.0)
                with ending_within(getattr(node, "patience", lifetime.PATIENCE), code):
                    if node is not None:
                        node.destroy_node()
                    executor.shutdown()
    except KeyboardInterrupt:
        pass
    except SainError as error:
        sys.stderr.write(f"{name}: {' '.join(str(error).split()) or repr(error)}\n")
        return 1
    return code


def executor_of(make_node: Callable[[], Node]) -> Executor:
    """Return an executor for a node: by events, where its class says that it awaits nothing.

    By events takes a third of the processor time: the other asks all that a node has at each
    message. But what awaits, it tries again and again. And each event stays in line: where images
    come faster than they are looked at, timers come later and later.
    """
    awaits = getattr(make_node, "awaits", True)
    return SingleThreadedExecutor() if awaits else EventsExecutor()


def spin(executor: Executor) -> None:
    """Do what comes until rclpy is shut down."""
    if isinstance(executor, SingleThreadedExecutor):
        executor.spin()
    while ok():  # `EventsExecutor.spin` of rclpy 7.1.6 never calls timers
        executor.spin_once(timeout_sec=TURN)


def give_memory_back() -> None:
    """Have the memory of large messages returned to the system when they are done with."""
    if mallopt := getattr(ctypes.CDLL(None), "mallopt", None):  # of glibc only
        mallopt(MMAP_THRESHOLD, MMAP_BYTES)
        mallopt(TRIM_THRESHOLD, TRIM_BYTES)
        mallopt(ARENA_MAX, ARENAS)


def trim_memory(node: Node) -> None:
    """Have a node return free pages between what is in use, now and then; glibc keeps them."""
    if malloc_trim := getattr(ctypes.CDLL(None), "malloc_trim", None):
        steady_timer(node, TRIM_PERIOD, lambda: malloc_trim(0))


def node_main(make_node: Callable[[], Node], name: str) -> NoReturn:
    """Run a node as a process, and end that process.

    Once the node has released everything, the interpreter is not taken down piece by piece: with
    PyTorch loaded that takes more than a second.
    """
    code = run_node(make_node, name)
    logging.shutdown()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def spin_until(node: Node, done: Callable[[], bool], timeout_s: float) -> bool:
    """Spin a node until something is done; tell whether that was within the time [s]."""
    deadline = time.monotonic() + timeout_s
    while not done():
        if time.monotonic() > deadline:
            return False
        rclpy.spin_once(node, timeout_sec=SPIN)
    return True


@contextmanager
def ros_context(signals: SignalHandlerOptions = SignalHandlerOptions.NO) -> Iterator[None]:
    """Initialise rclpy with the process's arguments, and shut it down at the end.

    Only this computer can send to its nodes: `stay_on_this_host`. Raises `ConfigError`.
    """
    stay_on_this_host()
    check_parameter_files(sys.argv)
    try:
        rclpy.init(signal_handler_options=signals)
    except RuntimeError as error:  # the base of rcl's own errors, which rclpy does not export
        raise ConfigError(RCL_SOURCE.sub("", str(error))) from error
    try:
        yield
    finally:
        try:
            with ending_within():
                try_shutdown()
        except RuntimeError:
            if ok():
                raise
            # rclpy's thread for signals shut the context down between the check and this call.


@contextmanager
def command_node(name: str) -> Iterator[Node]:
    """Give the node of a command that ends by itself, in the graph's namespace."""
    with ros_context():
        node = Node(name, namespace=NAMESPACE)
        try:
            yield node
        finally:
            release(node)
