"""Settings of networks, and the names of models; importable without PyTorch."""

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Final

from sain_core.config import Config, option
from sain_core.errors import ConfigError

PUSH_FRAME: Final = "push"
WORLD_FRAME: Final = "world"  # the same, and where on the table and how turned things are
FRAMES: Final = (PUSH_FRAME, WORLD_FRAME)
ORDER: Final = "order"  # every member sees all of the data, in an order of its own
BOOTSTRAP: Final = "bootstrap"  # every member sees episodes drawn with replacement

EARLIER: Final = "earlier"  # training on physics with all that earlier pushes show

MASS_MIDDLE: Final = 8.0  # [kg], of the bodies that networks learn from


@dataclass(frozen=True)
class NetworkConfig(Config):
    """The size of the network, of f_rel and f_dyn, and what it sees."""

    hidden: int = option(64, "width of the hidden layers", minimum=1, maximum=1024)
    message: int = option(
        32, "width of the message from one body to another", minimum=1, maximum=1024
    )
    layers: int = option(2, "hidden layers of f_rel and of f_dyn", minimum=1, maximum=6)
    features: str = option(
        PUSH_FRAME,
        "frame of the features: that of the push, or that of the world too",
        choices=FRAMES,
    )
    believed: bool = option(
        False, "whether it sees what is believed of the physics of each body and of the table"
    )
    members: int = option(1, "number of networks in the ensemble", minimum=1, maximum=64)


def require_torch(what: str) -> None:
    """Raise `ConfigError` where PyTorch, which `what` needs, is not installed."""
    if find_spec("torch") is None:
        raise ConfigError(
            f"{what} needs PyTorch, which is not installed; install it with"
            " pip install '.[train]' in the checkout, or run inside ./env --with train"
        )


PLANAR: Final = "planar"
PLANAR_AXES: Final = "planar_axes"
PLANAR_PRIORS: Final = (PLANAR, PLANAR_AXES)
SHIPPED: Final = "sain"
IDENTITY: Final = "identity"
STEPS: Final = (1, 5, 15)
