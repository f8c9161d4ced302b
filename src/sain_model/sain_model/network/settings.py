"""Settings of the network, importable without PyTorch."""

from dataclasses import dataclass
from typing import Final

from sain_core.config import Config, option

PUSH_FRAME: Final = "push"
WORLD_FRAME: Final = "world"  # the same, and where on the table and how turned things are
FRAMES: Final = (PUSH_FRAME, WORLD_FRAME)
ORDER: Final = "order"  # every member sees all of the data, in an order of its own
BOOTSTRAP: Final = "bootstrap"  # every member sees episodes drawn with replacement


@dataclass(frozen=True)
class PerceptronConfig(Config):
    """The size of f_rel and f_dyn."""

    hidden: int = option(64, "width of the hidden layers", minimum=1, maximum=1024)
    message: int = option(
        32, "width of the message from one body to another", minimum=1, maximum=1024
    )
    layers: int = option(2, "hidden layers of f_rel and of f_dyn", minimum=1, maximum=6)


@dataclass(frozen=True)
class NetworkConfig(PerceptronConfig):
    """The size of the network."""

    features: str = option(
        PUSH_FRAME,
        "frame of the features: that of the push, or that of the world too",
        choices=FRAMES,
    )
    members: int = option(1, "number of networks in the ensemble", minimum=1, maximum=64)
