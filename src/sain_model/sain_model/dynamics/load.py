"""Dynamics by name: what command lines, parameters and nodes say when they mean a model."""

from importlib import resources
from pathlib import Path

from sain_core.dynamics import Dynamics
from sain_core.errors import CheckpointError
from sain_model.dynamics.checkpoint import (
    INSIDE_ARCHITECTURE,
    SUFFIX,
    card_path,
    fill,
    load_checkpoint,
    read_card,
    read_checkpoint,
)
from sain_model.dynamics.correction_network import InsideNetworks
from sain_model.dynamics.intervals import Intervals
from sain_model.dynamics.parameter_correction import InsideSain
from sain_model.dynamics.priors import C, Settings, load_prior, load_told_prior, naming, typed
from sain_model.dynamics.recurrent import PhysicsChain
from sain_model.dynamics.sain import SainDynamics
from sain_model.dynamics.settings import (
    PHYSICS,
    PRIORS,
    SHIPPED,
    InsideNetworkConfig,
    RolloutConfig,
)
from sain_model.physics.friction import FrictionConfig


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


def load_sain(path: Path) -> SainDynamics:
    """Return the checkpoint at this path on the prior that it was trained on.

    Raises:
        CheckpointError: the checkpoint is not sound.
    """
    network, card, text = load_checkpoint(path)
    with naming(str(card_path(path))):
        prior = load_prior(card.prior, card.prior_config)
        friction = intervals = rollouts = None
        if card.friction is not None:
            friction = card_part("friction", FrictionConfig, card.friction)
        if card.rollouts is not None:
            rollouts = card_part("rollouts", RolloutConfig, card.rollouts)
        if card.intervals is not None:
            with naming("intervals"):
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


def load_inside(path: Path) -> InsideSain:
    """Return the networks at this path inside the prior that they were trained in.

    Raises:
        CheckpointError: the checkpoint is not sound.
    """
    content, card, text = read_checkpoint(path, INSIDE_ARCHITECTURE)
    with naming(str(card_path(path))):
        prior = load_told_prior(card.prior, card.prior_config)
        networks = InsideNetworks(card_part("network", InsideNetworkConfig, card.network))
    fill(path, content, networks)
    return InsideSain(networks, prior, card.prior, card.weights_sha256, text)


def sain_class(rollouts: RolloutConfig | None) -> type[SainDynamics]:
    """Return the class that is rolled out as a network was trained; None: on single pushes."""
    return PhysicsChain if rollouts and rollouts.chain == PHYSICS else SainDynamics


def card_part(name: str, kind: type[C], settings: Settings) -> C:
    """Return the settings of this name on a card.

    Raises:
        CheckpointError: they are not of this kind.
    """
    with naming(name):
        return kind(**typed(kind, settings))


def shipped_checkpoint() -> Path:
    """Return the path of the checkpoint that comes with this package."""
    return Path(str(resources.files("sain_model") / "checkpoints" / f"{SHIPPED}{SUFFIX}"))
