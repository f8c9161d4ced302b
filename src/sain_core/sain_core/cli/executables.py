"""Where the executables of packages are."""

import os
from pathlib import Path

from sain_core.errors import ConfigError


def executable(package: str, name: str) -> Path:
    """Return the file that ``ros2 run PACKAGE NAME`` starts.

    Raises:
        ConfigError: it is not installed.
    """
    prefixes = [p for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    for prefix in prefixes:
        path = Path(prefix, "lib", package, name)
        if os.access(path, os.X_OK):
            return path
    raise ConfigError(
        f"{package} {name} is not installed under AMENT_PREFIX_PATH; run inside ./env, or source"
        " the workspace's install/setup.bash"
    )
