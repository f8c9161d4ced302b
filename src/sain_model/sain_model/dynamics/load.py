"""The checkpoints that this package offers to the registry of models; for priors see `priors`."""

from dataclasses import replace
from importlib import resources
from pathlib import Path

from sain_core.config import typed_settings
from sain_core.errors import CheckpointError
from sain_core.model import Model
from sain_core.shapes.shape import BOTTOMS
from sain_model.dynamics.checkpoint import SUFFIX, ModelCard, card_path, fill, read_checkpoint
from sain_model.dynamics.identify import with_all_parameters
from sain_model.dynamics.intervals import Intervals
from sain_model.dynamics.parameter_correction import correcting_model
from sain_model.dynamics.priors import C, Settings, load_planar, make_prior, naming
from sain_model.dynamics.residual import residual_model
from sain_model.dynamics.sain import RECURRENT, SainDynamics
from sain_model.dynamics.settings import SHIPPED
from sain_model.inference.belief_file import read_kind
from sain_model.inference.kinds import FRICTION, Kind, friction_kind
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig
from sain_model.physics.parameters import BY_NAME


def load_builtin(name: str) -> SainDynamics:
    """Return the model ``sain``, which comes with this package, or the checkpoint at a path.

    Raises:
        CheckpointError: no sound checkpoint at that path.
    """
    return load_shipped() if name == SHIPPED else load_checkpoint(Path(name).expanduser())


def load_shipped() -> SainDynamics:
    """Return the model that comes with this package."""
    return with_all_parameters(load_checkpoint(shipped_checkpoint()))


def load_checkpoint(path: Path) -> SainDynamics:
    """Return the checkpoint at this path on the prior that it was trained on.

    Raises:
        CheckpointError: the checkpoint is not sound.
    """
    content, card, text = read_checkpoint(path)
    with naming(str(card_path(path))):
        network = InteractionNetwork(card_part("network", NetworkConfig, card.network))
        intervals = None
        if card.intervals is not None:
            intervals = card_part("intervals", Intervals, card.intervals)
        if network.config.corrects_parameters:
            kind = _kind(load_planar(card.prior, card.prior_config), card)
            model = correcting_model(network, kind, card.prior)
        else:
            kind = _kind(make_prior(card.prior, card.prior_config), card)
            recurrent = card.kind == RECURRENT
            bottoms = _bottoms(card)
            model = residual_model(network, kind, card.prior, intervals, recurrent, bottoms)
    fill(path, content, network)
    origin = replace(model.origin, model_hash=card.weights_sha256, card=text)
    return replace(model, origin=origin)


def _kind(prior: Model, card: ModelCard) -> Kind:
    """Return the physics of a card; without a part "friction", pushes show nothing of it."""
    if card.bodies is not None:
        with naming("bodies"):
            return replace(read_kind(card.bodies), corrected=True)
    with naming("friction"):
        if card.friction is None:
            return friction_kind(prior, infers=False)
        spread = float(card.friction["width"])
        return friction_kind(prior, deviation=spread / BY_NAME[FRICTION].spread)


def _bottoms(card: ModelCard) -> tuple[str, ...]:
    """Return what bodies may stand on that the network of a card corrects."""
    if unknown := [one for one in card.bottoms if one not in BOTTOMS]:
        raise CheckpointError(f"bottoms has {unknown[0]!r}; allowed: {', '.join(BOTTOMS)}")
    return tuple(card.bottoms) or BOTTOMS


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
