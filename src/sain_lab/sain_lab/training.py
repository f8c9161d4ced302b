"""A training of a laboratory's network, in a process of its own: one thread, lowest priority.

The process ends with the one that started it, however that ends (`sain_lab.network_training`).
"""

import os
import subprocess
import sys
from typing import Final, Self

from sain_lab.storage.laboratory import Laboratory

NICE: Final = 19
THREADS: Final = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "MKL_NUM_THREADS")


class Training:
    """A training under way."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process

    @classmethod
    def start(cls, laboratory: Laboratory, since: int, pushes: int) -> Self:
        """Start to train on the pushes of a laboratory behind the first, up to a number."""
        words = str(laboratory.path), str(since), str(pushes)
        command = [sys.executable, "-m", "sain_lab.network_training", *words]
        process = subprocess.Popen(
            ["nice", "-n", str(NICE), *command],
            stdin=subprocess.PIPE,  # which ends with this process
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | dict.fromkeys(THREADS, "1"),
        )
        return cls(process)

    @property
    def running(self) -> bool:
        """Whether it goes on."""
        return self._process.poll() is None

    @property
    def problem(self) -> str:
        """Why there is no network; empty: there is."""
        _, errors = self._process.communicate()
        if (code := self._process.returncode) == 0:
            return ""
        ended = f"the training ended with code {code}"
        return (errors.strip().splitlines() or [ended])[-1][-300:]

    def wait(self) -> None:
        """Wait for its end."""
        self._process.wait()

    def stop(self) -> None:
        """Stop it; no network is written."""
        if self.running:
            self._process.kill()
        self._process.communicate()
