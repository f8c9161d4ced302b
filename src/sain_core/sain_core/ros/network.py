"""Can this computer run ROS, and which others can send to a node? By default none."""

import os
import shutil
import socket
from importlib.resources import files
from pathlib import Path
from typing import Final

from sain_core.errors import OutputError, SainError

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
    os.environ[PROFILES[0]] = str(files("sain_core.ros") / "loopback.xml")
    os.environ.setdefault(FROM_PROFILE, "1")
    os.environ[RANGE] = "SYSTEM_DEFAULT"  # with any other, ROS replaces the transports of a profile


class NoNetworkError(SainError):
    """Nodes cannot reach each other."""


def check_host() -> None:
    """Check that a process that uses ROS can start, and reach others; raise `SainError`."""
    check_shared_memory()
    check_loopback()


def check_shared_memory(folder: Path = SHARED) -> None:
    """Check that there is room: without any, ROS dies with SIGBUS and says nothing.

    Our own messages do not go through shared memory. But ROS is built with LTTng, which maps a page
    of a small file there as soon as a process loads it.
    """
    if not folder.is_dir() or shutil.disk_usage(folder).free >= LEAST:
        return
    raise OutputError(
        f"{folder} is full, and ROS cannot start without a page there; remove what killed"
        f" processes have left, such as {folder}/fastrtps_*, or enlarge it"
    )


def check_loopback(address: str = LOOPBACK) -> None:
    """Check that nodes can send to each other on this computer, unless the network is opened."""
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
