"""How a result was made: command, commit, versions and machine; and the format of files."""

import os
import platform
import shlex
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

DISTRIBUTION: Final = "sain"
UNKNOWN: Final = "unknown"
FORMAT: Final = "0.2"
"""Of models, beliefs and laboratories; another with every change of what is in them, or means."""


def other_format(found: object, remedy: str = "") -> str:
    """Return what is wrong with a file of a format, and what to do; empty: it is this version's."""
    if found == FORMAT:
        return ""
    return f"has format {found!r}; this version reads {FORMAT!r}" + (remedy and f": {remedy}")


def provenance() -> dict[str, str]:
    """Return what a recording or a data set states about how it was made."""
    return {
        "command": command(),
        "commit": git_commit(),
        "version": _version(DISTRIBUTION),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
    }


def command() -> str:
    """Return the command line of this process, without the folder of the program."""
    return shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])


def ros2_command(package: str, executable: str) -> str:
    """Return the command line that starts this process again, by way of `ros2 run`."""
    return shlex.join(["ros2", "run", package, executable, *sys.argv[1:]])


def git_commit() -> str:
    """Return the commit of this source tree, "-dirty" added when files differ from it.

    "unknown" outside a repository, or without git.
    """
    commit = _git("rev-parse", "HEAD")
    if commit is None:
        return UNKNOWN
    return f"{commit}-dirty" if _git("status", "--porcelain", "-uno") else commit


def versions(*packages: str) -> dict[str, str]:
    """Return the version of Python and of packages; "unknown" for one that is not installed."""
    return {"python": platform.python_version(), **{name: _version(name) for name in packages}}


def system() -> str:
    """Return the operating system, its release and the machine's architecture."""
    return f"{platform.system()} {platform.release()} {platform.machine()}"


def processor() -> str:
    """Return the processor's model and the number of cores."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    name = names[0] if names else platform.processor() or UNKNOWN
    return f"{name}, {os.cpu_count()} cores"


def _git(*arguments: str) -> str | None:
    folder = str(Path(__file__).resolve().parent)
    try:
        command = ["git", "-C", folder, *arguments]
        return subprocess.check_output(
            command, text=True, timeout=5.0, stderr=subprocess.DEVNULL
        ).strip()
    except (OSError, subprocess.SubprocessError):
        return None


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return UNKNOWN
