"""A model that may fail, with physics to fall back on: planning goes on and says so."""

import logging
from dataclasses import dataclass, field
from threading import Event
from typing import Self

from sain_core.errors import CancelledError, ConfigError, SainError
from sain_core.history import PushHistory
from sain_core.model import Radii, RolloutModel, check_rollout
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import PredictedScenes, PushSequences, Scene

logger = logging.getLogger(__name__)


@dataclass
class Patience:
    """How long a plan waits for its model; shared with a model that answers from elsewhere.

    Attributes:
        until: a model that has not answered by this `time.monotonic` fails; None: no limit.
        cancelled: once it is set, the plan ends with `CancelledError`.
    """

    until: float | None = None
    cancelled: Event = field(default_factory=Event)


class FallbackRollout:
    """Predicts with a model; once it fails, with physics. Made anew for each plan.

    A model fails when it raises, is late (it raises then), predicts NaN or Inf, or predicts for
    another scene. Within one plan there is no way back: a silent model delays a plan only once.
    """

    def __init__(
        self,
        model: RolloutModel,
        physics: RolloutModel,
        history: PushHistory | None = None,
        bodies: Bodies = PAPER_DISKS,
        patience: Patience | None = None,
    ) -> None:
        """Ask this model, or else this physics.

        Physics is conditioned when it is first used: inferring a friction takes time.

        Args:
            model: to ask first.
            physics: to fall back on.
            history: the episode's earlier pushes, on which both are conditioned.
            bodies: shapes and roles.
            patience: with the model.
        """
        self._models, self._history, self._bodies = (model, physics), history, bodies
        self._patience = patience or Patience()
        self._physics: RolloutModel | None = None  # conditioned
        self.failure: SainError | None = None
        try:
            self._model = self._conditioned(model)
        except ConfigError as error:  # it cannot predict such bodies
            self.failure = error

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the same for these bodies, where the model has not failed yet."""
        return type(self)(*self._models, self._history, bodies, self._patience)

    def condition(self, history: PushHistory) -> Self:
        """Return the same conditioned on a history, where the model has not failed yet."""
        return type(self)(*self._models, history, self._bodies, self._patience)

    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        """Predict scenes (K, H, N, 8) for push sequences (K, H, 5) from one scene (N, 8)."""
        if self._patience.cancelled.is_set():
            raise CancelledError("the plan is no longer wanted")
        if self.failure is None:
            try:
                return check_rollout(self._model.rollout(scene, pushes), scene, pushes)
            except CancelledError:
                raise
            except SainError as error:
                logger.debug("falling back to physics: %s", error)
                self.failure = error
        if self._physics is None:
            self._physics = self._conditioned(self._models[1])
        return self._physics.rollout(scene, pushes)

    def regions(
        self, scene: Scene, pushes: PushSequences, predicted: PredictedScenes
    ) -> Radii | None:
        """Return the model's regions of what it predicted; None: it, or physics, has none."""
        if self.failure is not None:
            return None
        try:
            return self._model.regions(scene, pushes, predicted)
        except SainError as error:  # the plan stands without it
            logger.debug("no regions are known: %s", error)
            return None

    def _conditioned(self, model: RolloutModel) -> RolloutModel:
        model = model.with_bodies(self._bodies)
        return model if self._history is None else model.condition(self._history)
