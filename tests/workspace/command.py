"""Runs commands in an environment of which some variables are changed."""

import os
import subprocess
from pathlib import Path


def run(*command: str | Path, cwd: Path | None = None, **variables: str | None):
    """Runs a command in this environment, with some variables changed or taken out (None)."""
    environment = {**os.environ, **variables}
    environment = {name: value for name, value in environment.items() if value is not None}
    return subprocess.run(
        [str(part) for part in command], cwd=cwd, env=environment, capture_output=True, text=True,
        timeout=60, check=False,
    )  # fmt: skip
