"""A model that may fail, with physics to fall back on: planning goes on and says so."""

import logging
from threading import Event
from typing import Protocol, runtime_checkable

from sain_core.dynamics import Radii, RegionModel, RolloutModel
from sain_core.errors import CancelledError, ConfigError, SainError
from sain_core.history import PushHistory, informed_rollout
from sain_core.model_checks.response_check import check_finite_answer, check_rollout
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import PredictedScenes, PushSequences, Scene

logger = logging.getLogger(__name__)


@runtime_checkable
class Impatient(Protocol):
    """A model that may be waited for, which fails where an answer is not there in time."""

    def until(self, moment: float | None, cancelled: Event) -> None:
        """Wait no longer than until this `time.monotonic` (None: as long as usual).

        Once `cancelled` is set, a call that waits ends with `CancelledError`.
        """
        ...


class FallbackRollout:
    """Predicts with a model; once it fails, with physics, until the next plan begins.

    A model fails when it raises, is late (it raises then), predicts NaN or Inf, or predicts for
    another scene. Within one plan there is no way back: a silent model delays a plan only once.
    """

    def __init__(self, model: RolloutModel, physics: RolloutModel) -> None:
        """Ask this model, or else this physics."""
        self._models = model, physics
        self._model = model
        self._physics: RolloutModel | None = physics  # None: without the history so far
        self._history: PushHistory | None = None
        self._bodies: Bodies = PAPER_DISKS
        self._cancelled = Event()
        self.failure: SainError | None = None

    def begin(
        self,
        history: PushHistory,
        until: float | None = None,
        cancelled: Event | None = None,
        bodies: Bodies = PAPER_DISKS,
    ) -> None:
        """Begin a new plan: the model gets another chance.

        Physics learns from the history when it is first used: inferring a friction takes time.

        Args:
            history: the episode's earlier pushes, which model and physics learn from.
            until: a model that has not answered by this `time.monotonic` fails; None: no limit.
            cancelled: once it is set, the plan ends with `CancelledError`.
            bodies: shapes and roles.
        """
        self.failure = None
        self._cancelled = cancelled or Event()
        self._history, self._bodies, self._physics = history, bodies, None
        try:
            self._model = informed_rollout(self._models[0], history, bodies)
        except ConfigError as error:  # it cannot predict such bodies
            self.failure = error
            return
        if isinstance(self._model, Impatient):
            self._model.until(until, self._cancelled)

    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        """Predict scenes (K, H, N, 8) for push sequences (K, H, 3) from one scene (N, 8)."""
        if self._cancelled.is_set():
            raise CancelledError("the plan is no longer wanted")
        if self.failure is None:
            try:
                predicted = check_rollout(self._model.rollout(scene, pushes), scene, pushes)
                return check_finite_answer(predicted)
            except CancelledError:
                raise
            except SainError as error:
                logger.debug("falling back to physics: %s", error)
                self.failure = error
        if self._physics is None:
            assert self._history is not None
            self._physics = informed_rollout(self._models[1], self._history, self._bodies)
        return self._physics.rollout(scene, pushes)

    def regions(
        self, scene: Scene, pushes: PushSequences, predicted: PredictedScenes
    ) -> Radii | None:
        """Return how sure the model is of what it predicted; None: it, or physics, cannot tell."""
        if self.failure is not None or not isinstance(self._model, RegionModel):
            return None
        try:
            return self._model.regions(scene, pushes, predicted)
        except SainError as error:  # the plan stands without it
            logger.debug("no regions are known: %s", error)
            return None
