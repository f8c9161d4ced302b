"""The checkpoints that this package offers to the registry of models; for priors see `priors`."""

from importlib import resources
from pathlib import Path

from sain_core.config import typed_settings
from sain_core.model import Model
from sain_model.dynamics.checkpoint import (
    ARCHITECTURE,
    CORRECTION_ARCHITECTURE,
    SUFFIX,
    card_path,
    fill,
    read_card,
    read_checkpoint,
)
from sain_model.dynamics.correction_network import CorrectionEnsemble
from sain_model.dynamics.identify import believing_model
from sain_model.dynamics.intervals import Intervals
from sain_model.dynamics.parameter_correction import ParameterCorrection
from sain_model.dynamics.priors import C, Settings, load_planar, load_prior, naming
from sain_model.dynamics.sain import SainDynamics
from sain_model.dynamics.settings import (
    SHIPPED,
    CorrectionNetworkConfig,
    RolloutConfig,
)
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.physics.friction import FrictionConfig


def load_builtin(name: str) -> Model:
    """Return the model ``sain``, which comes with this package, or the checkpoint at a path.

    Raises:
        CheckpointError: no sound checkpoint at that path.
    """
    if name == SHIPPED:
        return load_shipped()
    path = Path(name).expanduser()
    if path.exists() and read_card(path).architecture == CORRECTION_ARCHITECTURE:
        return load_parameter_correction(path)
    return load_sain(path)


def load_shipped() -> SainDynamics:
    """Return the model that comes with this package."""
    return believing_model(load_sain(shipped_checkpoint()))


def load_sain(path: Path) -> SainDynamics:
    """Return the checkpoint at this path on the prior that it was trained on.

    Raises:
        CheckpointError: the checkpoint is not sound.
    """
    content, card, text = read_checkpoint(path, ARCHITECTURE)
    with naming(str(card_path(path))):
        network = InteractionNetwork(card_part("network", NetworkConfig, card.network))
        prior = load_prior(card.prior, card.prior_config)
        friction = intervals = rollouts = None
        if card.friction is not None:
            friction = card_part("friction", FrictionConfig, card.friction)
        if card.rollouts is not None:
            rollouts = card_part("rollouts", RolloutConfig, card.rollouts)
        if card.intervals is not None:
            intervals = card_part("intervals", Intervals, card.intervals)
    fill(path, content, network)
    return SainDynamics(
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
    with naming(str(card_path(path))):
        prior = load_planar(card.prior, card.prior_config)
        networks = CorrectionEnsemble(card_part("network", CorrectionNetworkConfig, card.network))
        friction = None
        if card.friction is not None:
            friction = card_part("friction", FrictionConfig, card.friction)
    fill(path, content, networks)
    return ParameterCorrection(networks, prior, card.prior, card.weights_sha256, text, friction)


def card_part(name: str, kind: type[C], settings: Settings) -> C:
    """Return the settings of this name on a card.

    Raises:
        CheckpointError: they are not of this kind.
    """
    with naming(name):
        return kind(**typed_settings(kind, settings))


def shipped_checkpoint() -> Path:
    """Return the path of the checkpoint that comes with this package."""
    return Path(str(resources.files("sain_model") / "checkpoints" / f"{SHIPPED}{SUFFIX}"))
