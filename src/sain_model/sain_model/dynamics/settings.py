"""Names of models and settings of losses and rollouts, importable without PyTorch."""

from dataclasses import dataclass
from typing import Final

from sain_core.config import Config, option
from sain_model.network.settings import WORLD_FRAME, NetworkConfig, PerceptronConfig

PLANAR: Final = "planar"
PLANAR_AXES: Final = "planar_axes"
PLANAR_PRIORS: Final = (PLANAR, PLANAR_AXES)
SHIPPED: Final = "sain"
IDENTITY: Final = "identity"
STEPS: Final = (1, 5, 15)


@dataclass(frozen=True)
class LossConfig(Config):
    """The mixed loss of Algorithm 1, line 17, each term in units of a scale."""

    robust: bool = option(True, "Huber's loss: beyond a scale an error counts linearly")
    position_scale: float = option(0.001, "of position errors", unit="m", minimum=1e-6)
    velocity_scale: float = option(0.1, "of velocity errors", unit="m/s", minimum=1e-6)
    heading_scale: float = option(0.05, "of errors of sin and cos of the heading", minimum=1e-6)


@dataclass(frozen=True)
class RolloutConfig(Config):
    """How a network that has learned from single pushes goes on to learn from rollouts."""

    steps_ahead: int = option(
        1, "pushes of a training rollout; 1: single pushes only", minimum=1, maximum=100
    )
    rollout_epochs: int = option(12, "passes over the windows", minimum=1)
    rollout_batch: int = option(64, "windows in an optimizer step", minimum=1)
    rollout_learning_rate: float = option(
        1e-3, "learning rate at the start; it falls to 0 along a cosine", minimum=1e-7
    )
    max_grad_norm: float = option(
        1.0, "largest norm of a gradient; longer ones are scaled to it", minimum=1e-6
    )

    @property
    def wanted(self) -> bool:
        """Whether there is anything to learn from rollouts."""
        return self.steps_ahead > 1


@dataclass(frozen=True)
class CorrectionNetworkConfig(PerceptronConfig):
    """The size of the network."""

    places: int = option(
        5, "places on a disk's way where the map of the table is read; 0: no map", minimum=0
    )
    members: int = option(1, "number of networks in the ensemble", minimum=1, maximum=32)

    @property
    def seen(self) -> NetworkConfig:
        """Which features the network has: those of a network that sees the world."""
        return NetworkConfig(features=WORLD_FRAME)
