"""Training from data to model: what is corrected, single pushes, rollouts, regions, fine-tuning.

The kinds of the paper's Fig. 1 are choices here: the prior ``identity`` makes the network alone,
another one a residual, and rollouts make it recurrent.

Fine-tuning: a checkpoint goes on learning, in a world that it was not trained for. Its network,
what that sees, the prior under it and how it infers friction stay. The weights move, and regions
are fitted anew. Where no epoch does better on the validation episodes, its own weights are kept.
"""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from matplotlib.figure import Figure
from numpy import ndarray
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

from sain_core.errors import CheckpointError, ConfigError, DatasetError
from sain_core.model import check_model_name
from sain_core.output import write_whole
from sain_core.provenance import DISTRIBUTION, processor, ros2_command, system, versions
from sain_core.push import pushed_bodies
from sain_core.randomness import bootstrap_ratio, generator
from sain_core.scene import TARGET
from sain_core.types import Scalars
from sain_core.view.figures import TEXT, new_figure, style_axes
from sain_core.view.palette import PALETTE
from sain_model.data.dataset import Dataset, Part, Split
from sain_model.dynamics.identify import with_beliefs
from sain_model.dynamics.load import (
    SUFFIX,
    ModelCard,
    card_part,
    load_checkpoint,
    parse_card,
    shipped_checkpoint,
)
from sain_model.dynamics.priors import make_prior, prior_settings
from sain_model.dynamics.sain import (
    RECURRENT,
    RESIDUAL,
    SainDynamics,
    residual_model,
    weights_of,
    with_intervals,
)
from sain_model.evaluation.errors import (
    HISTORY,
    PRIOR,
    PRIOR_HISTORY,
    Figures,
    position_errors,
    predict_known,
    predict_with_history,
)
from sain_model.inference.kinds import (
    FRICTION,
    Kind,
    friction_kind,
    read_belief,
    written_kind,
)
from sain_model.inference.population import Population
from sain_model.network.interaction_network import InteractionNetwork, new_network
from sain_model.network.settings import EARLIER, PLANAR, PLANAR_AXES, SHIPPED, WORLD_FRAME
from sain_model.training.interval_fit import fit_intervals
from sain_model.training.kernel_fit import FEW, fit_kernel
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
    another prior, or to infer again what it states.
    """
    kind = read_belief(path).likeliest
    if config.history == EARLIER:
        raise ConfigError(
            f"--history is {EARLIER!r}, by which pushes show what --belief states; leave one out"
        )
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
    bodies: Population | None = None,
) -> tuple[SainDynamics, list[LossHistory]]:
    """Train on single pushes, then on rollouts if wanted; fit regions to the validation part.

    Network and regions are those of the best epoch. A training whose state is in the folder is
    resumed; with `overwrite`, one of other settings or data is replaced. The weights of `start`, or
    on `bodies` the physics alone, are kept if no epoch is better. `show` shows the training while
    it runs. On few pushes of bodies, a kernel takes the place of the network.

    `bodies` is what pushes show of the bodies; None: their names do not count.
    Raises `CheckpointError`: the state in the folder is damaged or of other settings or data.
    """
    if bodies is not None:
        split = Split(*(with_beliefs(part, bodies) for part in vars(split).values()))
    seen = config.network.features == WORLD_FRAME and config.network.believed
    if bodies is not None and seen and config.steps_ahead == 1 and len(split.train) <= FEW:
        weights, history = fit_kernel(split.train, kind, config)
        sain = residual_model(weights, kind, config.prior, history=config.history)
        return with_intervals(sain, fit_intervals(sain, *split.validation.parts)), [history]
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
        keeps = (start is not None or bodies is not None) and name == PUSHES
        trainer = Trainer(network, objective, settings, folder / f"{name}.pt", keeps, overwrite)
        with show(name, settings.epochs, trainer.epoch) as progress:
            trainer.run(progress)
        histories.append(trainer.history)
    recurrent = config.steps_ahead > 1
    sain = residual_model(
        network.weights, kind, config.prior, recurrent=recurrent, history=config.history
    )
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
        if weights_of(sain).centres:
            raise CheckpointError(
                f"{path} is a kernel on few pushes, which does not go on learning; train on all"
                " pushes together, without --from"
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
        return _gain("target" if disks else "pushed bodies", before, after, episodes)


def gain_on_bodies(sain: SainDynamics, held_out: Dataset, bodies: Population) -> dict[str, Any]:
    """Return mean errors on held-out pushes [mm] of identified physics and of what corrects it."""
    before, after = (
        np.concatenate(
            [
                position_errors(found.mean, part.next_state, pushed_bodies(part.action))
                for part in held_out.parts
                for found in [predict_known(sain, part, bodies, corrected)]
            ]
        )
        for corrected in (False, True)
    )
    return _gain("pushed bodies", before, after, held_out.episode)


def _gain(bodies: str, before: Scalars, after: Scalars, episodes: ndarray) -> dict[str, Any]:
    return {
        "bodies": bodies,
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


# --- what is shown and written --------------------------------------------------------------------

SETTINGS: Final = "config.json"
PICTURES: Final = ("loss.png", "rollout_loss.png")


@contextmanager
def epoch_bar(console: Console, epochs: int, done: int) -> Iterator[Progress]:
    """Show a bar over epochs with the losses and the time left."""
    losses, left = TextColumn("{task.fields[losses]}, left"), TimeRemainingColumn()
    columns = TextColumn("epoch"), BarColumn(), MofNCompleteColumn(), losses, left
    with Bars(*columns, console=console) as bar:
        task = bar.add_task("train", total=epochs, completed=done, losses="starting")

        def advance(epoch: int, history: LossHistory) -> None:
            losses = (
                f"training {history.train[-1]:.4g}, validation {history.validation[-1]:.4g},"
                f" best {history.best_loss:.4g}"
            )
            bar.update(task, completed=epoch, losses=losses)

        yield advance


RESIDUALS: Final = (RESIDUAL, RECURRENT)  # without physics a network predicts all by itself
PACKAGES: Final = (DISTRIBUTION, "torch", "numpy", "numba", "scipy", "safetensors")


def make_card(
    command: TrainOptions,
    data: Dataset,
    split: Split,
    model: SainDynamics,
    histories: Sequence[LossHistory],
    errors: dict[str, Any],
    parent: ModelCard | None = None,
) -> ModelCard:
    """Return the card of what was trained: with losses on single pushes, then on rollouts."""
    config = command.training
    training = {**asdict(config), **_losses(histories[0])}
    if len(histories) > 1:
        training["rollouts"] = _losses(histories[1])
    kind, intervals = model.belief.trained, model.network and model.network.intervals
    return ModelCard(
        prior=config.prior,
        prior_config=prior_settings(kind.prior),
        network=asdict(config.network),
        bottoms=_bottoms(split.train, parent) if model.origin.kind in RESIDUALS else [],
        friction={"width": kind.stated[FRICTION][1]} if FRICTION in kind.names else None,
        bodies=written_kind(kind) if kind.of_bodies else None,
        intervals=asdict(intervals) if intervals else None,
        kind=model.origin.kind,
        data=_data_part(command.dataset, data, split),
        training=training,
        errors=errors,
        versions=environment(),
        command=ros2_command("sain_model", "train"),
        parent={**asdict(parent), "errors": {}} if parent else None,
    )


def own_errors(errors: Figures, name: str) -> Figures:
    """Return what a card has of errors: after one push, of the model and of its prior."""
    kept = (name, name + HISTORY, PRIOR, PRIOR_HISTORY)
    once = {
        part: {
            group: {one: figures for one, figures in by_name.items() if one in kept}
            for group, by_name in errors["after"]["1"][part].items()
        }
        for part in ("errors", "ratios")
    }
    return {**errors, "after": {"1": once}}


def _bottoms(learned: Dataset, parent: ModelCard | None) -> list[str]:
    """Return what bodies stood on; a parent that states nothing corrects all."""
    if parent and not parent.bottoms:
        return []
    found = {shape.bottom for part in learned.parts for shape in part.bodies.shapes}
    return sorted(found.union(parent.bottoms if parent else ()))


def _data_part(paths: Sequence[Path], data: Dataset, split: Split) -> dict[str, Any]:
    """Return what a card says of the data."""
    parts = {"train": split.train, "validation": split.validation, "test": split.test}
    return {
        "path": " ".join(map(str, paths)),
        "sha256": data.sha256,
        "sources": list(data.sources),
        "transitions": {name: len(part) for name, part in parts.items()},
        "worlds": {name: part.counts for name, part in parts.items()},
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


def save_settings(command: TrainOptions, data: Dataset) -> None:
    """Write beside the checkpoint, from the start, what is to be done with what."""
    settings = {
        **asdict(command),
        "data_sha256": data.sha256,
        "environment": environment(),
        "command": ros2_command("sain_model", "train"),
    }
    text = json.dumps(settings, indent=2, default=str) + "\n"
    write_whole(command.out / SETTINGS, text.encode())


def written_names(name: str) -> list[str]:
    """Return the files that a training of this name writes.

    Raises `ConfigError`: the name is a path, hidden, a pattern, or that of another file.
    """
    if not re.fullmatch(r"\w[\w.+-]*", name) or f"{name}.json" == SETTINGS:
        raise ConfigError(
            f"--name is {name!r}; allowed: letters, digits, '_', '-', '+' and '.', no '.' at first,"
            f" and not {Path(SETTINGS).stem!r}: it is a file's name in --out"
        )
    return [f"{name}{SUFFIX}", f"{name}.json", SETTINGS, *PICTURES, *STATES]


def draw_losses(history: LossHistory) -> Figure:
    """Draw the losses after each epoch, the weights that are kept marked."""
    figure = new_figure(6.0, 4.0)
    axes = figure.subplots()
    style_axes(axes, grid="both", xlabel="epoch", ylabel="loss, mean over transitions")
    epochs = range(1, len(history.train) + 1)
    axes.plot(epochs, history.train, label="training", color=PALETTE.physics)
    axes.plot(epochs, history.validation, label="validation", color=PALETTE.predicted)
    kept = f"kept: epoch {history.best + 1}, {history.best_loss:.4g}"
    axes.plot(history.best + 1, history.best_loss, "o", color=PALETTE.predicted, label=kept)
    if history.start is not None:
        before = "validation before the training"
        axes.axhline(history.start, color=PALETTE.floor, linestyle=":", label=before)
    figure.legend(frameon=False, loc="outside lower center", ncols=2, fontsize=TEXT)
    return figure
