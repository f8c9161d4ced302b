"""A package of `examples/`, installed as its README says, for processes of a test only."""

import os
import subprocess
import sys
from pathlib import Path
from shutil import copytree, ignore_patterns

from tests.paths import ROOT


def install(name: str, folder: Path) -> dict[str, str]:
    """Install a package of `examples/` below a folder, as `install_folder`."""
    build = folder / "build"
    copytree(ROOT / "examples" / name, build, ignore=ignore_patterns("__pycache__"))
    return install_folder(build, folder / "site")


def install_folder(package: Path, site: Path) -> dict[str, str]:
    """Install the package in a folder; return the variables of processes that find it."""
    flags = ["--no-deps", "--no-build-isolation", "--no-index", "--quiet", "--target", str(site)]
    pip = [sys.executable, "-m", "pip", "install", *flags, str(package)]
    subprocess.run(pip, check=True, capture_output=True, text=True)
    paths = [str(site), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths)), "COLUMNS": "200"}


def run(environment: dict[str, str], command: list[str], *arguments: object) -> str:
    """Run a command that succeeds; return what it prints."""
    done = subprocess.run(
        [*command, *map(str, arguments)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


def fails(environment: dict[str, str], command: list[str], *arguments: object) -> str:
    """Run a command that fails without a traceback; return its error."""
    done = subprocess.run(
        [*command, *map(str, arguments)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0, done.stdout
    assert "Traceback" not in done.stderr, done.stderr
    return " ".join(done.stderr.replace("│", " ").split())
