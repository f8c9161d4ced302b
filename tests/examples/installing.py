"""A package of `examples/`, installed as its README says, for processes of a test only."""

import json
import os
import subprocess
import sys
from pathlib import Path
from shutil import copytree, ignore_patterns
from typing import Any

from tests.paths import ROOT


def install(name: str, folder: Path) -> dict[str, str]:
    """Install a package of `examples/` in a folder; return the variables of processes with it."""
    package, site = folder / "build", folder / "site"
    copytree(ROOT / "examples" / name, package, ignore=ignore_patterns("__pycache__"))
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


EACH = """
import contextlib, io, json, sys
from sain_core.cli.program import main
said = {}
for name, arguments in json.load(sys.stdin).items():
    error = io.StringIO()
    with contextlib.redirect_stderr(error):
        try:
            code = main(arguments)
        except SystemExit as end:
            code = end.code
    said[name] = [code, error.getvalue()]
json.dump(said, sys.__stdout__)
"""


def outcomes(environment: dict[str, str], commands: dict[str, list[str]]) -> dict[str, Any]:
    """Run commands of ``sain`` in one process; return the exit code and the error of each."""
    done = subprocess.run(
        [sys.executable, "-c", EACH],
        env=environment,
        input=json.dumps(commands),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    said = json.loads(done.stdout.splitlines()[-1])
    return {name: (code or 0, error) for name, (code, error) in said.items()}


def refusals(environment: dict[str, str], commands: dict[str, list[str]]) -> dict[str, str]:
    """Run commands of ``sain`` that fail, in one process; return the error of each."""
    said = outcomes(environment, commands)
    assert [name for name, (code, _) in said.items() if code == 0] == []
    return {name: " ".join(text.replace("│", " ").split()) for name, (_, text) in said.items()}
