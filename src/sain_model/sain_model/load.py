"""Dynamics by name: what command lines, parameters and nodes say when they mean a model."""

from dataclasses import asdict, replace
from importlib import resources
from pathlib import Path
from typing import Any, Final, get_type_hints

from sain_core.config import Config
from sain_core.dynamics import Dynamics, IdentityPrior
from sain_core.errors import CheckpointError
from sain_model.checkpoint import SUFFIX, card_path, load_checkpoint, read_card
from sain_model.friction import FrictionConfig
from sain_model.inside_checkpoint import INSIDE_ARCHITECTURE, load_inside
from sain_model.intervals import Intervals
from sain_model.planar import PlanarConfig, PlanarPrior
from sain_model.planar_axes import AXES
from sain_model.recurrent import PhysicsChain
from sain_model.rollouts import PHYSICS, RolloutConfig
from sain_model.sain import IDENTITY, SainDynamics

PLANAR: Final = "planar"
PLANAR_AXES: Final = "planar_axes"
PRIORS: Final = (PLANAR, PLANAR_AXES, IDENTITY)
SHIPPED: Final = "sain"


def load_dynamics(name: str) -> Dynamics:
    """Return a dynamics by its name.

    Args:
        name: ``planar``, ``planar_axes`` or ``identity``: that prior; ``sain``: the checkpoint
            that comes with this package; anything else: the path of a checkpoint.

    Raises:
        CheckpointError: no prior of that name, and no sound checkpoint at that path.
    """
    if name in PRIORS:
        return load_prior(name)
    if name == SHIPPED:
        return load_sain(shipped_checkpoint())
    if not name.endswith(SUFFIX):
        known = ", ".join([*PRIORS, SHIPPED])
        raise CheckpointError(f"no dynamics {name!r}; known: {known}, or a path *{SUFFIX}")
    path = Path(name)
    if path.exists() and read_card(path).architecture == INSIDE_ARCHITECTURE:
        return load_inside(path)
    return load_sain(path)


def load_prior(name: str, settings: dict[str, Any] | None = None) -> Dynamics:
    """Return a prior by its name, with its usual settings or with these.

    Raises:
        CheckpointError: there is none of that name, or it has no such settings.
    """
    if name in (PLANAR, PLANAR_AXES):
        usual = PlanarConfig() if name == PLANAR else AXES
        try:
            return PlanarPrior(replace(usual, **_typed(PlanarConfig, settings or {})))
        except (TypeError, ValueError) as error:  # ConfigError is one
            raise CheckpointError(f"settings of the planar prior: {error}") from error
    if name == IDENTITY:
        return IdentityPrior()
    raise CheckpointError(f"no prior {name!r}; known: {', '.join(PRIORS)}")


def prior_settings(prior: Dynamics) -> dict[str, Any]:
    """Return the settings that make a prior again: the second argument of `load_prior`."""
    return asdict(prior.config) if isinstance(prior, PlanarPrior) else {}


def load_sain(path: Path) -> SainDynamics:
    """Return the checkpoint at this path on the prior that it was trained on.

    Raises:
        CheckpointError: the checkpoint is not sound.
    """
    network, card, text = load_checkpoint(path)
    try:
        prior = load_prior(card.prior, card.prior_config)
        friction = _friction(card.friction)
        intervals = _intervals(card.intervals)
        rollouts = _rollouts(card.rollouts)
    except CheckpointError as error:
        raise CheckpointError(f"{card_path(path)}: {error}") from error
    return sain_class(rollouts)(
        network,
        prior,
        card.prior,
        card.weights_sha256,
        text,
        friction,
        intervals,
        recurrent=rollouts is not None,
    )


def sain_class(rollouts: RolloutConfig | None) -> type[SainDynamics]:
    """Return the class that is rolled out as a network was trained; None: on single pushes."""
    return PhysicsChain if rollouts and rollouts.chain == PHYSICS else SainDynamics


def _rollouts(settings: dict[str, Any] | None) -> RolloutConfig | None:
    try:
        return None if settings is None else RolloutConfig(**_typed(RolloutConfig, settings))
    except (TypeError, ValueError) as error:
        raise CheckpointError(f"rollouts: {error}") from error


def _friction(settings: dict[str, Any] | None) -> FrictionConfig | None:
    try:
        return None if settings is None else FrictionConfig(**_typed(FrictionConfig, settings))
    except (TypeError, ValueError) as error:
        raise CheckpointError(f"friction: {error}") from error


def _intervals(settings: dict[str, Any] | None) -> Intervals | None:
    try:
        return None if settings is None else Intervals.from_card(settings)
    except (TypeError, KeyError, ValueError) as error:
        raise CheckpointError(f"intervals: {error}") from error


def _typed(kind: type[Config], settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings that come from outside when their values are of the right types.

    Raises:
        TypeError: naming the one that is not.
    """
    right = get_type_hints(kind)
    for name, value in dict(settings).items():
        allowed = (int, float) if right.get(name) is float else (right.get(name, object),)
        if isinstance(value, bool) or not isinstance(value, allowed):
            raise TypeError(f"{name} is {value!r}; it must be of type {allowed[-1].__name__}")
    return settings


def shipped_checkpoint() -> Path:
    """Return the path of the checkpoint that comes with this package."""
    return Path(str(resources.files("sain_model") / "checkpoints" / f"{SHIPPED}{SUFFIX}"))
