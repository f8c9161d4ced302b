"""What stands beside a checkpoint: its card, and the settings that it is trained with."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from sain_core.provenance import processor, ros2_command, system, versions
from sain_core.storage import write_whole
from sain_model.data.dataset import Dataset, Split
from sain_model.data.mixed import MixedDataset, MixedSplit
from sain_model.dynamics.checkpoint import ModelCard
from sain_model.dynamics.priors import prior_settings
from sain_model.dynamics.sain import SainDynamics
from sain_model.training.fine_tuning import Parent
from sain_model.training.options import TrainCorrectionOptions, TrainOptions
from sain_model.training.training_loop import LossHistory

PACKAGES: Final = ("sain_model", "torch", "numpy", "numba", "scipy", "safetensors")


@dataclass(frozen=True)
class Learned:
    """What a training gives.

    Attributes:
        sain: the model, with the regions of its predictions.
        history: losses on single pushes.
        rollouts: losses on rollouts afterwards; None: it did not learn from any.
        parent: what it started from; None: new weights.
    """

    sain: SainDynamics
    history: LossHistory
    rollouts: LossHistory | None = None
    parent: Parent | None = None


def make_card(
    command: TrainOptions,
    data: Dataset | MixedDataset,
    split: Split | MixedSplit,
    learned: Learned,
    errors: dict[str, Any],
) -> ModelCard:
    """Return the card of what was trained."""
    config, sain = command.training, learned.sain
    training = {**asdict(config), **_losses(learned.history)}
    if learned.rollouts:
        training["rollouts"] = _losses(learned.rollouts)
    return ModelCard(
        prior=config.prior,
        prior_config=prior_settings(sain.prior),
        network=asdict(config.network),
        friction=asdict(sain.friction) if sain.friction else None,
        intervals=asdict(sain.intervals) if sain.intervals else None,
        kind=sain.kind,
        rollouts=asdict(command.rollout) if sain.recurrent else None,
        data=data_part(command.dataset, data, split),
        training=training,
        errors=errors,
        versions=environment(),
        command=ros2_command("sain_model", "train"),
        parent=learned.parent.about if learned.parent else None,
    )


def data_part(
    paths: Sequence[Path], data: Dataset | MixedDataset, split: Split | MixedSplit
) -> dict[str, Any]:
    """Return what a card says of the data."""
    parts = {"train": split.train, "validation": split.validation, "test": split.test}
    return {
        "path": " ".join(map(str, paths)),
        "sha256": data.sha256,
        "sources": list(data.sources),
        "transitions": {name: len(part) for name, part in parts.items()},
        "episodes": {name: len(np.unique(part.episode)) for name, part in parts.items()},
    }


def _losses(history: LossHistory) -> dict[str, float | None]:
    best = history.best
    losses = {
        "epochs_done": len(history.train),
        "best_epoch": best + 1,  # 0: the weights that it started from
        "train_loss": history.train[best] if best >= 0 else None,
        "validation_loss": history.best_loss,
    }
    return losses if history.start is None else {**losses, "loss_before": history.start}


def environment() -> dict[str, str]:
    """Return versions and machine, as far as they can change a bit of a checkpoint."""
    return {**versions(*PACKAGES), "system": system(), "processor": processor()}


def save_settings(
    executable: str, command: TrainOptions | TrainCorrectionOptions, data: Dataset | MixedDataset
) -> None:
    """Write beside the checkpoint, from the start, what is to be done with what."""
    settings = {
        **asdict(command),
        "data_sha256": data.sha256,
        "environment": environment(),
        "command": ros2_command("sain_model", executable),
    }
    text = json.dumps(settings, indent=2, default=str) + "\n"
    write_whole(command.out / "config.json", text.encode())
