"""Training from data to model: what is corrected, single pushes, rollouts, regions.

The kinds of the paper's Fig. 1 are choices here: the prior ``identity`` makes the network alone,
another one a residual, and rollouts make it recurrent.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Final

from sain_core.errors import ConfigError
from sain_core.model import check_model_name
from sain_model.data.bodies import infer_bodies, with_beliefs
from sain_model.data.dataset import Split
from sain_model.dynamics.parameter_correction import correcting_model
from sain_model.dynamics.priors import make_prior
from sain_model.dynamics.residual import module_of, residual_model, with_intervals
from sain_model.dynamics.sain import SainDynamics
from sain_model.dynamics.settings import PLANAR, PLANAR_AXES, PLANAR_PRIORS
from sain_model.inference.belief_file import read_belief
from sain_model.inference.kinds import FRICTION, Kind, friction_kind
from sain_model.network.interaction_network import InteractionNetwork, new_network
from sain_model.training.interval_fit import fit_intervals
from sain_model.training.objectives import Rollouts, SinglePushes
from sain_model.training.settings import NOTHING, RolloutConfig, TrainingConfig
from sain_model.training.trainer import LearningObjective, LossHistory, Progress, Trainer

Show = Callable[[str, int, int], AbstractContextManager[Progress]]
"""Shows a part of a training, by its name, of so many epochs of which so many are done."""

PUSHES: Final = "training"  # names of files: of the state
ROLLOUTS: Final = "rollouts"


def trained_kind(config: TrainingConfig) -> Kind:
    """Return the physics that settings ask for, and what pushes show of it.

    Raises:
        ConfigError: no such prior, or the parameters of this one cannot be corrected.
    """
    check_model_name(config.prior)
    planar = config.prior in PLANAR_PRIORS
    if config.network.corrects_parameters and not planar:
        raise ConfigError(
            f"--output {config.network.output} corrects {' or '.join(PLANAR_PRIORS)}, not"
            f" {config.prior!r}; give one of them as --prior"
        )
    prior = make_prior(config.prior, {"friction": config.prior_friction} if planar else None)
    return friction_kind(prior, config.history != NOTHING)


def identified_kind(path: Path, config: TrainingConfig) -> tuple[TrainingConfig, Kind]:
    """Return the most likely physics of a belief, and settings that name it.

    A checkpoint on it infers friction alone, as in its training: the recordings show the rest.

    Raises:
        CheckpointError: no such file, or not a belief.
        ConfigError: the settings ask for another prior.
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
    rollout: RolloutConfig = RolloutConfig(),
    start: SainDynamics | None = None,
    show: Show = lambda name, epochs, done: nullcontext(lambda epoch, history: None),
) -> tuple[SainDynamics, list[LossHistory]]:
    """Train on single pushes, then on rollouts if wanted, and fit the regions of predictions.

    Args:
        split: what to learn from, and what to choose the best epoch and fit regions by.
        kind: the physics that is corrected, and what pushes show of it.
        config: settings.
        folder: of the state; a training that is there is resumed.
        rollout: how training goes on with rollouts.
        start: whose weights it starts from, and keeps if no epoch is better; None: new ones.
        show: shows the training while it runs.

    Raises:
        CheckpointError: the state in the folder is damaged or of other settings or data.
    """
    if kind.of_bodies:
        split = _with_bodies(split, kind)
    network = new_network(config.network, config.seed)
    pushes = SinglePushes(split, kind, config)
    if start is not None:
        pushes.identity += f" from {start.origin.model_hash}"
        network.load_state_dict(module_of(start).state_dict())
    stages: list[tuple[str, LearningObjective, TrainingConfig]] = [(PUSHES, pushes, config)]
    if rollout.wanted:
        rollouts = Rollouts(split, kind, config, rollout)
        stages.append((ROLLOUTS, rollouts, rollout.after(config)))
    histories = []
    for name, objective, settings in stages:
        keeps = start is not None and name == PUSHES
        trainer = Trainer(network, objective, settings, folder / f"{name}.pt", keeps)
        with show(name, settings.epochs, trainer.epoch) as progress:
            trainer.run(progress)
        histories.append(trainer.history)
    return _model(network, kind, config, rollout, split), histories


def _with_bodies(split: Split, kind: Kind) -> Split:
    """Return a split that states what the pushes to learn from show of each body.

    Raises:
        DatasetError: pushes whose body is not named.
    """
    parts = split.train, split.validation, split.test
    bodies = infer_bodies(kind, split.train)
    return Split(*(with_beliefs(part, kind, bodies) for part in parts))


def _model(
    network: InteractionNetwork,
    kind: Kind,
    config: TrainingConfig,
    rollout: RolloutConfig,
    split: Split,
) -> SainDynamics:
    """Return the trained model, with regions fitted to the validation part."""
    if config.network.corrects_parameters:
        return correcting_model(network, kind, config.prior)
    sain = residual_model(network, kind, config.prior, recurrent=rollout.wanted)
    return with_intervals(sain, fit_intervals(sain, *split.validation.parts))
