"""Starts many executables for the price of one: a server imports what all need, and forks.

``with Starter() as starter: starter.start(path, "--help")`` runs the file at a path as Python
would, in a process of its own with its own arguments, variables, output and exit code.
"""

import json
import os
import runpy
import subprocess
import sys
import traceback
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, Self

from tests.paths import ROOT


@dataclass(frozen=True)
class Ended:
    """A process that has ended."""

    returncode: int
    stdout: str
    stderr: str
    modules: frozenset[str]  # the top-level modules that it had imported


class Starter:
    """The server, as a test sees it."""

    def __enter__(self) -> Self:
        command = [sys.executable, "-m", "tests.workspace.starter"]
        self._server = subprocess.Popen(
            command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._server.communicate(timeout=20)

    def start(self, path: Path, *arguments: str, **variables: str) -> Ended:
        """Run a file to its end."""
        assert self._server.stdin is not None and self._server.stdout is not None
        request = {"command": [str(path), *arguments], "variables": variables}
        self._server.stdin.write(json.dumps(request) + "\n")
        self._server.stdin.flush()
        answer = json.loads(self._server.stdout.readline())
        return Ended(**answer | {"modules": frozenset(answer["modules"])})


def serve() -> None:
    """Answer requests, one a line, until there are no more."""
    import numpy  # noqa: F401 - what every executable imports before it reads its arguments
    import tyro  # noqa: F401

    import sain_core.cli.command_line  # noqa: F401

    for line in sys.stdin:
        print(json.dumps(run(**json.loads(line))), flush=True)


def run(command: list[str], variables: dict[str, str]) -> dict[str, Any]:
    """Run a command in a fork and return what came of it."""
    with TemporaryFile("w+") as out, TemporaryFile("w+") as err, TemporaryFile("w+") as modules:
        child = os.fork()
        if child == 0:
            be(command, variables, out, err, modules)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        for file in (out, err, modules):
            file.seek(0)
        return {
            "returncode": code, "stdout": out.read(), "stderr": err.read(),
            "modules": json.loads(modules.read()),
        }  # fmt: skip


def be(
    command: list[str], variables: dict[str, str], out: IO[str], err: IO[str], modules: IO[str]
) -> None:
    """Become the command; never returns."""
    code: Any = 1
    with open(os.devnull) as nothing:  # noqa: PTH123
        os.dup2(nothing.fileno(), 0)
    os.dup2(out.fileno(), 1)
    os.dup2(err.fileno(), 2)
    os.environ.update(variables)
    sys.argv = command
    try:
        runpy.run_path(command[0], run_name="__main__")
        code = 0
    except SystemExit as end:
        code = end.code or 0
    except Exception:  # noqa: BLE001 - told, as Python would tell it
        traceback.print_exc()
    finally:
        json.dump(sorted({name.partition(".")[0] for name in sys.modules}), modules)
        for stream in (sys.stdout, sys.stderr, modules):
            stream.flush()
        os._exit(code if isinstance(code, int) else 1)


if __name__ == "__main__":
    serve()
