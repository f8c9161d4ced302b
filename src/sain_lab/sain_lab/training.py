"""Trains a network of a laboratory, in a process of its own: one thread, lowest priority.

``python -m sain_lab.training LABORATORY PUSHES`` reads the log as it is, and writes a checkpoint.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Final, Self

from sain_lab.keeping.laboratory import MODELS, Laboratory

LONGEST: Final = 60.0  # [s] of a training
THREADS: Final = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "MKL_NUM_THREADS")


class Training:
    """A training under way."""

    def __init__(self, process: subprocess.Popen[str], laboratory: Path, pushes: int) -> None:
        """Follow this process."""
        self._process, self._laboratory, self.pushes = process, laboratory, pushes
        self.service = f"{MODELS}/{pushes:06d}"

    @classmethod
    def start(cls, laboratory: Laboratory, pushes: int) -> Self:
        """Start to train on the first pushes of a laboratory."""
        command = [sys.executable, "-m", "sain_lab.training", str(laboratory.path), str(pushes)]
        process = subprocess.Popen(
            ["nice", "-n", "19", *command],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | dict.fromkeys(THREADS, "1"),
        )
        return cls(process, laboratory.path, pushes)

    @property
    def running(self) -> bool:
        """Whether it goes on."""
        return self._process.poll() is None

    @property
    def problem(self) -> str:
        """Why there is no network; empty: there is."""
        if self._process.returncode == 0:
            return ""
        _, errors = self._process.communicate()
        return (errors.strip().splitlines() or [f"exit code {self._process.returncode}"])[-1][-300:]

    def wait(self) -> None:
        """Wait for its end."""
        self._process.wait()

    def stop(self) -> None:
        """Stop it; no network is written."""
        if self.running:
            self._process.kill()
        self._process.wait()


def main(path: str, pushes: str) -> int:
    """Train, and return the exit code."""
    sys.stderr.write(f"no network is trained on {pushes} pushes of {path} yet\n")
    return 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
