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
    """Answers with one number, or as `spoil` makes of it; with regions if it has any."""

    def __init__(self, value=1.0, spoil=lambda predicted: predicted, regions=None):
        self.value, self.spoil, self.radius, self.asked = value, spoil, regions, 0

    def rollout(self, scene, pushes):
        self.asked += 1
        predicted = np.full((*pushes.shape[:2], *scene.shape), self.value)
        predicted[..., MASS:] = scene[:, MASS:]
        return self.spoil(predicted)

    def regions(self, scene, pushes, predicted):
        self.spoil(predicted)
        return self.radius and np.full(predicted.shape[:3], self.radius)


def silent(predicted):
    raise ModelUnavailableError("silent")


def test_regions_are_the_model_s_and_nobody_s_where_it_fails():
    model = Answering(regions=0.01)
    rollout = FallbackRollout(model, Answering(2.0, regions=0.01))
    predicted = rollout.rollout(SCENE, PUSHES)
    assert (rollout.regions(SCENE, PUSHES, predicted) == 0.01).all()
    model.spoil = silent
    assert rollout.regions(SCENE, PUSHES, predicted) is None  # the plan stands without
    assert rollout.failure is None
    rollout.rollout(SCENE, PUSHES)
    assert rollout.regions(SCENE, PUSHES, predicted) is None  # physics predicted
    assert FallbackRollout(Answering(), model).regions(SCENE, PUSHES, predicted) is None


@pytest.mark.parametrize(
    ("spoil", "text"),
    [
        (silent, "silent"),
        (lambda p: np.full_like(p, np.nan), "the model predicts NaN or Inf in 48 of 48 numbers"),
        (lambda p: p + 1.0, "the model predicted disks of other masses or radii"),
        (lambda p: p[:, 1:], "the model predicted scenes of shape (3, 0, 2, 8); the shape must be"),
    ],
)
def test_a_model_that_fails_is_asked_once_a_plan(spoil, text):
    model = Answering(spoil=spoil)
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
