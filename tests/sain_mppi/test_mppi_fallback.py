import numpy as np
import pytest

from sain_core.errors import CancelledError, ModelUnavailableError
from sain_mppi.fallback import FallbackRollout

SCENE, PUSHES = np.zeros((2, 8)), np.zeros((3, 1, 3))


class Model:
    """Answers with one number, or fails."""

    def __init__(self, value: float, error: Exception | None = None) -> None:
        self.value, self.error, self.asked = value, error, 0

    def rollout(self, scene: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        self.asked += 1
        if self.error is not None:
            raise self.error
        return np.full((*pushes.shape[:2], *scene.shape), self.value)


def test_a_model_that_answers_is_used() -> None:
    model, physics = Model(1.0), Model(2.0)
    rollout = FallbackRollout(model, physics)
    assert (rollout.rollout(SCENE, PUSHES) == 1.0).all()
    assert (rollout.failure, physics.asked) == (None, 0)


@pytest.mark.parametrize(
    ("model", "text"),
    [
        (Model(0.0, ModelUnavailableError("silent")), "silent"),
        (Model(np.nan), "48 of the model's 48 numbers are NaN or Inf"),
        (Model(np.inf), "48 of the model's 48 numbers are NaN or Inf"),
    ],
)
def test_a_model_that_fails_is_asked_once_a_plan(model: Model, text: str) -> None:
    rollout = FallbackRollout(model, Model(2.0))
    for _ in range(3):
        assert (rollout.rollout(SCENE, PUSHES) == 2.0).all()
    assert model.asked == 1
    assert str(rollout.failure) == text
    rollout.begin()
    assert rollout.failure is None
    rollout.rollout(SCENE, PUSHES)
    assert model.asked == 2


def test_a_defect_is_not_covered_up() -> None:
    with pytest.raises(ZeroDivisionError):
        FallbackRollout(Model(0.0, ZeroDivisionError()), Model(2.0)).rollout(SCENE, PUSHES)


def test_a_cancelled_plan_ends_until_the_next_begins() -> None:
    rollout = FallbackRollout(Model(1.0), Model(2.0))
    rollout.cancel()
    with pytest.raises(CancelledError):
        rollout.rollout(SCENE, PUSHES)
    rollout.begin()
    rollout.rollout(SCENE, PUSHES)
