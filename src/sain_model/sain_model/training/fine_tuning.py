"""Fine-tuning: a checkpoint goes on learning, in a world that it was not trained for.

What a checkpoint is stays: its network and what that sees, the prior under it and how it infers
friction. The weights move, and the regions of its predictions are fitted anew. Its own weights
are a candidate like those of every epoch: where nothing that was learned does better on the
validation episodes, they are kept.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self

import numpy as np

from sain_core.errors import CheckpointError, ConfigError, DatasetError
from sain_core.push import pushed_bodies
from sain_core.randomness import bootstrap_ratio, generator
from sain_core.scene import POSITION, TARGET
from sain_core.types import Scalars
from sain_model.data.dataset import Dataset, Part
from sain_model.dynamics.checkpoint import SUFFIX, ModelCard, parse_card
from sain_model.dynamics.load import card_part, load_checkpoint, shipped_checkpoint
from sain_model.dynamics.residual import module_of
from sain_model.dynamics.sain import PARAMETER_CORRECTION, RECURRENT, SainDynamics
from sain_model.dynamics.settings import SHIPPED
from sain_model.evaluation.errors import position_errors
from sain_model.evaluation.predictors import step_with_history
from sain_model.training.settings import (
    DEFAULT,
    EPISODE,
    NOTHING,
    LossConfig,
    TrainingConfig,
    TrainOptions,
)

KEPT: Final = ("prior", "prior_friction", "history")  # and its network: weights fit no others
DEFAULTS: Final = TrainingConfig(epochs=100, batch=64, validation=0.2)
"""For fewer rows than most are trained on: smaller batches, more epochs, and more of the episodes
to choose the best by; docs/guides/training.md tells what was tried."""


@dataclass(frozen=True)
class Parent:
    """A checkpoint to start from."""

    name: str  # that it was asked for by
    sain: SainDynamics
    card: ModelCard

    @classmethod
    def load(cls, name: str) -> Self:
        """Read a checkpoint: ``sain``, the one that comes with this package, or a path.

        Raises:
            CheckpointError: it is not sound, or of a kind that does not learn from single pushes.
        """
        if name != SHIPPED and not name.endswith(SUFFIX):
            raise CheckpointError(
                f"--from is {name!r}; it must be {SHIPPED}, or the path of a checkpoint *{SUFFIX}"
            )
        path = shipped_checkpoint() if name == SHIPPED else Path(name)
        sain = load_checkpoint(path)
        if sain.origin.kind == PARAMETER_CORRECTION:
            raise CheckpointError(f"{path} corrects parameters; only residuals can be fine-tuned")
        if sain.origin.kind == RECURRENT:
            raise CheckpointError(
                f"{path} was trained on rollouts (--steps-ahead); fine-tuning learns from single"
                " pushes, and would undo that"
            )
        return cls(name, sain, parse_card(path, sain.origin.card))

    @property
    def settings(self) -> TrainingConfig:
        """How it goes on learning where nothing else is asked for.

        Raises:
            CheckpointError: its card has settings that make no sense.
        """
        loss = card_part("training.loss", LossConfig, self.card.training.get("loss", {}))
        learned = {
            name: self.card.training.get(name, getattr(DEFAULTS, name))
            for name in ("weight_decay", "mirror", "diversity")
        }
        infers = self.sain.belief.trained.names
        return card_part(
            "training",
            TrainingConfig,
            {
                **vars(DEFAULTS),
                **learned,
                "prior": self.card.prior,
                "prior_friction": self.card.prior_config.get("friction", DEFAULTS.prior_friction),
                "history": self.card.training.get("history", EPISODE) if infers else NOTHING,
                "network": module_of(self.sain).config,
                "loss": loss,
            },
        )

    def check_options(self, options: TrainOptions) -> None:
        """Check that a training keeps what the weights were made for.

        Raises:
            ConfigError: naming the option that asks for something else.
        """
        config = options.training
        kept = {**vars(self.settings), **vars(self.settings.network)}
        asked = {**vars(config), **vars(config.network)}
        for name in (*KEPT, *vars(config.network)):
            if asked[name] != kept[name]:
                option = f"--{name.replace('_', '-')}"
                raise ConfigError(
                    f"{option} is {asked[name]!r}; {self.name} has {kept[name]!r}, and its weights"
                    f" fit nothing else: leave {option} or --from out"
                )
        if options.belief:
            asked_for = "--belief"
        elif options.preset != DEFAULT:
            asked_for = f"--preset {options.preset}"
        elif options.rollout.wanted:
            asked_for = "--steps-ahead"
        else:
            return
        raise ConfigError(f"{asked_for} is for new weights; leave it or --from out")

    def check_data(self, data: Dataset) -> None:
        """Check that a data set is new to it: what is held out must not have been learned from.

        Raises:
            DatasetError: it, or one that it learned from in its turn, has seen this data set.
        """
        seen = {sha for card in self.card.lineage() for sha in _data_hashes(card)}
        for sha in (data.sha256, *data.sources):
            if sha in seen:
                raise DatasetError(
                    f"{self.name} has learned from this data set already (SHA-256 {sha[:16]}..);"
                    " fine-tune on episodes that it has not seen"
                )

    def gain(self, sain: SainDynamics, held_out: Dataset) -> dict[str, Any]:
        """Return mean errors on held-out episodes [mm], before and after.

        They are those of the target; of the pushed body, where bodies have any shape. Friction is
        told as in deployment. "ratio" is the one over the other with its 95 % interval over
        episodes.
        """
        parts = held_out.parts
        before, after = (
            np.concatenate([_errors(model, part) for part in parts]) for model in (self.sain, sain)
        )
        episodes = np.concatenate([part.episode for part in parts])
        disks = all(part.bodies.are_paper_disks for part in parts)
        return {
            "bodies": "target" if disks else "pushed bodies",
            "before": float(before.mean()),
            "after": float(after.mean()),
            "ratio": bootstrap_ratio(after, before, generator(0, "ratio"), episodes),
        }


def _errors(sain: SainDynamics, part: Part) -> Scalars:
    """Return how far off the target, or the pushed body, is predicted (M,) [mm]."""
    after = step_with_history(sain, part)
    if part.bodies.are_paper_disks and part.disks > TARGET:
        return position_errors(after, part.next_state, TARGET)
    off = np.linalg.norm((after - part.next_state)[..., POSITION], axis=-1)
    return np.asarray(1e3 * off[np.arange(len(part)), pushed_bodies(part.action)])


def _data_hashes(card: ModelCard) -> list[str]:
    return [card.data.get("sha256", ""), *card.data.get("sources", ())]


def gain_line(gain: dict[str, Any], parent: str, part: str) -> str:
    """Return in words what `Parent.gain` found, on this part of the data."""
    ratio, low, high = gain["ratio"]
    return (
        f"{gain['bodies']}: mean error on the {part} episodes {gain['before']:.2f} mm"
        f" with {parent}, {gain['after']:.2f} mm now; ratio {ratio:.2f} \\[{low:.2f}, {high:.2f}]"
    )
