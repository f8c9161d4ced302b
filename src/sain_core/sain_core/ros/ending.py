"""An end within seconds, whatever the middleware does.

Fast DDS was seen to spin for ever while a participant was deleted. It holds the interpreter then,
so no Python code can help, be it a thread or a signal handler. A timer of the system calls
``_exit`` in a thread of its own, with the exit code that the process would have had.
"""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, Protocol, runtime_checkable

PATIENCE: Final = 4.0  # [s] for each part of the end
SIGEV_THREAD: Final = 2  # of <signal.h>
CLOCK_MONOTONIC: Final = 1  # of <time.h>
SIGEVENT_BYTES: Final = 64


class _SigEvent(ctypes.Structure):
    """What a timer does when its time has come: call a function with a value."""

    _fields_ = (
        ("value", ctypes.c_long),
        ("signal", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("rest", ctypes.c_byte * (SIGEVENT_BYTES - 3 * 8)),
    )


class _TimerSpec(ctypes.Structure):
    """An interval [s, ns], and the time until it begins [s, ns]."""

    _fields_ = tuple((name, ctypes.c_long) for name in ("every_s", "every_ns", "in_s", "in_ns"))


@contextmanager
def ending_within(seconds: float = PATIENCE, code: int = 0) -> Iterator[None]:
    """End the process with this exit code where what is done here takes longer [s]."""
    timer = start_timer(seconds, code)
    try:
        yield
    finally:
        ctypes.CDLL(None).timer_delete(timer)


def start_timer(seconds: float, code: int) -> ctypes.c_void_p:
    """Have the system end this process in so many seconds; return the timer.

    Raises:
        OSError: there is no timer left.
    """
    system, timer = ctypes.CDLL(None, use_errno=True), ctypes.c_void_p()
    leave = ctypes.cast(system._exit, ctypes.c_void_p)
    event = _SigEvent(value=code, notify=SIGEV_THREAD, function=leave)
    whole, part = divmod(round(1e9 * seconds), 1_000_000_000)
    spec = _TimerSpec(in_s=whole, in_ns=part)
    if system.timer_create(CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    system.timer_settime(timer, 0, ctypes.byref(spec), None)
    return timer


@runtime_checkable
class Destroyable(Protocol):
    """A node; named so that commands without ROS can import this module."""

    def destroy_node(self) -> None:
        """Give back what the middleware gave."""


def release(node: Destroyable) -> None:
    """Destroy a node of a command whose results are saved."""
    with ending_within():
        node.destroy_node()
