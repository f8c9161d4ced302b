import numpy as np
import pytest

from sain_core.errors import ModelUnavailableError
from sain_core.model import IdentityPrior, Model
from sain_core.push import idle_pushes
from sain_core.scene import MASS
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_mppi.agent.planning import FallbackRollout

SCENE, PUSHES = np.zeros((2, 8)), idle_pushes(3, 1)


class Answering(IdentityPrior):
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


class Elsewhere(Answering):
    """Answers for other disks."""

    def rollout(self, scene: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        return super().rollout(scene + 1.0, pushes)


class Short(Answering):
    """Forgets a push."""

    def rollout(self, scene: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        return super().rollout(scene, pushes)[:, 1:]


class Sure(Answering):
    """Has regions."""

    def regions(self, scene: np.ndarray, pushes: np.ndarray, predicted: np.ndarray) -> np.ndarray:
        if self.error is not None:
            raise self.error
        return np.full(predicted.shape[:3], 0.01)


def test_regions_are_the_model_s_and_nobody_s_where_it_fails():
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
    assert FallbackRollout(Answering(1.0), model).regions(SCENE, PUSHES, predicted) is None


@pytest.mark.parametrize(
    ("model", "text"),
    [
        (Answering(0.0, ModelUnavailableError("silent")), "silent"),
        (Answering(np.nan), "the model predicts NaN or Inf in 48 of 48 numbers"),
        (Answering(np.inf), "the model predicts NaN or Inf in 48 of 48 numbers"),
        (Elsewhere(1.0), "the model predicted disks of other masses or radii"),
        (Short(1.0), "the model predicted scenes of shape (3, 0, 2, 8); the shape must be"),
    ],
)
def test_a_model_that_fails_is_asked_once_a_plan(model, text):
    rollout = FallbackRollout(model, Answering(2.0))
    for _ in range(3):
        assert (rollout.rollout(SCENE, PUSHES)[..., 0] == 2.0).all()
    assert model.asked == 1
    assert str(rollout.failure).startswith(text)
    again = rollout.condition(PushHistory.empty())
    assert again.failure is None
    again.rollout(SCENE, PUSHES)
    assert model.asked == 2


def test_bodies_that_the_model_cannot_predict_are_left_to_physics():
    class DisksAlone(Answering):
        with_bodies = Model.with_bodies

    model = FallbackRollout(DisksAlone(1.0), Answering(2.0)).with_bodies(Bodies.named(["t"]))
    assert (model.rollout(SCENE, PUSHES)[..., 0] == 2.0).all()
    assert str(model.failure).startswith("DisksAlone can only predict disks")
