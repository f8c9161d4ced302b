"""SAIN as a `Dynamics`: a prior and the network that corrects it."""

from typing import Final

import numpy as np
import torch

from sain_core.dynamics import Dynamics
from sain_core.errors import InvalidInputError
from sain_core.push import LENGTH
from sain_core.types import Pushes, Scenes
from sain_model.features import apply_residual, make_features
from sain_model.network import InteractionNetwork
from sain_model.threads import settle_threads

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
    """

    def __init__(
        self,
        network: InteractionNetwork,
        prior: Dynamics,
        prior_name: str,
        model_hash: str = "",
        card: str = "",
    ) -> None:
        """Correct this prior with this network."""
        self.network = network.eval()
        self.prior = prior
        self.prior_name = prior_name
        self.kind = LEARNED if prior_name == IDENTITY else RESIDUAL
        self.model_hash = model_hash
        self.card = card

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, 3) from scenes (B, N, 8)."""
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
