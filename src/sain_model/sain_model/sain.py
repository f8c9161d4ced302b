"""SAIN as a `Dynamics`: a prior and the network that corrects it."""

from typing import Final

import numpy as np
import torch

from sain_core.dynamics import Dynamics
from sain_core.errors import InvalidInputError
from sain_core.history import PushHistory
from sain_core.push import LENGTH
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.features import apply_residual, make_features
from sain_model.friction import FrictionConfig, FrictionFilter
from sain_model.network import InteractionNetwork
from sain_model.planar import PlanarPrior
from sain_model.threads import settle_threads

LEARNED: Final = "learned"  # Fig. 1b: the network alone, on the identity prior
IDENTITY: Final = "identity"
RESIDUAL: Final = "residual"  # Fig. 1c, equation 2
RECURRENT: Final = "recurrent"  # Fig. 1d, equations 3 and 4: trained on its own rollouts
KINDS: Final = (LEARNED, RESIDUAL, RECURRENT)


class SainDynamics:
    """s' = f_p(s, a) + f_theta(f_p(s, a), s, a), the paper's equation 2.

    Attributes:
        prior: f_p.
        prior_name: its name for `sain_model.load.load_dynamics`.
        kind: ``residual`` or ``recurrent``, or ``learned`` when the prior is the identity.
        model_hash: SHA-256 of the weights; empty when they come from no checkpoint.
        card: the checkpoint's JSON card; empty likewise.
        friction: how it infers friction from an episode's earlier pushes; None: it was not
            trained to.
        recurrent: whether it was trained on rollouts of its own predictions.
    """

    def __init__(
        self,
        network: InteractionNetwork,
        prior: Dynamics,
        prior_name: str,
        model_hash: str = "",
        card: str = "",
        friction: FrictionConfig | None = None,
        recurrent: bool = False,
    ) -> None:
        """Correct this prior with this network."""
        self.network = network.eval()
        self.prior = prior
        self.prior_name = prior_name
        self.recurrent = recurrent
        on_physics = RECURRENT if recurrent else RESIDUAL
        self.kind = LEARNED if prior_name == IDENTITY else on_physics
        self.model_hash = model_hash
        self.card = card
        self.friction = friction

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
        return type(self)(
            self.network,
            self.prior.at(friction),
            self.prior_name,
            self.model_hash,
            self.card,
            self.friction,
            self.recurrent,
        )

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
        frame = self.network.config.features
        features = make_features(scenes, pushes, physics_next, frame)
        settle_threads()
        with torch.inference_mode():
            output = self.network(
                torch.from_numpy(features.disks.astype(np.float32)),
                torch.from_numpy(features.relations.astype(np.float32)),
            )
        residual = output.numpy().astype(np.float64)
        corrected = apply_residual(physics_next, pushes, residual)
        idle = pushes[:, LENGTH] == 0.0
        corrected[idle] = physics_next[idle]
        return corrected


def check_prediction(scenes: np.ndarray, physics_next: np.ndarray) -> None:
    """Check that a prediction is one of these scenes.

    Raises:
        InvalidInputError: it has another shape.
    """
    if physics_next.shape != scenes.shape:
        raise InvalidInputError(
            f"physics_next has shape {scenes.shape} like the scenes, not {physics_next.shape}"
        )
