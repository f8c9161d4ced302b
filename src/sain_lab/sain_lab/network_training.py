"""Trains a network of a laboratory: the residual of the believed physics, in a process of its own.

``python -m sain_lab.network_training LABORATORY PUSHES`` has one thread and the lowest
priority, and ends with its standard input, so with the process that started it. It reads the log as
it is, and writes a checkpoint. An episode's other pushes show its friction, as in
``sain_model train``. The network sees places and headings in the world, which the shipped one does
not: on few pushes most of what physics leaves depends on them. An ensemble of small networks, each
on episodes drawn with replacement, keeps to what many pushes agree on.
"""

import hashlib
import os
import resource
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from itertools import islice
from pathlib import Path
from threading import Thread
from typing import Any, Final, Self

import numpy as np

from sain_core.errors import SainError
from sain_lab.physics import observed
from sain_lab.storage.laboratory import Laboratory, service_of
from sain_lab.storage.results import Result
from sain_model.data.dataset import Dataset, Part, split_by_episode
from sain_model.dynamics.load import save_checkpoint
from sain_model.dynamics.sain import weights_of
from sain_model.inference.kinds import Kind, read_belief
from sain_model.network.settings import (
    BOOTSTRAP,
    PLANAR,
    PLANAR_AXES,
    WORLD_FRAME,
    NetworkConfig,
    require_torch,
)
from sain_model.training.settings import TrainingConfig, TrainOptions

LONGEST: Final = 60  # [s] of processor time; a training that takes longer is ended
MOST_PUSHES: Final = 3000  # the latest, that are learned from
STEPS: Final = 1200  # of the optimizer
MOST_EPOCHS: Final = 60
MEMBERS: Final = 8
BATCH: Final = 64  # pushes
PATIENCE: Final = 25  # epochs
VALIDATION: Final = 0.2  # of the episodes
NICE: Final = 19
THREADS: Final = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "MKL_NUM_THREADS")


class Training:
    """A training under way."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process

    @classmethod
    def start(cls, laboratory: Laboratory, pushes: int) -> Self:
        """Start to train on so many pushes of a laboratory."""
        words = str(laboratory.path), str(pushes)
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


def train(laboratory: Laboratory, pushes: int) -> Path:
    """Train on so many pushes of a laboratory; return the checkpoint.

    Raises `SainError`: too few episodes, or the laboratory is damaged.
    """
    require_torch("training a network")
    from sain_model.training.fit import fit, make_card

    kind = replace(read_belief(laboratory.belief_path).likeliest, corrected=True)
    data = data_of(latest(laboratory, pushes))
    config = settings(kind, len(data))
    split = split_by_episode(data, config.seed, config.validation, 0.0)
    with tempfile.TemporaryDirectory() as state:
        model, histories = fit(split, kind, config, Path(state))
    path = laboratory.model_path(service_of(pushes))
    options = TrainOptions(dataset=(laboratory.path,), out=path.parent, training=config)
    card = make_card(options, data, split, model, histories, {})
    save_checkpoint(path, weights_of(model), card)
    return path


def settings(kind: Kind, pushes: int) -> TrainingConfig:
    """Return the settings of a training on so many pushes."""
    network = NetworkConfig(hidden=32, message=16, features=WORLD_FRAME, members=MEMBERS)
    return TrainingConfig(
        prior=PLANAR_AXES if kind.has_axes else PLANAR,
        epochs=min(max(STEPS * BATCH // pushes, 1), MOST_EPOCHS),
        patience=PATIENCE,
        batch=BATCH,
        weight_decay=1.0,
        validation=VALIDATION,
        test=0.0,
        diversity=BOOTSTRAP,
        network=network,
        position_scale=0.0002,
        heading_scale=0.01,
    )


def latest(laboratory: Laboratory, pushes: int) -> list[Result]:
    """Return the latest of the first pushes of a laboratory, of bodies without a name."""
    found: deque[Result] = deque(maxlen=MOST_PUSHES)
    for record in islice(_pushes(laboratory), pushes):
        result = Result.of_record(record)
        if not result.object:
            found.append(result)
    return list(found)


def _pushes(laboratory: Laboratory) -> Iterable[dict[str, object]]:
    return (record for record in laboratory.records() if record["kind"] == "push")


def data_of(results: list[Result]) -> Dataset:
    """Return results as a data set to train on."""
    digest = hashlib.sha256("".join(one.digest for one in results).encode()).hexdigest()
    parts = []
    for some in observed(results)[0]:
        unknown, nothing = np.full(len(some), np.nan), np.full(some.state.shape, np.nan)
        about: dict[str, Any] = vars(replace(some, noise=None))
        about |= {"friction": unknown, "floor_next": nothing, "step": np.arange(len(some))}
        parts.append(Part(**about, physics_next=some.state))  # no prediction is needed
    return Dataset(tuple(parts), digest)


def _end_with_input() -> None:
    """Wait for the end of standard input, and end this process."""
    sys.stdin.buffer.read()
    os._exit(1)


def main(path: str, pushes: str) -> int:
    """Train, and return the exit code."""
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST))
    Thread(target=_end_with_input, daemon=True).start()
    try:
        train(Laboratory(Path(path)), int(pushes))
    except SainError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
