"""Optimizers of other projects behind one method: from a nominal sequence to a better one.

pytorch_mppi and judo's `Optimizer` objects run as they are. Their controllers are not used: a model
of theirs steps through time, ours predicts whole sequences of pushes.

Numbers of a push are in units of half the push box, from its middle: angle and length are from -1
to 1, as with judo's action normalizer ``min_max``. Locations wrap, so they have no bounds.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import pytorch_mppi
import torch
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import ConfigError
from sain_core.push import LENGTH, LOCATION, PATH, PushLimits, make_push
from sain_core.scene import wrap_angle
from sain_core.types import PushSequences, Scalars

PYTORCH: Final = "pytorch_mppi"
JUDO_MPPI, JUDO_CEM, JUDO_PS = "judo mppi", "judo cem", "judo ps"
INSTALL: Final = (
    "./env pip install --no-deps judo-rai==0.1.0 viser==1.1.1 omegaconf==2.4.0 trimesh==5.2.0"
    " msgspec==0.22.0 websockets==17.4 antlr4-python3-runtime==4.9.3"
)

FEWEST: Final = 16  # samples of an iteration, judo's own default

PATH_SIZE: Final = PATH.stop - PATH.start
Numbers = Float[ndarray, "H 3"]
Costs = Callable[[Float[ndarray, "K H 3"]], Scalars]


@dataclass(frozen=True)
class PeerSettings:
    """How an optimizer is used.

    Attributes:
        optimizer: which one.
        samples: of a plan, divided among its iterations.
        horizon: pushes in a sequence.
        iterations: of a plan at most, judo's `max_opt_iters`.
        noise: standard deviation in the box's units; of judo cem the smallest.
        widest: the largest standard deviation of judo cem.
        temperature: lambda, in the unit of the costs.
        elites: of judo cem, a share of the samples; two at least.
        drawn: the first nominal of an episode is the best of as many uniform draws; otherwise it is
            the middle of the box.
        cheapest: execute the cheapest sample; otherwise the nominal.
        turn: unit of the location, a share of pi.
    """

    optimizer: str
    samples: int = 1024
    horizon: int = 4
    iterations: int = 1
    noise: float = 0.1
    widest: float = 1.0
    temperature: float = 0.05
    elites: float = 0.0
    drawn: bool = True
    cheapest: bool = False
    turn: float = 1.0

    @property
    def rounds(self) -> int:
        """Iterations of a plan: fewer where each would have too few samples."""
        return max(min(self.iterations, self.samples // FEWEST), 1)

    @property
    def each(self) -> int:
        """Samples of an iteration."""
        return self.samples // self.rounds


class PushBox:
    """The units of the numbers."""

    def __init__(self, limits: PushLimits, turn: float = 1.0) -> None:
        """Scale to these limits; locations to a share of pi."""
        half = limits.max_length / 2
        self._middle = np.array([0.0, 0.0, half])
        self._half = np.array([turn * np.pi, limits.max_angle, half])
        self.rest = np.array([0.0, 0.0, -1.0])
        self.high = np.array([np.inf, 1.0, 1.0])

    def pushes(self, numbers: Float[ndarray, "... 3"]) -> PushSequences:
        """Return the pushes (..., 5) that numbers in bounds name."""
        pushes = make_push(*np.moveaxis(self._middle + self._half * numbers, -1, 0))
        pushes[..., LOCATION] = wrap_angle(pushes[..., LOCATION])
        pushes[..., LENGTH] = np.clip(pushes[..., LENGTH], 0.0, 2 * self._half[-1])  # rounding
        return pushes

    def numbers(self, pushes: PushSequences) -> Float[ndarray, "... 3"]:
        """Return the numbers that name pushes (..., 5)."""
        return np.asarray((pushes[..., PATH] - self._middle) / self._half)

    def bounded(self, numbers: Float[ndarray, "... 3"]) -> Float[ndarray, "... 3"]:
        """Return numbers cut off at the bounds, as both projects do."""
        return np.clip(numbers, -self.high, self.high)


class PeerOptimizer(ABC):
    """An optimizer; what it adapts lasts for an episode."""

    @abstractmethod
    def improve(self, nominal: Numbers, costs: Costs) -> Numbers:
        """Return a better nominal (H, 3), after one iteration."""


class _WholeSequences(pytorch_mppi.MPPI):
    """pytorch_mppi's MPPI, with one call for the costs of all sequences."""

    costs: Costs

    def _compute_rollout_costs(self, perturbed_actions: torch.Tensor) -> tuple[Any, None, None]:
        return torch.from_numpy(self.costs(perturbed_actions.numpy())), None, None


class PytorchMppi(PeerOptimizer):
    """MPPI of pytorch_mppi."""

    def __init__(self, settings: PeerSettings, box: PushBox, seed: int) -> None:
        """Make it for an episode."""
        torch.manual_seed(seed)
        high = torch.from_numpy(box.high)
        self._control = _WholeSequences(
            None,  # the model is asked elsewhere
            None,
            1,
            torch.diag(torch.full((PATH_SIZE,), settings.noise**2, dtype=torch.float64)),
            num_samples=settings.each,
            horizon=settings.horizon,
            lambda_=settings.temperature,
            u_min=-high,
            u_max=high,
        )

    def improve(self, nominal: Numbers, costs: Costs) -> Numbers:
        """Return a better nominal (H, 3)."""
        self._control.costs = costs
        self._control.U = torch.from_numpy(nominal)
        self._control.command(torch.zeros(1, dtype=torch.float64), False)
        return np.asarray(self._control.get_action_sequence().numpy())


class JudoOptimizer(PeerOptimizer):
    """One of judo's optimizers; its knots are pushes."""

    def __init__(self, settings: PeerSettings, box: PushBox, seed: int) -> None:
        """Make it for an episode."""
        np.random.seed(seed)  # noqa: NPY002  (judo draws from it)
        self._box, self._optimizer = box, judo_optimizer(settings)

    def improve(self, nominal: Numbers, costs: Costs) -> Numbers:
        """Return a better nominal (H, 3), as `Controller.update_action` does."""
        sampled = self._box.bounded(self._optimizer.sample_control_knots(nominal))
        return np.asarray(self._optimizer.update_nominal_knots(sampled, -costs(sampled)))


def judo_optimizer(settings: PeerSettings) -> Any:
    """Return judo's own object with these settings.

    Raises:
        ConfigError: judo is not installed.
    """
    try:
        from judo.optimizers import get_registered_optimizers
    except ImportError as error:
        raise ConfigError(f"judo cannot be imported ({error}); {INSTALL}") from error
    make, config = get_registered_optimizers()[settings.optimizer.removeprefix("judo ")]
    common = {"num_rollouts": settings.each, "num_nodes": settings.horizon}
    own: dict[str, dict[str, Any]] = {
        JUDO_MPPI: {"sigma": settings.noise, "temperature": settings.temperature},
        JUDO_PS: {"sigma": settings.noise},
        JUDO_CEM: {
            "sigma_min": settings.noise,
            "sigma_max": settings.widest,
            "num_elites": max(round(settings.elites * settings.each), 2),
        },
    }
    return make(config(**common, **own[settings.optimizer]), PATH_SIZE)


def peer_optimizer(settings: PeerSettings, box: PushBox, seed: int) -> PeerOptimizer:
    """Return the optimizer for an episode."""
    adapter = PytorchMppi if settings.optimizer == PYTORCH else JudoOptimizer
    return adapter(settings, box, seed)
