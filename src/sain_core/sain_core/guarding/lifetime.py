"""The life of a process that uses ROS: it can start, tells that it lives, and ends in time."""

import ctypes
import os
import shutil
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from sain_core.errors import OutputError, SainError

SOCKET: Final = "NOTIFY_SOCKET"
TIMEOUT: Final = "WATCHDOG_USEC"  # after so long without a heartbeat the process counts as hung
BEATS: Final = 4  # heartbeats in that time, as `bond` has it by default
READY: Final = b"READY=1"
ALIVE: Final = b"WATCHDOG=1"
STOPPING: Final = b"STOPPING=1\nSTATUS="  # followed by what is done meanwhile


def heartbeat_period() -> float:
    """Return the time between two heartbeats [s]; 0: nobody waits for any."""
    timeout = os.environ.get(TIMEOUT, "")
    return int(timeout) * 1e-6 / BEATS if timeout.isdecimal() and SOCKET in os.environ else 0.0


def ready() -> None:
    """Tell that the process has started."""
    _send(READY)


def alive() -> None:
    """Tell that the process lives."""
    _send(ALIVE)


def stopping(doing: str) -> None:
    """Tell that the process is about to end, and what it does until then."""
    _send(STOPPING + doing.encode())


def _send(word: bytes) -> None:
    address = os.environ.get(SOCKET, "")
    if not address:
        return
    if address.startswith("@"):  # an abstract address: it is in no folder
        address = "\0" + address[1:]
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
        sender.setblocking(False)  # a supervisor that does not listen stops nobody
        sender.sendto(word, address)


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
    """Have the system end this process in so many seconds; return the timer."""
    system, timer = ctypes.CDLL(None, use_errno=True), ctypes.c_void_p()
    leave = ctypes.cast(system._exit, ctypes.c_void_p)
    event = _SigEvent(value=code, notify=SIGEV_THREAD, function=leave)
    whole, part = divmod(round(1e9 * seconds), 1_000_000_000)
    spec = _TimerSpec(in_s=whole, in_ns=part)
    if system.timer_create(CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    system.timer_settime(timer, 0, ctypes.byref(spec), None)
    return timer


def release(node: Any) -> None:
    """Destroy a node of a command whose results are saved."""
    with ending_within():
        node.destroy_node()


RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES: Final = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
FROM_PROFILE: Final = "RMW_FASTRTPS_USE_QOS_FROM_XML"  # also how memory is used, not QoS alone
CLOSED: Final = ("", "LOCALHOST")
FAST_DDS: Final = ("", "rmw_fastrtps_cpp", "rmw_fastrtps_dynamic_cpp")
SHARED: Final = Path("/dev/shm")
LEAST: Final = 16 << 10  # bytes: two pages, and some for others that start now
LOOPBACK: Final = "127.0.0.1"


def stay_on_this_host() -> None:
    """Bind all sockets of this process, and of its children, to 127.0.0.1; before `rclpy.init`.

    ROS's own LOCALHOST only stops nodes from looking for others: their sockets accept packets from
    any computer. Another value of ``ROS_AUTOMATIC_DISCOVERY_RANGE``, such as SUBNET, opens the
    network. Profiles of the user's own are left as they are, and so is other middleware.
    """
    if os.environ.get(RANGE, "") not in CLOSED or any(map(os.environ.get, PROFILES)):
        return
    if os.environ.get("RMW_IMPLEMENTATION", "") not in FAST_DDS:
        os.environ[RANGE] = "LOCALHOST"
        return
    os.environ[PROFILES[0]] = str(files("sain_core.guarding") / "loopback.xml")
    os.environ.setdefault(FROM_PROFILE, "1")
    os.environ[RANGE] = "SYSTEM_DEFAULT"  # with any other, ROS replaces the transports of a profile


class NoNetworkError(SainError):
    """Nodes cannot reach each other."""


def check_host() -> None:
    """Check that a process that uses ROS can start, and reach others; raise `SainError`."""
    check_shared_memory()
    check_loopback()


def check_shared_memory() -> None:
    """Check that there is room: without any, ROS dies with SIGBUS and says nothing.

    Our own messages do not go through shared memory. But ROS is built with LTTng, which maps a page
    of a small file there as soon as a process loads it.
    """
    if not SHARED.is_dir() or shutil.disk_usage(SHARED).free >= LEAST:
        return
    raise OutputError(
        f"{SHARED} is full, and ROS cannot start without a page there; remove what killed"
        f" processes have left, such as {SHARED}/fastrtps_*, or enlarge it"
    )


def check_loopback() -> None:
    """Check that nodes can send to each other on this computer, unless the network is opened."""
    if os.environ.get(RANGE, "") not in CLOSED:
        return
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
            own.bind((LOOPBACK, 0))
            own.sendto(b"", own.getsockname())
    except OSError as error:
        raise NoNetworkError(
            f"nodes talk over {LOOPBACK}, which cannot be used here: {error.strerror}; run"
            " `sudo ip link set lo up`, or start the container with a network"
        ) from error
