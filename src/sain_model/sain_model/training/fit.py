"""Training from data to model: what is corrected, single pushes, rollouts, regions, fine-tuning.

The kinds of the paper's Fig. 1 are choices here: the prior ``identity`` makes the network alone,
another one a residual, and rollouts make it recurrent.

Fine-tuning: a checkpoint goes on learning, in a world that it was not trained for. Its network,
what that sees, the prior under it and how it infers friction stay. The weights move, and regions
are fitted anew. Where no epoch does better on the validation episodes, its own weights are kept.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Self

import numpy as np

from sain_core.errors import CheckpointError, ConfigError, DatasetError
from sain_core.model import check_model_name
from sain_core.push import pushed_bodies
from sain_core.randomness import bootstrap_ratio, generator
from sain_core.scene import TARGET
from sain_core.types import Scalars
from sain_model.data.dataset import Dataset, Part, Split
from sain_model.dynamics.identify import infer_bodies, with_beliefs
from sain_model.dynamics.load import (
    SUFFIX,
    ModelCard,
    card_part,
    load_checkpoint,
    parse_card,
    shipped_checkpoint,
)
from sain_model.dynamics.priors import make_prior
from sain_model.dynamics.sain import (
    RECURRENT,
    SainDynamics,
    residual_model,
    weights_of,
    with_intervals,
)
from sain_model.evaluation.errors import position_errors
from sain_model.evaluation.predictors import predict_with_history
from sain_model.inference.kinds import FRICTION, Kind, friction_kind, read_belief
from sain_model.network.interaction_network import InteractionNetwork, new_network
from sain_model.network.settings import PLANAR, PLANAR_AXES, SHIPPED
from sain_model.training.interval_fit import fit_intervals
from sain_model.training.objectives import Rollouts, SinglePushes
from sain_model.training.settings import DEFAULT, EPISODE, NOTHING, TrainingConfig, TrainOptions
from sain_model.training.trainer import LearningObjective, LossHistory, Progress, Trainer

Show = Callable[[str, int, int], AbstractContextManager[Progress]]
"""Shows a part of a training, by its name, of so many epochs of which so many are done."""

PUSHES: Final = "training"  # names of files: of the state
ROLLOUTS: Final = "rollouts"
STATES: Final = (f"{PUSHES}.pt", f"{ROLLOUTS}.pt")


def trained_kind(config: TrainingConfig) -> Kind:
    """Return the physics that settings ask for, and what pushes show of it.

    Raises `ConfigError`: no such prior.
    """
    check_model_name(config.prior)
    return friction_kind(make_prior(config.prior), config.history != NOTHING)


def identified_kind(path: Path, config: TrainingConfig) -> tuple[TrainingConfig, Kind]:
    """Return the most likely physics of a belief, and settings that name it.

    A checkpoint on it infers friction alone, as in its training: the recordings show the rest.
    Raises `CheckpointError`: no such file, or not a belief; `ConfigError`: the settings ask for
    another prior.
    """
    kind = read_belief(path).likeliest
    if kind.of_bodies:
        seen = replace(config.network, believed=True)
        return replace(config, prior=PLANAR, network=seen), replace(kind, corrected=True)
    name = PLANAR_AXES if kind.has_axes else PLANAR
    if config.prior not in (PLANAR, name):
        raise ConfigError(
            f"--prior is {config.prior!r}; the physics of {path} is a {name!r}: leave --prior out"
        )
    deviation = float(kind.deviations[kind.names.index(FRICTION)])
    alone = friction_kind(kind.prior, config.history != NOTHING, deviation)
    return replace(config, prior=name), alone


def fit(
    split: Split,
    kind: Kind,
    config: TrainingConfig,
    folder: Path,
    start: SainDynamics | None = None,
    show: Show = lambda name, epochs, done: nullcontext(lambda epoch, history: None),
    overwrite: bool = False,
) -> tuple[SainDynamics, list[LossHistory]]:
    """Train on single pushes, then on rollouts if wanted; fit regions to the validation part.

    Network and regions are those of the best epoch. A training whose state is in the folder is
    resumed; with `overwrite`, one of other settings or data is replaced. The weights of `start` are
    kept if no epoch is better. `show` shows the training while it runs.

    Raises `CheckpointError`: the state in the folder is damaged or of other settings or data.
    """
    if kind.of_bodies:  # each has what the pushes to learn from show of it
        parts, bodies = vars(split).values(), infer_bodies(kind, split.train)
        split = Split(*(with_beliefs(part, kind, bodies) for part in parts))
    network = new_network(config.network, config.seed)
    pushes = SinglePushes(split, kind, config)
    if start is not None:
        pushes.identity += f" from {start.origin.model_hash}"
        network = InteractionNetwork.of(weights_of(start))
    stages: list[tuple[str, LearningObjective, TrainingConfig]] = [
        (PUSHES, pushes, config.of_pushes)
    ]
    if config.steps_ahead > 1:
        stages.append((ROLLOUTS, Rollouts(split, kind, config), config.of_rollouts))
    histories = []
    for name, objective, settings in stages:
        keeps = start is not None and name == PUSHES
        trainer = Trainer(network, objective, settings, folder / f"{name}.pt", keeps, overwrite)
        with show(name, settings.epochs, trainer.epoch) as progress:
            trainer.run(progress)
        histories.append(trainer.history)
    recurrent = config.steps_ahead > 1
    sain = residual_model(network.weights, kind, config.prior, recurrent=recurrent)
    return with_intervals(sain, fit_intervals(sain, *split.validation.parts)), histories


KEPT: Final = ("prior", "history")  # and its network: weights fit no others
INHERITED: Final = (
    *("weight_decay", "mirror", "diversity"),
    *("robust", "position_scale", "velocity_scale", "heading_scale"),
)
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

        Raises `CheckpointError`: it is not sound, or of a kind that does not learn from single
        pushes.
        """
        if name != SHIPPED and not name.endswith(SUFFIX):
            raise CheckpointError(
                f"--from is {name!r}; it must be {SHIPPED}, or the path of a checkpoint *{SUFFIX}"
            )
        path = shipped_checkpoint() if name == SHIPPED else Path(name)
        sain = load_checkpoint(path)
        if sain.origin.kind == RECURRENT:
            raise CheckpointError(
                f"{path} was trained on rollouts (--steps-ahead); fine-tuning learns from single"
                " pushes, and would undo that"
            )
        return cls(name, sain, parse_card(path, sain.origin.card))

    @property
    def settings(self) -> TrainingConfig:
        """How it goes on learning; raises `CheckpointError`: its card makes no sense."""
        learned, infers = self.card.training, self.sain.belief.trained.names
        return card_part(
            "training",
            TrainingConfig,
            {
                **vars(DEFAULTS),
                **{name: learned[name] for name in INHERITED if name in learned},
                "prior": self.card.prior,
                "history": learned.get("history", EPISODE) if infers else NOTHING,
                "network": weights_of(self.sain).config,
            },
        )

    def check_options(self, options: TrainOptions) -> None:
        """Check that a training keeps what the weights were made for.

        Raises `ConfigError`: naming the option that asks for something else.
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
        elif config.steps_ahead > 1:
            asked_for = "--steps-ahead"
        else:
            return
        raise ConfigError(f"{asked_for} is for new weights; leave it or --from out")

    def check_data(self, data: Dataset) -> None:
        """Check that a data set is new to it: what is held out must not have been learned from.

        Raises `DatasetError`: it, or one that it learned from in its turn, has seen this data set.
        """
        learned = [card.data for card in self.card.lineage()]
        seen = {sha for one in learned for sha in (one.get("sha256"), *one.get("sources", ()))}
        for sha in (data.sha256, *data.sources):
            if sha in seen:
                raise DatasetError(
                    f"{self.name} has learned from this data set already (SHA-256 {sha[:16]}..);"
                    " fine-tune on episodes that it has not seen"
                )

    def gain(self, sain: SainDynamics, held_out: Dataset) -> dict[str, Any]:
        """Return mean errors on held-out episodes [mm] before and after, and their ratio.

        They are those of the target; of the pushed body, where bodies have any shape. Friction is
        told as in deployment. The ratio has its 95 % interval over episodes.
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
    after, body = predict_with_history(sain, part).mean, pushed_bodies(part.action)
    if part.bodies.are_paper_disks and part.disks > TARGET:
        body = np.full(len(part), TARGET)
    return position_errors(after, part.next_state, body)


def gain_line(gain: dict[str, Any], parent: str, part: str) -> str:
    """Return in words what `Parent.gain` found, on this part of the data."""
    ratio, low, high = gain["ratio"]
    return (
        f"{gain['bodies']}: mean error on the {part} episodes {gain['before']:.2f} mm"
        f" with {parent}, {gain['after']:.2f} mm now; ratio {ratio:.2f} \\[{low:.2f}, {high:.2f}]"
    )
