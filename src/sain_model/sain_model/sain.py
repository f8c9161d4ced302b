"""SAIN as a `Dynamics`: a prior and the network that corrects it."""

from copy import copy
from functools import cached_property
from typing import Final, Self

import numpy as np

from sain_core.dynamics import Dynamics, StepwiseRollout
from sain_core.errors import InvalidInputError
from sain_core.history import PushHistory
from sain_core.types import PredictedScenes, Pushes, PushSequences, Scalars, Scene, Scenes
from sain_model.compiled_network import CompiledNetwork
from sain_model.devices import CPU
from sain_model.friction import FrictionConfig, FrictionFilter
from sain_model.network import InteractionNetwork
from sain_model.planar import PlanarPrior, check_batch
from sain_model.torch_network import TorchNetwork

LEARNED: Final = "learned"  # Fig. 1b: the network alone, on the identity prior
IDENTITY: Final = "identity"
RESIDUAL: Final = "residual"  # Fig. 1c, equation 2
KINDS: Final = (LEARNED, RESIDUAL)


class SainDynamics:
    """s' = f_p(s, a) + f_theta(f_p(s, a), s, a), the paper's equation 2.

    Attributes:
        prior: f_p.
        prior_name: its name for `sain_model.load.load_dynamics`.
        kind: ``residual``, or ``learned`` when the prior is the identity.
        model_hash: SHA-256 of the weights; empty when they come from no checkpoint.
        card: the checkpoint's JSON card; empty likewise.
        friction: how it infers friction from an episode's earlier pushes; None: it was not
            trained to.
        device: what the network runs on, ``cpu`` or ``cuda``. The prior stays on the CPU.
    """

    def __init__(
        self,
        network: InteractionNetwork,
        prior: Dynamics,
        prior_name: str,
        model_hash: str = "",
        card: str = "",
        friction: FrictionConfig | None = None,
        device: str = CPU,
    ) -> None:
        """Correct this prior with this network; its weights are read at the first prediction."""
        self.network = network.eval()
        self.prior = prior
        self.prior_name = prior_name
        self.kind = LEARNED if prior_name == IDENTITY else RESIDUAL
        self.model_hash = model_hash
        self.card = card
        self.friction = friction
        self.device = device

    @cached_property
    def _forward(self) -> CompiledNetwork | TorchNetwork:
        """The network as it runs here."""
        if self.device == CPU:
            return CompiledNetwork(self.network)
        return TorchNetwork(self.network, self.device)

    def on(self, device: str) -> Self:
        """Return this model with its network on a device, ``cpu`` or ``cuda``."""
        return self._with(device=device)

    @property
    def filter(self) -> FrictionFilter | None:
        """What infers the friction that the prior is told; None: this model learns nothing."""
        if self.friction is None or not isinstance(self.prior, PlanarPrior):
            return None
        return FrictionFilter(self.prior, self.prior.config.friction, self.friction)

    def with_history(self, history: PushHistory) -> "SainDynamics":
        """Return this model on the friction that an episode's earlier pushes tell of.

        It is the model itself without pushes, and where it was not trained to learn from them.
        """
        friction = self.filter
        if friction is None or len(history) == 0:
            return self
        return self.at(friction.infer(history).mean)

    def at(self, friction: float) -> "SainDynamics":
        """Return this model with its prior told this friction.

        Raises:
            InvalidInputError: the prior knows no friction.
        """
        if not isinstance(self.prior, PlanarPrior):
            raise InvalidInputError(f"the prior {self.prior_name!r} knows no friction")
        return self._with(prior=self.prior.at(friction))

    def _with(self, **changes: object) -> Self:
        """Return a copy in which some attributes are others."""
        changed = copy(self)
        vars(changed).update(changes)
        if "device" in changes:
            vars(changed).pop("_forward", None)  # else the copy shares it: the weights are the same
        return changed

    def step(self, scenes: Scenes, pushes: Pushes, friction: Scalars | None = None) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, 3) from scenes (B, N, 8).

        Args:
            scenes: settled scenes.
            pushes: one a scene.
            friction: with the table (B,), where it is known and the prior can be told.
        """
        if friction is not None and isinstance(self.prior, PlanarPrior):
            return self.correct(scenes, pushes, self.prior.step(scenes, pushes, friction))
        return self.correct(scenes, pushes, self.prior.step(scenes, pushes))

    def correct(self, scenes: Scenes, pushes: Pushes, physics_next: Scenes) -> Scenes:
        """Return the prediction `physics_next` (B, N, 8) of a prior, corrected.

        A push of zero length stays what the prior makes of it: nothing. Velocities, masses and
        radii are passed on as the prior left them.

        Raises:
            InvalidInputError: arrays that do not fit together.
        """
        check_prediction(scenes, physics_next)
        return self._forward.correct(scenes, pushes, physics_next)

    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        """Predict scenes (K, H, N, 8) for push sequences (K, H, 3) from one scene (N, 8).

        As `StepwiseRollout` does; on a planar prior and the CPU in one go, several times faster.

        Raises:
            InvalidInputError: wrong shapes, NaN or Inf, or a mass or radius that is not positive.
        """
        forward = self._forward
        if not isinstance(self.prior, PlanarPrior) or not isinstance(forward, CompiledNetwork):
            return StepwiseRollout(self).rollout(scene, pushes)
        flat = pushes.reshape(-1, pushes.shape[-1])
        check_batch(np.broadcast_to(scene, (len(flat), *scene.shape)), flat)
        return forward.rollout(self.prior, scene, pushes)


def check_prediction(scenes: np.ndarray, physics_next: np.ndarray) -> None:
    """Check that a prediction is one of these scenes.

    Raises:
        InvalidInputError: it has another shape.
    """
    if physics_next.shape != scenes.shape:
        raise InvalidInputError(
            f"physics_next has shape {scenes.shape} like the scenes, not {physics_next.shape}"
        )
