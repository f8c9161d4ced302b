"""The checkpoints that this package offers to the registry of models; for priors see `priors`."""

from importlib import resources
from pathlib import Path
from typing import Any

from sain_core.config import typed_settings
from sain_core.model import Model
from sain_model.dynamics.checkpoint import SUFFIX, card_path, fill, read_checkpoint
from sain_model.dynamics.identify import believing_model
from sain_model.dynamics.intervals import Intervals
from sain_model.dynamics.parameter_correction import ParameterCorrection
from sain_model.dynamics.priors import C, Settings, load_planar, load_prior, naming
from sain_model.dynamics.sain import RECURRENT, SainDynamics
from sain_model.dynamics.settings import SHIPPED
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.physics.friction import FrictionConfig


def load_builtin(name: str) -> Model:
    """Return the model ``sain``, which comes with this package, or the checkpoint at a path.

    Raises:
        CheckpointError: no sound checkpoint at that path.
    """
    return load_shipped() if name == SHIPPED else load_checkpoint(Path(name).expanduser())


def load_shipped() -> SainDynamics:
    """Return the model that comes with this package."""
    shipped = load_checkpoint(shipped_checkpoint())
    assert isinstance(shipped, SainDynamics)
    return believing_model(shipped)


def load_checkpoint(path: Path) -> SainDynamics | ParameterCorrection:
    """Return the checkpoint at this path on the prior that it was trained on.

    Raises:
        CheckpointError: the checkpoint is not sound.
    """
    content, card, text = read_checkpoint(path)
    with naming(str(card_path(path))):
        network = InteractionNetwork(card_part("network", NetworkConfig, card.network))
        friction = intervals = None
        if card.friction is not None:
            friction = card_part("friction", FrictionConfig, card.friction)
        if card.intervals is not None:
            intervals = card_part("intervals", Intervals, card.intervals)
        about: dict[str, Any] = {
            "prior_name": card.prior,
            "model_hash": card.weights_sha256,
            "card": text,
            "friction": friction,
        }
        model: SainDynamics | ParameterCorrection
        if network.config.corrects_parameters:
            planar = load_planar(card.prior, card.prior_config)
            model = ParameterCorrection(network, planar, **about)
        else:
            prior = load_prior(card.prior, card.prior_config)
            recurrent = card.kind == RECURRENT
            model = SainDynamics(network, prior, **about, intervals=intervals, recurrent=recurrent)
    fill(path, content, network)
    return model


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
