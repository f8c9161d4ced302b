"""Is there room in shared memory? Without any, ROS itself dies with SIGBUS and says nothing.

Our own messages do not go through shared memory. But ROS is built with LTTng, which maps a page of
a small file there as soon as a process loads it.
"""

import shutil
from pathlib import Path
from typing import Final

from sain_core.errors import OutputError

SHARED: Final = Path("/dev/shm")
LEAST: Final = 16 << 10  # bytes: two pages, and some for others that start now


def check_shared_memory(folder: Path = SHARED) -> None:
    """Check that a process that uses ROS can start.

    Raises:
        OutputError: shared memory is full, and what helps.
    """
    if not folder.is_dir() or shutil.disk_usage(folder).free >= LEAST:
        return
    raise OutputError(
        f"{folder} is full, and ROS cannot start without a page there; remove what killed"
        f" processes have left, such as {folder}/fastrtps_*, or enlarge it"
    )
