import numpy as np
import pytest

from sain_core.dynamics import (
    Dynamics,
    IdentityPrior,
    RolloutModel,
    StepwiseRollout,
    as_rollout,
    shaped,
)
from sain_core.errors import ConfigError
from sain_core.shapes.bodies import Bodies
from sain_core.types import PredictedScenes, Pushes, PushSequences, Scene, Scenes


class Shift:
    """Moves every disk along x by the push's length: where a sequence leads is easy to tell."""

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        after = scenes.copy()
        after[..., 0] += pushes[..., None, 2]
        return after


class Fused(Shift):
    def rollout(self, scene: Scene, pushes: PushSequences) -> PredictedScenes:
        return np.zeros((*pushes.shape[:2], *scene.shape))


def test_a_rollout_feeds_predictions_back() -> None:
    scene = np.arange(16.0).reshape(2, 8)
    pushes = np.random.default_rng(0).uniform(size=(5, 4, 3))
    predicted = StepwiseRollout(Shift()).rollout(scene, pushes)
    assert predicted.shape == (5, 4, 2, 8)
    moved = predicted[..., 0] - scene[:, 0]
    expected = np.broadcast_to(np.cumsum(pushes[..., 2], axis=1)[..., None], moved.shape)
    np.testing.assert_allclose(moved, expected)
    np.testing.assert_array_equal(predicted[..., 1:], np.broadcast_to(scene[:, 1:], (5, 4, 2, 7)))


def test_a_dynamics_is_not_asked_about_rests() -> None:
    counts: list[int] = []

    class Counting(Shift):
        def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
            counts.append(len(scenes))
            assert (pushes[:, 2] > 0.0).all()
            return super().step(scenes, pushes)

    pushes = np.ones((4, 3, 3))
    pushes[1:, 1, 2] = 0.0
    pushes[:, 2, 2] = 0.0
    predicted = StepwiseRollout(Counting()).rollout(np.zeros((2, 8)), pushes)
    assert counts == [4, 1]
    np.testing.assert_array_equal(predicted[:, -1, 0, 0], [2.0, 1.0, 1.0, 1.0])


def test_the_identity_prior_moves_nothing_and_gives_a_copy() -> None:
    scenes = np.ones((3, 2, 8))
    after = IdentityPrior().step(scenes, np.ones((3, 3)))
    np.testing.assert_array_equal(after, scenes)
    after += 1
    assert (scenes == 1).all()


def test_a_dynamics_own_rollout_is_preferred() -> None:
    fused = Fused()
    assert as_rollout(fused) is fused
    stepwise = as_rollout(Shift())
    assert isinstance(stepwise, RolloutModel)
    assert not isinstance(Shift(), RolloutModel)
    assert isinstance(Shift(), Dynamics)


def test_what_knows_only_disks_predicts_cubes_as_before_and_no_other_shape():
    model = Shift()
    assert shaped(model, Bodies.named(("disk", "cube"))) is model
    with pytest.raises(
        ConfigError, match="Shift can only predict disks; the bodies are three_feet, t:"
    ):
        shaped(model, Bodies.named(("disk", "t")))
