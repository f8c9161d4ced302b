"""Checkpoints of networks inside physics: weights and card as in `sain_model.checkpoint`."""

from pathlib import Path
from typing import Final

from sain_core.errors import CheckpointError, ConfigError
from sain_model.checkpoint import card_path, fill, read_checkpoint
from sain_model.inside import InsideSain
from sain_model.inside_network import InsideNetworkConfig, InsideNetworks
from sain_model.planar import PlanarConfig, PlanarPrior

INSIDE_ARCHITECTURE: Final = "network-inside-physics"


def load_inside(path: Path) -> InsideSain:
    """Return the networks at this path inside the prior that they were trained in.

    Raises:
        CheckpointError: the checkpoint is not sound.
    """
    content, card, text = read_checkpoint(path, INSIDE_ARCHITECTURE)
    try:
        networks = InsideNetworks(InsideNetworkConfig(**card.network))
        prior = PlanarPrior(PlanarConfig(**card.prior_config))
    except (TypeError, ConfigError) as error:
        raise CheckpointError(f"{card_path(path)}: {error}") from error
    fill(path, content, networks)
    return InsideSain(networks, prior, card.prior, card.weights_sha256, text)
