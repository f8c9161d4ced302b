"""Can this computer run ROS? What is missing is said in one line, before ROS dies or waits."""

import os
import shutil
import socket
from pathlib import Path
from typing import Final

from sain_core.errors import OutputError, SainError
from sain_core.ros.network import CLOSED, RANGE

SHARED: Final = Path("/dev/shm")
LEAST: Final = 16 << 10  # bytes: two pages, and some for others that start now
LOOPBACK: Final = "127.0.0.1"


class NoNetworkError(SainError):
    """Nodes cannot reach each other."""


def check_host() -> None:
    """Check that a process that uses ROS can start, and reach others.

    Raises:
        OutputError: shared memory is full.
        NoNetworkError: the loopback interface is down.
    """
    check_shared_memory()
    check_loopback()


def check_shared_memory(folder: Path = SHARED) -> None:
    """Check that there is room: without any, ROS dies with SIGBUS and says nothing.

    Our own messages do not go through shared memory. But ROS is built with LTTng, which maps a page
    of a small file there as soon as a process loads it.

    Raises:
        OutputError: shared memory is full, and what helps.
    """
    if not folder.is_dir() or shutil.disk_usage(folder).free >= LEAST:
        return
    raise OutputError(
        f"{folder} is full, and ROS cannot start without a page there; remove what killed"
        f" processes have left, such as {folder}/fastrtps_*, or enlarge it"
    )


def check_loopback(address: str = LOOPBACK) -> None:
    """Check that nodes can send to each other on this computer, unless the network is opened.

    Raises:
        NoNetworkError: they cannot, and what helps.
    """
    if os.environ.get(RANGE, "") not in CLOSED:
        return
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
            own.bind((address, 0))
            own.sendto(b"", own.getsockname())
    except OSError as error:
        raise NoNetworkError(
            f"nodes talk over {address}, which cannot be used here: {error.strerror}; run"
            " `sudo ip link set lo up`, or start the container with a network"
        ) from error
