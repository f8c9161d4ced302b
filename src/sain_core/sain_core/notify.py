"""Tells who supervises this process that it is ready, and again and again that it lives.

The protocol is systemd's, sd_notify(3): datagrams to the socket that ``NOTIFY_SOCKET`` names. So a
node can also be run as a systemd service with ``WatchdogSec=``. It needs no middleware: a flood of
messages delays no heartbeat. Without the variable nothing is sent.
"""

import os
import socket
from contextlib import suppress
from typing import Final

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


def is_supervised() -> bool:
    """Tell whether somebody listens."""
    return bool(os.environ.get(SOCKET))


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
