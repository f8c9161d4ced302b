from threading import Event

import numpy as np
import pytest

from sain_core.errors import CancelledError, ModelUnavailableError
from sain_core.history import PushHistory
from sain_core.scene import MASS
from sain_mppi.agent.fallback import FallbackRollout

NO_PAST = PushHistory.empty()
SCENE, PUSHES = np.zeros((2, 8)), np.zeros((3, 1, 3))


class Model:
    """Answers with one number, or fails."""

    def __init__(self, value: float, error: Exception | None = None) -> None:
        self.value, self.error, self.asked = value, error, 0

    def rollout(self, scene: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        self.asked += 1
        if self.error is not None:
            raise self.error
        predicted = np.full((*pushes.shape[:2], *scene.shape), self.value)
        if np.isfinite(self.value):
            predicted[..., MASS:] = scene[:, MASS:]
        return predicted


class Elsewhere(Model):
    """Answers for other disks."""

    def rollout(self, scene: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        return super().rollout(scene + 1.0, pushes)


class Short(Model):
    """Forgets a push."""

    def rollout(self, scene: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        return super().rollout(scene, pushes)[:, 1:]


class Sure(Model):
    """Has regions, and takes a moment until which it is waited for."""

    moment: float | None = None

    def regions(self, scene: np.ndarray, pushes: np.ndarray, predicted: np.ndarray) -> np.ndarray:
        if self.error is not None:
            raise self.error
        return np.full(predicted.shape[:3], 0.01)

    def until(self, moment: float | None, cancelled: Event) -> None:
        self.moment, self.cancelled = moment, cancelled


def test_regions_are_the_model_s_and_nobody_s_where_it_fails() -> None:
    model = Sure(1.0)
    rollout = FallbackRollout(model, Sure(2.0))
    predicted = rollout.rollout(SCENE, PUSHES)
    assert (rollout.regions(SCENE, PUSHES, predicted) == 0.01).all()
    model.error = ModelUnavailableError("silent")
    assert rollout.regions(SCENE, PUSHES, predicted) is None  # the plan stands without
    assert rollout.failure is None
    rollout.rollout(SCENE, PUSHES)
    model.error = None
    assert rollout.regions(SCENE, PUSHES, predicted) is None  # physics predicted
    assert FallbackRollout(Model(1.0), model).regions(SCENE, PUSHES, predicted) is None


def test_a_model_gets_what_ends_the_wait_for_it() -> None:
    model = Sure(1.0)
    cancelled = Event()
    FallbackRollout(model, Model(2.0)).begin(NO_PAST, until=5.0, cancelled=cancelled)
    assert (model.moment, model.cancelled) == (5.0, cancelled)
    FallbackRollout(Model(1.0), Model(2.0)).begin(NO_PAST, until=5.0)  # it cannot be hurried


def test_a_model_that_gives_a_cancelled_plan_up_has_not_failed() -> None:
    model, physics = Model(1.0, CancelledError("no longer wanted")), Model(2.0)
    rollout = FallbackRollout(model, physics)
    with pytest.raises(CancelledError, match="no longer wanted"):
        rollout.rollout(SCENE, PUSHES)
    assert (rollout.failure, physics.asked) == (None, 0)


def test_a_model_that_answers_is_used() -> None:
    model, physics = Model(1.0), Model(2.0)
    rollout = FallbackRollout(model, physics)
    assert (rollout.rollout(SCENE, PUSHES)[..., 0] == 1.0).all()
    assert (rollout.failure, physics.asked) == (None, 0)


@pytest.mark.parametrize(
    ("model", "text"),
    [
        (Model(0.0, ModelUnavailableError("silent")), "silent"),
        (Model(np.nan), "the model predicts NaN or Inf in 48 of 48 numbers"),
        (Model(np.inf), "the model predicts NaN or Inf in 48 of 48 numbers"),
        (Elsewhere(1.0), "the model predicted disks of other masses or radii"),
        (Short(1.0), "the model predicted scenes of shape (3, 0, 2, 8); the shape must be"),
    ],
)
def test_a_model_that_fails_is_asked_once_a_plan(model: Model, text: str) -> None:
    rollout = FallbackRollout(model, Model(2.0))
    for _ in range(3):
        assert (rollout.rollout(SCENE, PUSHES)[..., 0] == 2.0).all()
    assert model.asked == 1
    assert str(rollout.failure).startswith(text)
    rollout.begin(NO_PAST)
    assert rollout.failure is None
    rollout.rollout(SCENE, PUSHES)
    assert model.asked == 2


def test_a_defect_is_not_covered_up() -> None:
    with pytest.raises(ZeroDivisionError):
        FallbackRollout(Model(0.0, ZeroDivisionError()), Model(2.0)).rollout(SCENE, PUSHES)


def test_a_cancelled_plan_ends_until_the_next_begins() -> None:
    rollout = FallbackRollout(Model(1.0), Model(2.0))
    cancelled = Event()
    rollout.begin(NO_PAST, cancelled=cancelled)
    rollout.rollout(SCENE, PUSHES)
    cancelled.set()
    with pytest.raises(CancelledError):
        rollout.rollout(SCENE, PUSHES)
    rollout.begin(NO_PAST)
    rollout.rollout(SCENE, PUSHES)
