"""What this package offers to the registry of models: its priors and checkpoints."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from importlib import resources
from pathlib import Path
from typing import Any, Final, TypeVar, get_type_hints

from sain_core.config import Config
from sain_core.dynamics import Dynamics, IdentityPrior
from sain_core.errors import CheckpointError
from sain_core.plugins import load_dynamics
from sain_model.dynamics.checkpoint import (
    CORRECTION_ARCHITECTURE,
    card_path,
    fill,
    load_checkpoint,
    read_card,
    read_checkpoint,
)
from sain_model.dynamics.correction_network import CorrectionEnsemble, CorrectionNetworkConfig
from sain_model.dynamics.intervals import Intervals
from sain_model.dynamics.parameter_correction import ParameterCorrection
from sain_model.dynamics.recurrent import PhysicsChain
from sain_model.dynamics.rollouts import PHYSICS, RolloutConfig
from sain_model.dynamics.sain import IDENTITY, SainDynamics
from sain_model.physics.friction import FrictionConfig
from sain_model.physics.planar import PlanarConfig, PlanarPrior
from sain_model.physics.planar_axes import AXES

PLANAR: Final = "planar"
PLANAR_AXES: Final = "planar_axes"
PLANAR_PRIORS: Final = (PLANAR, PLANAR_AXES)
SHIPPED: Final = "sain"

C = TypeVar("C", bound=Config)
Settings = dict[str, Any]


def load_builtin(name: str) -> Dynamics:
    """Return a dynamics of this package: what `sain_core.plugins.load_dynamics` finds here.

    Args:
        name: ``planar``, ``planar_axes`` or ``identity``: that prior; ``sain``: the checkpoint
            that comes with this package; anything else: the path of a checkpoint.

    Raises:
        CheckpointError: no sound checkpoint at that path.
    """
    if name == IDENTITY:
        return IdentityPrior()
    if name in PLANAR_PRIORS:
        return load_planar(name)
    path = shipped_checkpoint() if name == SHIPPED else Path(name).expanduser()
    if path.exists() and read_card(path).architecture == CORRECTION_ARCHITECTURE:
        return load_parameter_correction(path)
    return load_sain(path)


def load_prior(name: str, settings: Settings | None = None) -> Dynamics:
    """Return a prior by its name, from any installed package.

    Args:
        name: of the prior, as in `sain_core.plugins.load_dynamics`.
        settings: of `PlanarConfig`, for ``planar`` and ``planar_axes``; None: the usual ones.

    Raises:
        ConfigError: no package offers this name.
        CheckpointError: the prior has no such settings.
    """
    if name == IDENTITY:
        return IdentityPrior()
    if name in PLANAR_PRIORS:
        return load_planar(name, settings)
    if settings:
        raise CheckpointError(f"the prior {name!r} has no settings; given: {', '.join(settings)}")
    return load_dynamics(name)


def load_planar(name: str, settings: Settings | None = None) -> PlanarPrior:
    """Return a planar prior, whose friction and parameters can be conditioned.

    Raises:
        CheckpointError: there is none of that name, or it has no such settings.
    """
    if name not in PLANAR_PRIORS:
        known = " and ".join(PLANAR_PRIORS)
        raise CheckpointError(
            f"the parameters of {name!r} cannot be corrected; those of {known} can"
        )
    usual = PlanarConfig() if name == PLANAR else AXES
    with _naming("settings of the planar prior"):
        return PlanarPrior(replace(usual, **_typed(PlanarConfig, settings or {})))


def prior_settings(prior: Dynamics) -> Settings:
    """Return the settings that make a prior again: the second argument of `load_prior`."""
    return asdict(prior.config) if isinstance(prior, PlanarPrior) else {}


def load_sain(path: Path) -> SainDynamics:
    """Return the checkpoint at this path on the prior that it was trained on.

    Raises:
        CheckpointError: the checkpoint is not sound.
    """
    network, card, text = load_checkpoint(path)
    with _naming(str(card_path(path))):
        prior = load_prior(card.prior, card.prior_config)
        friction = intervals = rollouts = None
        if card.friction is not None:
            friction = card_part("friction", FrictionConfig, card.friction)
        if card.rollouts is not None:
            rollouts = card_part("rollouts", RolloutConfig, card.rollouts)
        if card.intervals is not None:
            with _naming("intervals"):
                intervals = Intervals.from_card(card.intervals)
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


def load_parameter_correction(path: Path) -> ParameterCorrection:
    """Return the networks at this path on the prior that they correct.

    Raises:
        CheckpointError: the checkpoint is not sound.
    """
    content, card, text = read_checkpoint(path, CORRECTION_ARCHITECTURE)
    with _naming(str(card_path(path))):
        prior = load_planar(card.prior, card.prior_config)
        networks = CorrectionEnsemble(card_part("network", CorrectionNetworkConfig, card.network))
    fill(path, content, networks)
    return ParameterCorrection(networks, prior, card.prior, card.weights_sha256, text)


def sain_class(rollouts: RolloutConfig | None) -> type[SainDynamics]:
    """Return the class that is rolled out as a network was trained; None: on single pushes."""
    return PhysicsChain if rollouts and rollouts.chain == PHYSICS else SainDynamics


@contextmanager
def _naming(part: str) -> Iterator[None]:
    """Turn what goes wrong with a part of a card into an error that names the part.

    Raises:
        CheckpointError: anything went wrong.
    """
    try:
        yield
    except (CheckpointError, TypeError, KeyError, ValueError) as error:  # ConfigError is one
        raise CheckpointError(f"{part}: {error}") from error


def card_part(name: str, kind: type[C], settings: Settings) -> C:
    """Return the settings of this name on a card.

    Raises:
        CheckpointError: they are not of this kind.
    """
    with _naming(name):
        return kind(**_typed(kind, settings))


def _typed(kind: type[Config], settings: Settings) -> Settings:
    """Return settings that come from outside when their values are of the right types.

    Raises:
        TypeError: naming the one that is not.
    """
    right = get_type_hints(kind)
    for name, value in dict(settings).items():
        allowed = (int, float) if right.get(name) is float else (right.get(name, object),)
        if not isinstance(value, allowed) or (isinstance(value, bool) and bool not in allowed):
            raise TypeError(f"{name} is {value!r}; it must be of type {allowed[-1].__name__}")
    return settings


def shipped_checkpoint() -> Path:
    """Return the path of the checkpoint that comes with this package."""
    return Path(str(resources.files("sain_model") / "checkpoints" / "sain.safetensors"))
