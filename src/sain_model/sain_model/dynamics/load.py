"""Checkpoints: the weights as ``NAME.safetensors`` and beside them a card, ``NAME.json``.

The card says what was learned from what, how, and how well it does on episodes held out; and it
pins the weights by their SHA-256. Nothing is unpickled. What does not fit is refused.
"""

import dataclasses
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any, Final

from sain_core.config import typed_settings
from sain_core.errors import CheckpointError, UntrustedFileError
from sain_core.guarding.documents import parse_json
from sain_core.guarding.untrusted import listed, read_regular
from sain_core.model import Model
from sain_core.output import write_json, write_whole
from sain_core.provenance import FORMAT, other_format
from sain_core.shapes.shape import BOTTOMS
from sain_model.dynamics.identify import with_all_parameters
from sain_model.dynamics.intervals import Intervals
from sain_model.dynamics.priors import C, Settings, make_prior, naming
from sain_model.dynamics.sain import RECURRENT, SainDynamics, residual_model
from sain_model.inference.kinds import FRICTION, Kind, friction_kind, read_kind
from sain_model.network.settings import SHIPPED, NetworkConfig
from sain_model.network.weights import NetworkWeights
from sain_model.physics.parameters import BY_NAME

SUFFIX: Final = ".safetensors"


@dataclass(frozen=True)
class ModelCard:
    """What a checkpoint says of itself."""

    prior: str  # name of the prior that it corrects, as in `sain_core.model.load_dynamics`
    # its parameters, so that a later calibration does not change this model
    prior_config: dict[str, Any]
    network: dict[str, Any]  # size of the network
    # what the bodies stood on that it learned from: it corrects the prior for these alone. Empty:
    # it corrects all
    bottoms: list[str] = field(default_factory=list)
    # how friction is inferred from an episode's earlier pushes; None: the model was trained without
    # them, and knows the nominal friction alone
    friction: dict[str, Any] | None = None
    # the physics of bodies on surfaces, as a belief has it; None: of no such
    bodies: dict[str, Any] | None = None
    # regions about its predictions, fitted to the validation episodes; None: not
    intervals: dict[str, Any] | None = None
    kind: str = ""  # as in `dynamics.sain`
    # what it was trained on: path, SHA-256, transitions, episodes, split
    data: dict[str, Any] = field(default_factory=dict)
    training: dict[str, Any] = field(default_factory=dict)  # settings, seed, epochs done, losses
    # errors on the held-out episodes [mm], for it and what it is compared with
    errors: dict[str, Any] = field(default_factory=dict)
    # of Python, its packages, this project, system and processor
    versions: dict[str, str] = field(default_factory=dict)
    command: str = ""  # the command line that made it
    weights_sha256: str = ""  # of the safetensors file
    # card of the checkpoint that it was fine-tuned from; None: from none
    parent: dict[str, Any] | None = None
    format: str = FORMAT  # of cards and of what networks see

    def lineage(self) -> Iterator["ModelCard"]:
        """Yield this card, that of its parent, and so on.

        Raises `CheckpointError`: a parent's is no card.
        """
        card: ModelCard | None = self
        while card is not None:
            yield card
            try:
                card = ModelCard(**card.parent) if card.parent else None
            except TypeError as error:
                raise CheckpointError(f"parent on a card is no card: {error}") from error


def card_path(weights: Path) -> Path:
    """Return where the card of these weights lies."""
    return weights.with_suffix(".json")


def save_checkpoint(path: Path, weights: NetworkWeights, card: ModelCard) -> ModelCard:
    """Write weights and card, each whole or not at all; return the card with the weights' hash.

    Raises `CheckpointError`: the path does not end in .safetensors; `OutputError`: the folder
    cannot be written.
    """
    if path.suffix != SUFFIX:
        raise CheckpointError(f"a checkpoint's name ends in {SUFFIX}; {path} does not")
    content, config = weights.serialize(), dataclasses.asdict(weights.config)
    card = replace(card, network=config, weights_sha256=hashlib.sha256(content).hexdigest())
    write_whole(path, content)
    write_json(card_path(path), dataclasses.asdict(card))
    return card


