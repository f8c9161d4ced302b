"""Answers what a model is asked over a wire: checked and bounded. No middleware here."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from sain_core.config import Config, option
from sain_core.dynamics import Dynamics, as_rollout
from sain_core.errors import ModelUnavailableError, TooMuchWorkError
from sain_core.scene import THETA, check_scene, make_scene, wrap_angle
from sain_core.types import PredictedScenes, Pushes, PushSequences, Scene, Scenes
from sain_model.sain import SainDynamics

WARM_UP_SCENE: Final = make_scene(
    np.array([(0.4, 0.0), (0.6, 0.0)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)
WARM_UP_PUSHES: Final = np.array([[[0.0, 0.0, 0.1]], [[0.5, 0.1, 0.05]]])  # (2, 1, 3)
PHYSICS: Final = "physics"


@dataclass(frozen=True)
class ServingConfig(Config):
    """What is served."""

    model: str = option("sain", "sain, planar, identity, or the path of a checkpoint")
    max_work: int = option(
        2_000_000, "largest samples x horizon x disks of a request", minimum=1, maximum=2**40
    )


@dataclass(frozen=True)
class Description:
    """What a model says of itself.

    Attributes:
        model: its name or path.
        kind: physics, learned or residual.
        prior: the physics below it; for a pure prior its own name.
        model_hash: SHA-256 of the weights; empty for a pure prior.
        card: the checkpoint's JSON card; empty for a pure prior.
    """

    model: str
    kind: str
    prior: str
    model_hash: str
    card: str


class ModelServer:
    """One model, asked for single pushes in a batch or for whole sequences."""

    def __init__(self, dynamics: Dynamics, config: ServingConfig) -> None:
        """Serve this dynamics. It is run once here, so that no request waits for compilation."""
        self.config = config
        self.description = describe(config.model, dynamics)
        self._dynamics = dynamics
        self._rollout = as_rollout(dynamics)
        self._rollout.rollout(WARM_UP_SCENE, WARM_UP_PUSHES)

    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        """Predict (K, H, N, 8) for push sequences (K, H, 3) from a scene (N, 8).

        Raises:
            InvalidInputError: a scene that cannot exist.
            TooMuchWorkError: K x H x N is above the limit.
            ModelUnavailableError: the model predicts NaN or Inf.
        """
        check_scene(scene)
        self._check_work(pushes.shape[0] * pushes.shape[1], len(scene))
        return self._finite(self._rollout.rollout(scene, pushes))

    def predict(
        self, scenes: Scenes, pushes: Pushes, physics_next: Scenes | None = None
    ) -> tuple[Scenes, Scenes]:
        """Predict where pushes (B, 3) lead from scenes (B, N, 8).

        Args:
            scenes: settled scenes.
            pushes: one a scene.
            physics_next: (B, N, 8), what to correct; None: what the model's own prior predicts.

        Returns:
            The residual (B, N, 8), angles wrapped, and the next state (B, N, 8).

        Raises:
            InvalidInputError: a scene that cannot exist.
            TooMuchWorkError: B x N is above the limit.
            ModelUnavailableError: the model predicts NaN or Inf.
        """
        for scene in scenes:
            check_scene(scene)
        self._check_work(len(scenes), scenes.shape[1])
        if not isinstance(self._dynamics, SainDynamics):  # physics alone corrects nothing
            if physics_next is None:
                physics_next = self._dynamics.step(scenes, pushes)
            return np.zeros_like(physics_next), self._finite(physics_next)
        if physics_next is None:
            physics_next = self._dynamics.prior.step(scenes, pushes)
        next_state = self._finite(self._dynamics.correct(scenes, pushes, physics_next))
        residual = next_state - physics_next
        residual[..., THETA] = wrap_angle(residual[..., THETA])
        return residual, next_state

    def _finite(self, predicted: np.ndarray) -> np.ndarray:
        if not np.isfinite(predicted).all():
            raise ModelUnavailableError(f"model {self.config.model!r} predicts NaN or Inf")
        return predicted

    def _check_work(self, predictions: int, disks: int) -> None:
        work = predictions * disks
        if work > self.config.max_work:
            raise TooMuchWorkError(
                f"{predictions} predictions of {disks} disks are {work} of work;"
                f" at most {self.config.max_work} are accepted"
            )


def describe(name: str, dynamics: Dynamics) -> Description:
    """Return what a dynamics of this name is."""
    if isinstance(dynamics, SainDynamics):
        return Description(
            name, dynamics.kind, dynamics.prior_name, dynamics.model_hash, dynamics.card
        )
    return Description(name, PHYSICS, name, "", "")