def read_checkpoint(path: Path) -> tuple[bytes, ModelCard, str]:
    """Read weights, their card and the card's JSON text, and check them.

    Raises `CheckpointError`: missing, truncated, of another version or with a card that belongs to
    other weights; the message names the file and what is wrong.
    """
    content = _read(path)
    text = _read(card_path(path)).decode(errors="replace")
    card = parse_card(card_path(path), text)
    found = hashlib.sha256(content).hexdigest()
    if found != card.weights_sha256:
        raise CheckpointError(
            f"{path} has SHA-256 {found[:16]}.., its card says {card.weights_sha256[:16]}..;"
            " the file is truncated, changed, or the card belongs to other weights"
        )
    return content, card, text


def _read(path: Path) -> bytes:
    try:
        return read_regular(path)
    except FileNotFoundError:
        raise CheckpointError(
            f"{path} does not exist; a checkpoint is NAME{SUFFIX} with NAME.json beside it"
        ) from None
    except OSError as error:
        raise CheckpointError(f"cannot read {path}: {error.strerror or error}") from error
    except UntrustedFileError as error:
        raise CheckpointError(f"{path} is not read: {error}") from error


def parse_card(path: Path, text: str) -> ModelCard:
    """Return the card with this JSON text.

    Raises `CheckpointError`: it is no card, or one of another version; naming the command that
    makes the checkpoint anew.
    """
    try:
        values = parse_json(text)
        found, command = values.get("format", values.get("format_version")), values.get("command")
        if found == FORMAT:
            names = {item.name for item in fields(ModelCard)}
            if others := values.keys() - names:
                raise ValueError(f"it has {listed(sorted(others))}, and no card has that")
            return ModelCard(**values)
    except (ValueError, TypeError, AttributeError) as error:
        raise CheckpointError(f"{path} is not a checkpoint's card: {error}") from error
    again = f"train it again with: {command or 'ros2 run sain_model train DATASET --out DIR'}"
    raise CheckpointError(f"{path} {other_format(found, again)}")


def load_builtin(name: str) -> SainDynamics:
    """Return the model ``sain``, which comes with this package, or the checkpoint at a path.

    Raises `CheckpointError`: no sound checkpoint at that path.
    """
    return load_shipped() if name == SHIPPED else load_checkpoint(Path(name).expanduser())


def load_shipped() -> SainDynamics:
    """Return the model that comes with this package."""
    return with_all_parameters(load_checkpoint(shipped_checkpoint()))


def load_checkpoint(path: Path) -> SainDynamics:
    """Return the checkpoint at this path on the prior that it was trained on.

    Raises `CheckpointError`: the checkpoint is not sound.
    """
    content, card, text = read_checkpoint(path)
    with naming(str(card_path(path))):
        config = card_part("network", NetworkConfig, card.network)
        with naming("intervals"):
            intervals = None if card.intervals is None else Intervals.parse(card.intervals)
        kind = _kind(make_prior(card.prior, card.prior_config), card)
        if unknown := [one for one in card.bottoms if one not in BOTTOMS]:
            raise CheckpointError(f"bottoms has {unknown[0]!r}; allowed: {', '.join(BOTTOMS)}")
    try:
        weights = NetworkWeights.parse(config, content)
    except CheckpointError as error:
        raise CheckpointError(f"{path}: {error}") from error
    recurrent, bottoms = card.kind == RECURRENT, card.bottoms or BOTTOMS
    history = str(card.training.get("history", ""))
    model = residual_model(weights, kind, card.prior, intervals, recurrent, bottoms, history)
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


def card_part(name: str, kind: type[C], settings: Settings) -> C:
    """Return the settings of this name on a card.

    Raises `CheckpointError`: they are not of this kind.
    """
    with naming(name):
        return kind(**typed_settings(kind, settings))


def shipped_checkpoint() -> Path:
    """Return the path of the checkpoint that comes with this package."""
    return Path(str(resources.files("sain_model") / "checkpoints" / f"{SHIPPED}{SUFFIX}"))
